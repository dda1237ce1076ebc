//! Units of agent work for the allocator.

use std::{ops::Range, sync::Arc};

use bottega_kernels::compiled;

use super::{
    agent::{Agent, CastRange},
    network::Network,
    sensing::{SensingContext, SensingTask, SensorReadings},
    swarm::Swarm,
};
use crate::{
    error::RenderError,
    integrator::{PhotonIntegrator, sensing_settings},
    photon::Passes,
    prepare::PreparedScene,
    prepass::Prepass,
    settings::{PhotonSettings, View},
};

/// A unit of work that casts a range of lighting agents.
#[derive(Clone)]
pub struct AgentWork {
    /// The scene to trace in.
    pub scene: Arc<PreparedScene>,
    /// Prepass of the scene.
    pub prepass: Arc<Prepass>,
    /// Picture that the agents are cast for: they are sent to what it shows.
    pub view: View,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Indices of the agents.
    pub indices: Range<u32>,
    /// `true`: agents send scouts to surfaces without direct light.
    pub(crate) has_scouts: bool,
}

/// A unit of work in which some agents sense the light around them.
#[derive(Clone)]
pub struct SensorWork {
    /// The scene to trace in.
    pub(crate) scene: Arc<PreparedScene>,
    /// Settings of photons and agents.
    pub(crate) photons: PhotonSettings,
    /// Seed of the random numbers.
    pub(crate) seed: u64,
    /// Photon maps of the picture.
    pub(crate) passes: Arc<Passes>,
    /// The agents of the picture.
    pub(crate) swarm: Arc<Swarm>,
    /// Links between neighbouring agents.
    pub(crate) network: Arc<Network>,
    /// Agents, and the kind of sensors.
    pub(crate) task: SensingTask,
}

impl AgentWork {
    /// Casts the agents on the calling thread. Returns the agents that reached a surface, with their clones and scouts,
    /// in the order of their identities.
    pub fn perform(self) -> Vec<Agent> {
        let Self { scene, prepass, view, seed, indices, has_scouts } = self;
        let plan = prepass.photon_plan(&scene, &view);
        compiled::run(CastRange {
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
    /// Returns the number of agents of the task.
    pub(crate) fn agent_count(&self) -> u64 {
        self.task.agents().len() as u64
    }

    /// Runs the sensors on the calling thread. Returns their readings, in the order of the agents.
    ///
    /// # Errors
    /// [`RenderError::PhotonsInMedia`], [`RenderError::NoCamera`].
    pub fn perform(self) -> Result<SensorReadings, RenderError> {
        let Self { scene, photons, seed, passes, swarm, network, task } = self;
        let settings = sensing_settings(&photons, seed);
        let integrator = PhotonIntegrator::sensing(&scene, &settings, photons, Arc::clone(&passes))?;
        let maps = passes.of_sample(&scene, 0);
        Ok(compiled::run(SensingContext {
            integrator: &integrator,
            maps,
            swarm: &swarm,
            network: &network,
            seed,
            task,
        }))
    }
}
