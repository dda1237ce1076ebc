//! Casting and sensing of agents, by the paper's oracle or by the error oracle.

use std::{
    ops::Range,
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_kernels::compiled::{self, Task};
use rayon::prelude::*;

use super::{
    agent::{Agent, CastRange},
    camera::agents_of_view,
    map::{Agents, Indirect},
    network::Network,
    own, paper,
    report::{AgentReport, Tally},
    sensing::{AGENTS, Run, SENSING, SensingContext, SensingTask, SensorReadings},
    swarm::Swarm,
    visibility::Visibility,
};
use crate::{
    error::RenderError,
    extent::Extent,
    integrator::PhotonIntegrator,
    parts::parts,
    photon::{IrradianceMap, PhotonMaps, PhotonPlan},
    prepare::PreparedScene,
    settings::{AgentSettings, Oracle},
};

impl Task for SensingContext<'_> {
    type Output = SensorReadings;

    #[inline(always)]
    fn run(self) -> SensorReadings {
        let part_of = |part: &Range<u32>| part.start as usize..part.end as usize;
        match &self.task {
            SensingTask::Dig(indices) => paper::dig(&self, indices.clone()),
            SensingTask::Look { agents, part, numbers } => own::look(&self, &agents[part_of(part)], numbers.clone()),
            SensingTask::Measure { candidates, part, others } => {
                own::measure(&self, &candidates[part_of(part)], others)
            }
        }
    }
}

/// Casts agents on the current thread pool.
fn cast(prepared: &PreparedScene, plan: &PhotonPlan, settings: AgentSettings, seed: u64) -> Vec<Agent> {
    let works: Vec<_> = parts(settings.cast, AGENTS).collect();
    let (sources, plan) = (&*plan.sources, &plan.emission);
    let has_scouts = settings.has_scouts();
    let cast = |indices| compiled::run(CastRange { prepared, sources, plan, seed, indices, has_scouts });
    let parts: Vec<Vec<Agent>> = works.into_par_iter().map(cast).collect();
    parts.concat()
}

impl Agents {
    /// Casts agents and runs their sensing tasks, on the current thread pool.
    ///
    /// - `integrator`: estimates the light that arrives at a sensor.
    /// - `maps`: the photon maps of caustics.
    ///
    /// # Errors
    /// None in practice: tasks on this machine always run.
    pub(crate) fn new(
        prepared: &PreparedScene,
        settings: AgentSettings,
        integrator: &PhotonIntegrator<'_>,
        maps: &PhotonMaps,
        seed: u64,
    ) -> Result<Self, RenderError> {
        let begun = Instant::now();
        let plan = integrator.plan();
        let agents = cast(prepared, plan, settings, seed);
        let swarm = Swarm::new(
            plan.sources.source_count(),
            plan.extent(),
            agents_of_view(prepared, &plan.view, &settings),
            agents,
            &settings,
        );
        let casting = begun.elapsed();
        let network = Network::new(&swarm);
        let run = |errands: Vec<SensingTask>| {
            let sense =
                |task| compiled::run(SensingContext { integrator, maps, swarm: &swarm, network: &network, seed, task });
            Ok(joined(errands.into_par_iter().map(sense).collect()))
        };
        Self::sense(prepared, *plan.extent(), settings, &swarm, &network, run, [casting, Duration::ZERO])
    }

    /// Runs the sensing tasks of a swarm.
    ///
    /// - `extent`: extent of the visible part of the scene.
    /// - `run`: runs tasks.
    /// - `times`: duration of casting, and of sensing so far.
    ///
    /// # Errors
    /// A sensing task was not run.
    pub(super) fn sense(
        prepared: &PreparedScene,
        extent: Extent,
        settings: AgentSettings,
        swarm: &Swarm,
        network: &Network,
        mut run: impl FnMut(Vec<SensingTask>) -> Result<SensorReadings, RenderError>,
        times: [Duration; 2],
    ) -> Result<Self, RenderError> {
        let begun = Instant::now();
        let (mut agents, sensors) = match settings.oracle {
            Oracle::Paper => Self::dig(settings, swarm, network, &mut run)?,
            Oracle::Error => own::sense(prepared, extent, settings, swarm, network, &mut run)?,
        };
        agents.report = AgentReport {
            cast: settings.cast,
            agents: swarm.len() as u64,
            clones: swarm.agents.iter().filter(|agent| agent.clone > 0 && !agent.is_scout()).count() as u64,
            sensors,
            links: network.link_count(),
            object_distance: swarm.object_distance,
            map_bytes: agents.memory_bytes() as u64,
            casting: times[0],
            sensing: times[1] + begun.elapsed(),
            tally: Tally::default(),
            ..agents.report
        };
        Ok(agents)
    }

    /// Runs the sensing tasks of the paper's oracle.
    fn dig(
        settings: AgentSettings,
        swarm: &Swarm,
        network: &Network,
        run: &mut Run<'_>,
    ) -> Result<(Self, [u64; 4]), RenderError> {
        let sensed = run(parts(swarm.len() as u32, SENSING).map(SensingTask::Dig).collect())?;
        let answers = paper::answers(network, &sensed.discoveries);
        let (sensors, object_distance) = (IrradianceMap::new(sensed.irradiance), swarm.object_distance);
        let indirect = Indirect::Fitted(paper::FittedSensors { sensors, object_distance });
        let visibility = Arc::new(Visibility::new(swarm, network, &answers, settings.asks_network));
        Ok((Self::of(settings, visibility, indirect, &answers), sensed.sensors))
    }
}

/// Joins parts in order.
pub(super) fn joined(parts: Vec<SensorReadings>) -> SensorReadings {
    parts.into_iter().fold(SensorReadings::default(), |mut all, part| {
        all.append(part);
        all
    })
}
