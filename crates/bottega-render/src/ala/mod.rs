//! Autonomous Lighting Agents: a few agents explore a scene's light, and answer questions while the picture is
//! rendered.
//!
//! Source: Herubel, Biri and Deverly 2009, *Autonomous Lighting Agents in Photon Mapping*; sections, equations and
//! tables without another source are those of this paper. `docs/ala.md` says how its formulas are read where they leave a choice. An
//! agent depends only on the scene, the settings, the seed and its index; its readings depend on these and on the
//! positions of all agents.

mod agent;
mod bytes;
mod camera;
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
pub(crate) use map::{Agents, LightUse};
pub use report::{AgentReport, Tally};
pub use sensing::SensorReadings;
pub use units::{AgentWork, SensorWork};
