//! The farm of MAGarRO (Gonzalez-Morcillo et al., *A MultiAgent System for Physically based Rendering Optimization*):
//! Analyst, importance map, partition, Blackboard, Master, Render Agents, auction, adaptation and composition.

mod adaptation;
mod auction;
mod blackboard;
mod compose;
mod contents;
mod ids;
mod importance;
mod partition;
mod settings;
mod vocabulary;

pub use adaptation::{Adaptation, AdaptationRule, RelativePower};
pub use auction::{AuctionRule, Contender, Proposal, award, credit_after, expected_end, offers};
pub use blackboard::{
    ATTEMPTS_MAX, AgentRow, Blackboard, FarmValue, InputRanges, Interval, ResultRef, WorkRow, ZoneRow, ZoneState,
    agent_key, work_key, work_prefix, zone_key,
};
pub use compose::{BandedZone, Mask, masks};
pub use contents::{Bid, FarmContent, FarmMessage, LifeCycle, ONTOLOGY, Offer, Order, Painting, Report, protocol};
pub use ids::{WorkId, ZoneId};
pub use importance::{ImportanceError, ImportanceFunction, ImportanceMap};
pub use partition::{Level, Partition, PartitionSettings, UnknownLevel};
pub use settings::{Choice, Optimization, UnknownOptimization, WorkSettings};
pub use vocabulary::{FarmAction, FarmCompletion, FarmEffect, FarmEvent, PaintOrder, PaintResult};
