//! The farm of MAGarRO (Gonzalez-Morcillo et al., *A MultiAgent System for Physically based Rendering Optimization*):
//! assigns the zones of a picture to agents, and chooses the samples and settings of each zone.
//!
//! - [`Analyst`] makes the [`ImportanceMap`] and the [`Partition`], and writes a row per zone to the [`Blackboard`].
//! - [`Master`] keeps the list of agents, has the zones profiled, auctions them, takes the results and has them
//!   composed.
//! - [`RenderAgent`] runs its benchmark, bids, lets its [`Expert`] choose the settings of a zone, and has it painted.
//! - [`run`] runs all of them in this process over a [`RenderEngine`](bottega_engines::RenderEngine).
//!
//! The decision that shaped this crate: agents are state machines, and everything that must survive a crash is on the
//! Blackboard. Every order is a compare-and-set on a zone's row, and its result must carry that revision of the row. So
//! any agent, including the Master, may fail at any moment, and no pixel is lost or composed twice.
//!
//! Not in this crate: sockets, clocks and files (the agents ask for effects; [`run`] supplies threads and the
//! platform's time); how a sample is rendered.
//!
//! # Modules
//!
//! | subject | files |
//! |---|---|
//! | importance of each part of the picture: cost and visibility | `src/importance.rs`, `src/importance/` |
//! | the Analyst and its zones | `src/analyst.rs`, `src/partition.rs`, `src/partition/` |
//! | the Blackboard: rows of zones, works and agents | `src/blackboard.rs` |
//! | the Master: its values, and who passes messages to them | `src/master.rs`, `src/master/routing.rs` |
//! | the Master: rows, counts and agents; results; composition | `src/master/assignments.rs`; `src/master/results.rs`; `src/master/composition.rs` |
//! | the auction | `src/auction.rs`, `src/auction/`, `src/master/rounds.rs` |
//! | the end of a work: cutting zones; awarding a zone to a second agent | `src/master/offcuts.rs`; `src/master/tail.rs` |
//! | orders without progress; agents that fail often | `src/master/pace.rs`, `src/master/trust.rs` |
//! | stalls: zones wait although agents are free | `src/watchdog.rs`, `src/master/stall.rs` |
//! | comparing the paintings of untrusted agents: bit for bit, or by their look | `src/master/verify.rs`, `src/master/comparisons.rs` |
//! | goals: a relative error or a time instead of a sample count | `src/cells.rs`, `src/goals.rs`, `src/master/plan.rs`; rules: `rules/goals.fcl` |
//! | directories of a job; how agents register and find their Master | `src/directory.rs`; `src/registrant.rs`, `src/render_agent/membership.rs` |
//! | the Render Agent; its V_cp | `src/render_agent.rs`, `src/adaptation.rs` |
//! | a Render Agent whose painter is an agent of another platform | `src/visitor.rs` |
//! | the Expert: quality of a zone, by fuzzy rules | `src/expert.rs`, `rules/path-tracing.fcl`; other engines: `rules/NAME.fcl`, named in their manifests |
//! | meaning of the rules' outputs | `src/technique.rs` |
//! | the choice between two engines for a zone | `src/engine_choice.rs`, `rules/engine-choice.fcl` |
//! | blending of neighboring zones | `src/compose.rs` |
//! | leases on parts of the preparation that agents share | `src/shared_work.rs` |
//! | agents in this process; over several machines | `src/driver.rs`, `src/driver/`; `src/driver/link.rs`, `src/driver/transport.rs`, `src/wire.rs`, `src/wire/` |
//! | simulation in virtual time; invariants checked after each run | `src/simulate/`; `src/simulate/invariants.rs`, `src/simulate/film.rs` |
//! | record of a simulated run | `src/simulate/recorder.rs` |
//! | predicting zone times from earlier works | `src/experience.rs`, `src/experience/`, `src/foreknowledge.rs`, `src/importance/outlook.rs`, `src/driver/learner.rs` |
//! | accuracy of predicted times | `src/prediction.rs` |
//! | progress of a job and its remaining time | `src/progress.rs`, `src/throughput.rs` |
//! | the journal for `--resume` | `src/journal.rs` |

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
mod foreknowledge;
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
    AGENTS_MAX, BenchmarkClocks, JobAgent, JobError, JobReport, JobSettings, JobTransport, JobUplink, Link,
    MachineSpeed, MasterHandle, Observer, PREFETCH_MAX, StopSwitch, TransportError, VERIFY_MAX, assist, lead, run,
};
pub use engine_choice::EngineChoice;
pub use experience::{Experience, ExperienceError, JobLesson, LearntFactor, PaintedZone, Subject};
pub use expert::{BAND_MAX, BandWidth, Expert};
pub use foreknowledge::{Foreknowledge, ZoneForecast};
pub use goals::GoalRules;
pub use ids::{WorkId, ZoneId};
pub use importance::{
    Channel, ChannelSet, ImportanceError, ImportanceFunction, ImportanceMap, OUTLOOK_COLUMNS, OUTLOOK_ROWS,
    PictureOutlook, TaskFeatures, TaskOutlook, UnknownChannel,
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
pub use zone_inputs::{ExpertError, check_inputs, check_output};
