//! The farm of MAGarRO (Gonzalez-Morcillo et al., *A MultiAgent System for Physically based Rendering Optimization*):
//! which agent paints which part of the picture, and how hard must it try there?
//!
//! - [`Analyst`] makes the [`ImportanceMap`] and the [`Partition`], and puts a row for each zone on the [`Blackboard`].
//! - [`Master`] knows the agents, has the zones profiled, auctions them, takes the results and has them composed.
//! - [`RenderAgent`] measures itself, bids, asks its [`Expert`] what a zone is worth, and has it painted.
//! - [`run`] runs all of them in this process over a [`RenderEngine`](bottega_engines::RenderEngine).
//!
//! The decision that shaped it: the agents are state machines, and what they must not forget stands on the Blackboard
//! and nowhere else. Every order is a compare-and-set on a zone's row, whose revision the result must carry. So any
//! agent, the Master too, may die at any moment, and no pixel is lost or composed twice.
//!
//! Not here: sockets, clocks, files ([`run`] has threads, and time from the platform); what a sample is.
//!
//! # Where is what
//!
//! | what | where |
//! |---|---|
//! | importance of each place: cost and visibility | `src/importance.rs`, `src/importance/` |
//! | the Analyst and its zones | `src/analyst.rs`, `src/partition.rs`, `src/partition/` |
//! | rows of zones, works and agents | `src/blackboard.rs` |
//! | the Master: orders, results, composition | `src/master.rs`, `src/master/` |
//! | the auction | `src/auction.rs`, `src/auction/` |
//! | the end of a work: zones are cut and given twice | `src/master/tail.rs` |
//! | orders that stand still; agents that fail often | `src/master/pace.rs`, `src/master/trust.rs` |
//! | work that waits though somebody is free | `src/watchdog.rs`, `src/master/stall.rs` |
//! | comparing what untrusted agents paint; by its look | `src/master/verify.rs`, `src/master/likeness.rs` |
//! | a goal of error or time | `src/cells.rs`, `src/goals.rs`, `src/master/plan.rs`; rules: `rules/goals.fcl` |
//! | the platform of a job: directories; how agents register and find their Master | `src/directory.rs`; `src/registrant.rs`, `src/render_agent/membership.rs` |
//! | the Render Agent; its V_cp | `src/render_agent.rs`, `src/adaptation.rs` |
//! | a Render Agent whose painter is an agent of another platform | `src/visitor.rs` |
//! | quality of a zone, by rules | `src/expert.rs`, `rules/path-tracing.fcl`; other engines: `rules/NAME.fcl`, which their manifests name |
//! | what outputs of rules mean | `src/technique.rs` |
//! | which of two engines suits a zone | `src/engine_choice.rs`, `rules/engine-choice.fcl` |
//! | blending of neighbouring zones | `src/compose.rs` |
//! | parts of work before a picture, shared out: who may take which, and until when | `src/shared_work.rs` |
//! | agents in this process; over several machines | `src/driver.rs`, `src/driver/`; `src/driver/link.rs`, `src/driver/transport.rs`, `src/wire.rs`, `src/wire/` |
//! | agents in virtual time; what must hold after each run | `src/simulate/`; `src/simulate/invariants.rs`, `src/simulate/film.rs` |
//! | what a run took, written down | `src/simulate/recorder.rs` |
//! | how long zones should take, by what was learnt in works before | `src/experience.rs`, `src/experience/`, `src/importance/outlook.rs`, `src/driver/learner.rs` |
//! | how well times were predicted | `src/prediction.rs` |
//! | how far a job is, and how long it takes yet | `src/progress.rs`, `src/throughput.rs` |
//! | what is kept for `--resume` | `src/journal.rs` |

mod adaptation;
mod agent;
mod analyst;
mod auction;
mod blackboard;
mod cells;
mod compose;
mod contents;
mod directory;
mod driver;
mod engine_choice;
mod experience;
mod expert;
mod goals;
mod ids;
mod importance;
mod journal;
mod master;
mod painting;
mod partition;
mod prediction;
mod progress;
mod registrant;
mod render_agent;
mod settings;
mod shared_work;
mod short_map;
pub mod simulate;
mod technique;
mod throughput;
mod visitor;
mod vocabulary;
mod watchdog;
mod wire;
mod work_keys;
mod zone_inputs;

pub use adaptation::{Adaptation, AdaptationRule, RelativePower};
pub use agent::FarmAgent;
pub use analyst::{Analysis, Analyst, AnalystConfig, analyze, survey_size};
pub use auction::{
    AuctionRule, AuctionTally, Award, Bidder, BidderStanding, Credit, Decision, Field, MemberId, OpenZones, Proposal,
    RoundSummary, Theft, decide,
};
pub use blackboard::{
    ATTEMPTS_MAX, AgentRow, Blackboard, Cut, FarmValue, InputRanges, Interval, Rival, Vote, WorkRow, ZoneRow, ZoneState,
};
pub use compose::{BandedZone, Mask, masks};
pub use contents::{
    Bid, FarmContent, FarmMessage, Holding, LifeCycle, ONTOLOGY, Offer, Order, PassedOrder, Report, protocol,
};
pub use directory::{
    DirectoryService, JOB_OWNERSHIP, PLATFORM, RegistrationConfig, directory_service_names, directory_services,
    service_type,
};
pub use driver::{
    AGENTS_MAX, JobAgent, JobError, JobReport, JobSettings, JobTransport, JobUplink, Link, MasterHandle, Observer,
    StopSwitch, TransportError, VERIFY_MAX, assist, benchmark, lead, run,
};
pub use engine_choice::EngineChoice;
pub use experience::{Experience, ExperienceError, Foreknowledge, JobLesson, LearntFactor, PaintedZone};
pub use expert::{BAND_MAX, BandWidth, Expert};
pub use goals::GoalRules;
pub use ids::{WorkId, ZoneId};
pub use importance::{
    Channel, ChannelSet, ImportanceError, ImportanceFunction, ImportanceMap, TaskFeatures, TaskOutlook, UnknownChannel,
};
pub use journal::{Journal, JournalContents, JournalError, JournalWriter, ZoneStore};
pub use master::{Master, MasterConfig, Timing};
pub use painting::{Painting, ResultRef};
pub use partition::{Balance, Level, NeighborDifference, Partition, PartitionSettings, UnknownLevel, ZoneLimits};
pub use prediction::{Forecast, Prediction};
pub use progress::{Progress, Times};
pub use registrant::MasterSource;
pub use render_agent::{RenderAgent, RenderAgentConfig};
pub use settings::{Choice, ErrorUse, Goal, Optimization, UnknownOptimization, WorkSettings};
pub use shared_work::{NextPart, SharedPart, next_part};
pub use technique::{OutputMeaning, PAPER_RULES, PAPER_RULES_NAME, Technique};
pub use visitor::{Visitor, VisitorConfig, VisitorEffect, VisitorReport};
pub use vocabulary::{FarmAction, FarmCompletion, FarmEffect, FarmEvent, PaintOrder, PaintResult, STEP_MAX};
pub use watchdog::{STALLED_AFTER, Watchdog};
pub use wire::{FarmCodec, WireError, digest};
pub use work_keys::{WorkKeys, compare_and_set};
pub use zone_inputs::ExpertError;
