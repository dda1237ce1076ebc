//! Sensing tasks of agents, and their readings.

use std::{ops::Range, sync::Arc};

use super::{agent::Agent, map::Agents, network::Network, probe::Probe, swarm::Swarm};
use crate::{
    error::RenderError,
    integrator::PhotonIntegrator,
    photon::{IrradiancePlaces, PhotonMaps, cache::IrradianceRecord},
    prepare::PreparedScene,
};

/// Agents cast per unit of work: some milliseconds.
pub(super) const AGENTS: u32 = 4096;
/// Agents that deploy sensors per unit of work.
pub(super) const SENSING: u32 = 512;
/// Candidates per unit of work of measurements; fewer, since each traces hundreds of paths.
pub(super) const MEASURING: u32 = 16;

/// Runs sensing tasks, and joins their readings in order.
pub(super) type Run<'a> = dyn FnMut(Vec<SensingTask>) -> Result<SensorReadings, RenderError> + 'a;

/// An agent and the side of its surface where it may measure irradiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    /// Index of the agent.
    pub(super) index: u32,
    /// `true`: the side that faces away from where the agent came from.
    pub(super) is_back: bool,
}

/// A sensing task.
#[derive(Clone)]
pub(crate) enum SensingTask {
    /// Run the gold miners of the paper with all four kinds of sensors; range of agent indices.
    Dig(Range<u32>),
    /// Test the visibility of lights, by agents of a list, with the sensors of these numbers.
    Look { agents: Arc<[u32]>, part: Range<u32>, numbers: Range<u32> },
    /// Measure indirect light at the candidates where the other records do not know it well enough.
    Measure { candidates: Arc<[Candidate]>, part: Range<u32>, others: Arc<Agents> },
}

impl SensingTask {
    /// Returns the range of the task's agents or candidates.
    pub(super) fn agents(&self) -> Range<u32> {
        match self {
            Self::Dig(part) | Self::Look { part, .. } | Self::Measure { part, .. } => part.clone(),
        }
    }
}

/// A sensing task with all that it needs.
pub(crate) struct SensingContext<'a> {
    /// Integrator that estimates the light at a sensor.
    pub(crate) integrator: &'a PhotonIntegrator<'a>,
    /// Photon maps of caustics.
    pub(crate) maps: &'a PhotonMaps,
    /// The agents of the picture.
    pub(crate) swarm: &'a Swarm,
    /// Links between neighbouring agents.
    pub(crate) network: &'a Network,
    /// Seed of the random numbers.
    pub(crate) seed: u64,
    /// The task to run.
    pub(crate) task: SensingTask,
}

/// The readings of agents' sensors, in the order of the task's agents.
#[derive(Clone, Debug, Default)]
pub struct SensorReadings {
    /// Readings of each agent about its light.
    pub(super) discoveries: Vec<Discovery>,
    /// Indirect irradiance at the sensors of the paper's oracle.
    pub(super) irradiance: IrradiancePlaces,
    /// Irradiance records of the error oracle.
    pub(super) records: Vec<IrradianceRecord>,
    /// Number of sensors by kind: geometry, proximity, penumbra, irradiance.
    pub(super) sensors: [u64; 4],
}

/// An agent's readings about its light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Discovery {
    /// Number of penumbra sensors that see the light.
    pub(super) lit: u32,
    /// Number of penumbra sensors that do not see the light.
    pub(super) shaded: u32,
    /// Number of sensors that found no surface; only by the error oracle.
    pub(super) lost: u32,
}

impl SensorReadings {
    /// Appends the readings of the agents that follow.
    pub(super) fn append(&mut self, mut later: Self) {
        self.discoveries.append(&mut later.discoveries);
        self.irradiance.append(later.irradiance);
        self.records.append(&mut later.records);
        self.sensors.iter_mut().zip(later.sensors).for_each(|(sum, part)| *sum += part);
    }
}

impl<'a> SensingContext<'a> {
    /// Returns the scene.
    pub(super) fn prepared(&self) -> &'a PreparedScene {
        self.integrator.prepared()
    }

    /// Returns an agent.
    pub(super) fn agent(&self, index: u32) -> &'a Agent {
        &self.swarm.agents[index as usize]
    }

    /// Returns the probe of an agent.
    pub(super) fn probe(&self, index: u32) -> Probe<'a> {
        let agent = self.agent(index);
        let reach = if agent.is_camera() { agent.gap } else { self.network.reach(index) };
        Probe { prepared: self.prepared(), agent, seed: self.seed, reach }
    }
}
