//! Work on agents, as the allocator hands it out.

use std::{ops::Range, sync::Arc};

use bottega_kernels::compiled;

use super::{
    agent::{Agent, Casting},
    network::Network,
    sensing::{Sensing, SensingTask, SensorReadings},
    swarm::Swarm,
};
use crate::{
    PhotonSettings, PreparedScene, Prepass, RenderError, View,
    integrator::{PhotonIntegrator, sensing_settings},
    photon::Passes,
};

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
    /// Whether they send scouts to what no light shines at straight.
    pub(crate) has_scouts: bool,
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
    pub(crate) errand: SensingTask,
}

impl AgentWork {
    /// Casts them on the calling thread.
    pub fn perform(self) -> Vec<Agent> {
        let Self { scene, prepass, view, seed, indices, has_scouts } = self;
        let plan = prepass.photon_plan(&scene, view);
        compiled::run(Casting {
            prepared: &scene,
            sources: &plan.sources,
            plan: &plan.emission,
            seed,
            indices,
            has_scouts,
        })
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
    pub fn perform(self) -> Result<SensorReadings, RenderError> {
        let Self { scene, photons, seed, passes, swarm, network, errand } = self;
        let settings = sensing_settings(&photons, seed);
        let integrator = PhotonIntegrator::sensing(&scene, &settings, photons, Arc::clone(&passes))?;
        let maps = passes.of_sample(&scene, 0);
        Ok(compiled::run(Sensing { integrator: &integrator, maps, swarm: &swarm, network: &network, seed, errand }))
    }
}
