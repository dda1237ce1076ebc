//! The agents of a picture, cast and looking around by whatever the allocator has.

use std::{ops::Range, sync::Arc, time::Instant};

use bottega_kernels::compiled;

use super::{
    agent::{Agent, Casting},
    map::{Agents, joined},
    network::Network,
    sensing::{Errand, Sensed, Sensing},
    swarm::Swarm,
};
use crate::{
    PhotonSettings, PreparedScene, Prepass, RenderError, RenderOutput, RenderWork, View,
    integrator::{PhotonIntegrator, sensing_settings},
    photon::{Passes, parts},
    sharing::Hands,
};

/// Agents that one unit of work casts: some milliseconds.
pub(super) const AGENTS: u32 = 4096;
/// Agents that look around in one unit of work.
pub(super) const SENSING: u32 = 512;
/// Those that measure indirect light by our own rules: fewer, since each that must follows hundreds of paths.
pub(super) const MEASURING: u32 = 16;

/// Agents to be cast.
#[derive(Clone)]
pub struct AgentWork {
    /// The scene.
    pub scene: Arc<PreparedScene>,
    /// What is known of it.
    pub prepass: Arc<Prepass>,
    /// The picture: agents are sent to what it shows.
    pub view: View,
    /// Another seed gives other agents.
    pub seed: u64,
    /// Which of them.
    pub indices: Range<u32>,
}

/// Sensors to be deployed.
#[derive(Clone)]
pub struct SensorWork {
    /// The scene.
    pub(crate) scene: Arc<PreparedScene>,
    pub(crate) photons: PhotonSettings,
    pub(crate) seed: u64,
    pub(crate) passes: Arc<Passes>,
    pub(crate) swarm: Arc<Swarm>,
    pub(crate) network: Arc<Network>,
    /// By whom, and what for.
    pub(crate) errand: Errand,
}

impl AgentWork {
    /// Casts them on the calling thread.
    pub fn perform(self) -> Vec<Agent> {
        let Self { scene, prepass, view, seed, indices } = self;
        let plan = prepass.photon_plan(&scene, view);
        compiled::run(Casting { prepared: &scene, sources: &plan.sources, plan: &plan.emission, seed, indices })
    }
}

impl SensorWork {
    /// Agents on the errand.
    pub(crate) fn agent_count(&self) -> u64 {
        self.errand.agents().len() as u64
    }

    /// Deploys them on the calling thread.
    ///
    /// # Errors
    /// The scene has no camera, or media.
    pub fn perform(self) -> Result<Sensed, RenderError> {
        let Self { scene, photons, seed, passes, swarm, network, errand } = self;
        let settings = sensing_settings(&photons, seed);
        let integrator = PhotonIntegrator::sensing(&scene, &settings, photons, Arc::clone(&passes))?;
        let maps = passes.of_sample(&scene, 0);
        Ok(compiled::run(Sensing { integrator: &integrator, maps, swarm: &swarm, network: &network, seed, errand }))
    }
}

/// The agents of a picture whose caustics are known.
pub(crate) fn cast_agents(
    scene: &Arc<PreparedScene>,
    prepass: &Arc<Prepass>,
    view: View,
    photons: PhotonSettings,
    seed: u64,
    passes: &Arc<Passes>,
    hands: &Hands<'_>,
) -> Result<Agents, RenderError> {
    let settings = photons.agents.unwrap_or_default();
    let begun = Instant::now();
    let works = parts(settings.cast, AGENTS).map(|indices| {
        let (scene, prepass) = (Arc::clone(scene), Arc::clone(prepass));
        RenderWork::Agents(AgentWork { scene, prepass, view, seed, indices })
    });
    let answer = |output| if let RenderOutput::Agents(part) = output { Some(part) } else { None };
    let agents = hands.run(works.collect(), answer)?;
    let plan = passes.plan();
    let swarm = || Swarm::new(plan.sources.source_count(), plan.extent(), agents.concat(), &settings);
    let swarm = Arc::new(scene.on_threads(swarm));
    let casting = begun.elapsed();
    let network = Arc::new(scene.on_threads(|| Network::new(&swarm)));
    let work = |errand| {
        let (scene, passes) = (Arc::clone(scene), Arc::clone(passes));
        let (swarm, network) = (Arc::clone(&swarm), Arc::clone(&network));
        RenderWork::Sensors(Box::new(SensorWork { scene, photons, seed, passes, swarm, network, errand }))
    };
    let run = |errands: Vec<Errand>| {
        let answer = |output| if let RenderOutput::Sensors(part) = output { Some(part) } else { None };
        hands.run(errands.into_iter().map(work).collect(), answer).map(joined)
    };
    Agents::sense(scene, *passes.plan().extent(), settings, &swarm, &network, run, [casting, begun.elapsed() - casting])
}
