//! Parallel casting and sensing of agents by the allocator.

use std::{sync::Arc, time::Instant};

use super::{
    camera::agents_of_view,
    map::Agents,
    network::Network,
    sense::joined,
    sensing::{AGENTS, SensingTask},
    swarm::Swarm,
    units::{AgentWork, SensorWork},
};
use crate::{
    error::RenderError,
    parts::parts,
    photon::Passes,
    prepare::PreparedScene,
    prepass::Prepass,
    settings::{PhotonSettings, View},
    sharing::Executors,
    work::{RenderOutput, RenderWork},
};

/// Casts the agents of a picture and runs their sensing tasks as units of work. The caustic photons must exist.
pub(crate) fn cast_agents(
    scene: &Arc<PreparedScene>,
    prepass: &Arc<Prepass>,
    view: &View,
    photons: PhotonSettings,
    seed: u64,
    passes: &Arc<Passes>,
    executors: &Executors<'_>,
) -> Result<Agents, RenderError> {
    let settings = photons.agents.unwrap_or_default();
    let begun = Instant::now();
    let works = parts(settings.cast, AGENTS).map(|indices| {
        let (scene, prepass) = (Arc::clone(scene), Arc::clone(prepass));
        let (view, has_scouts) = (view.clone(), settings.has_scouts());
        RenderWork::Agents(AgentWork { scene, prepass, view, seed, indices, has_scouts })
    });
    let answer = |output| if let RenderOutput::Agents(part) = output { Some(part) } else { None };
    let agents = executors.run(works.collect(), answer)?;
    let plan = passes.plan();
    let swarm = || {
        let of_view = agents_of_view(scene, view, &settings);
        Swarm::new(plan.sources.source_count(), plan.extent(), of_view, agents.concat(), &settings)
    };
    let swarm = Arc::new(scene.on_threads(swarm));
    let casting = begun.elapsed();
    let network = Arc::new(scene.on_threads(|| Network::new(&swarm)));
    let work = |task| {
        let (scene, passes) = (Arc::clone(scene), Arc::clone(passes));
        let (swarm, network) = (Arc::clone(&swarm), Arc::clone(&network));
        RenderWork::Sensors(Box::new(SensorWork { scene, photons, seed, passes, swarm, network, task }))
    };
    let run = |errands: Vec<SensingTask>| {
        let answer = |output| if let RenderOutput::Sensors(part) = output { Some(part) } else { None };
        executors.run(errands.into_iter().map(work).collect(), answer).map(joined)
    };
    Agents::sense(scene, *passes.plan().extent(), settings, &swarm, &network, run, [casting, begun.elapsed() - casting])
}
