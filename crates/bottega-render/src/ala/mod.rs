//! Autonomous Lighting Agents: a few agents that find out what a scene is like, and answer while the picture is painted.
//!
//! Source: Herubel, Biri and Deverly 2009, *Autonomous Lighting Agents in Photon Mapping*. Where its formulas leave a choice,
//! `docs/ala.md` says how they are read here. An agent depends on the scene, the settings, the seed and its index alone; what
//! it senses, on these and on where all agents are.

mod agent;
mod bytes;
mod cast;
mod drawing;
mod ludd;
mod map;
mod network;
mod own;
mod paper;
mod probe;
mod report;
mod sense;
mod sensing;
mod swarm;
mod units;
mod visibility;

pub use agent::Agent;
pub(crate) use cast::cast_agents;
pub use drawing::network_dots;
pub use ludd::{Criterion, Density, Dot, LocalSphere, Ludd, SampleSet, Samples, UnknownCriterion, useful_data_density};
pub(crate) use map::Agents;
pub use report::{AgentReport, Tally};
pub use sensing::SensorReadings;
pub use units::{AgentWork, SensorWork};
