//! The sensing of agents: what they are sent out to find, and what they bring back.

use std::{ops::Range, sync::Arc};

use super::{agent::Agent, map::Agents, network::Network, probe::Probe, swarm::Swarm};
use crate::{
    RenderError,
    integrator::PhotonIntegrator,
    photon::{IrradiancePlaces, PhotonMaps, cache::IrradianceRecord},
    prepare::PreparedScene,
};

/// Agents that one unit of work casts: some milliseconds.
pub(super) const AGENTS: u32 = 4096;
/// Agents that look around in one unit of work.
pub(super) const SENSING: u32 = 512;
/// Those that measure indirect light by our own rules: fewer, since each that must follows hundreds of paths.
pub(super) const MEASURING: u32 = 16;

/// Does errands, and joins what was found in their order.
pub(super) type Run<'a> = dyn FnMut(Vec<SensingTask>) -> Result<SensorReadings, RenderError> + 'a;

/// An agent, and the side of its surface that it would measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    pub(super) index: u32,
    /// Whether it is the side that the agent did not come from.
    pub(super) is_back: bool,
}

/// What some agents are to do.
#[derive(Clone)]
pub(crate) enum SensingTask {
    /// To dig as the gold miners of the paper: all four kinds of sensors.
    Dig(Range<u32>),
    /// To look for the light: agents from a list, each by the sensors with these numbers.
    Look { who: Arc<[u32]>, part: Range<u32>, numbers: Range<u32> },
    /// To measure the indirect light wherever the others do not know it well enough.
    Measure { who: Arc<[Candidate]>, part: Range<u32>, others: Arc<Agents> },
}

impl SensingTask {
    /// Which of its agents go.
    pub(super) fn agents(&self) -> Range<u32> {
        match self {
            Self::Dig(part) | Self::Look { part, .. } | Self::Measure { part, .. } => part.clone(),
        }
    }
}

/// Agents on an errand.
pub(crate) struct Sensing<'a> {
    pub(crate) integrator: &'a PhotonIntegrator<'a>,
    pub(crate) maps: &'a PhotonMaps,
    pub(crate) swarm: &'a Swarm,
    pub(crate) network: &'a Network,
    pub(crate) seed: u64,
    pub(crate) errand: SensingTask,
}

/// The readings of agents, in the order of the task.
#[derive(Clone, Debug, Default)]
pub struct SensorReadings {
    /// Of each agent.
    pub(super) discoveries: Vec<Discovery>,
    /// Irradiance sensors of the paper: the indirect irradiance.
    pub(super) irradiance: IrradiancePlaces,
    /// Our own irradiance sensors.
    pub(super) records: Vec<IrradianceRecord>,
    /// Sensors by kind: geometry, proximity, penumbra, irradiance.
    pub(super) sensors: [u64; 4],
}

/// What an agent knows of its light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Discovery {
    /// Penumbra sensors that see it, and that do not.
    pub(super) lit: u32,
    pub(super) shaded: u32,
    /// Those that found no surface to stand on, by our own rules.
    pub(super) lost: u32,
}

impl SensorReadings {
    /// Adds what the agents that follow found out.
    pub(super) fn append(&mut self, mut later: Self) {
        self.discoveries.append(&mut later.discoveries);
        self.irradiance.append(later.irradiance);
        self.records.append(&mut later.records);
        self.sensors.iter_mut().zip(later.sensors).for_each(|(sum, part)| *sum += part);
    }
}

impl<'a> Sensing<'a> {
    pub(super) fn prepared(&self) -> &'a PreparedScene {
        self.integrator.prepared()
    }

    pub(super) fn agent(&self, index: u32) -> &'a Agent {
        &self.swarm.agents[index as usize]
    }

    /// Where the sensors of an agent go.
    pub(super) fn probe(&self, index: u32) -> Probe<'a> {
        Probe { prepared: self.prepared(), agent: self.agent(index), seed: self.seed, reach: self.network.reach(index) }
    }
}
