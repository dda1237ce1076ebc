//! The farm of MAGarRO (Gonzalez-Morcillo et al., *A MultiAgent System for Physically based Rendering Optimization*).
//!
//! Analyst, importance map, partition, Blackboard, Master, Render Agents, auction, adaptation and composition.

mod compose;
mod ids;
mod importance;
mod partition;

pub use compose::{BandedZone, Mask};
pub use ids::{WorkId, ZoneId};
pub use importance::{ImportanceError, ImportanceFunction, ImportanceMap};
pub use partition::{Level, Partition, PartitionSettings, UnknownLevel};
