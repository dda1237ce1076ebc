//! The effects that the farm's agents can ask for, and the completions that answer them.

use std::{ops::Range, sync::Arc, time::Duration};

use bottega_agents::{Action, AgentId, Event, Revision};
use bottega_engines::{EnginePreference, Survey, Tunables};
use bottega_image::Rect;

use crate::{
    AgentRow, ErrorUse, FarmContent, FarmValue, ImportanceMap, Mask, Partition, RelativePower, ResultRef, RoundSummary,
    TaskOutlook, Theft, WorkId, WorkRow, ZoneId, ZoneRow,
};

/// A zone, or some of its samples, to paint.
#[derive(Clone, Debug, PartialEq)]
pub struct PaintOrder {
    /// Which zone.
    pub zone: ZoneId,
    /// The token of the award.
    pub fence: Revision,
    /// The pixels, band and all.
    pub rect: Rect,
    /// Which samples of each pixel.
    pub samples: Range<u32>,
    /// With which settings.
    pub tunables: Tunables,
    /// For which of several engines.
    pub leaning: EnginePreference,
    /// The samples before: `samples` goes on from them. `None`: it starts at 0.
    pub from: Option<ResultRef>,
    /// What the error that is left is needed for.
    pub error_use: ErrorUse,
    /// The most samples that a pixel may get, by this order and later ones.
    pub samples_max: u32,
    /// Own time that it will take, as far as known: for those who show progress or cut long work into passes.
    pub time_estimated: Option<Duration>,
}

/// An order takes no longer than this between two steps of its progress, in own time on all processors of its agent, or than
/// one sample of all its pixels, whichever is longer: longer ones are painted in passes.
pub const STEP_MAX: Duration = Duration::from_secs(10);

/// Something to be done in the world.
#[derive(Clone, Debug)]
pub enum FarmEffect {
    /// Take the fast look at the scene; ends with [`FarmCompletion::Surveyed`].
    Survey {
        /// The whole picture.
        picture: Rect,
        /// Columns of cells.
        width: u32,
        /// Rows of cells.
        height: u32,
    },
    /// The Analyst's result, for those who watch.
    Analyzed {
        /// The importance map.
        map: Arc<ImportanceMap>,
        /// The zones.
        partition: Arc<Partition>,
        /// What the survey says of each zone, by id.
        outlooks: Arc<[TaskOutlook]>,
    },
    /// Measure this machine; ends with [`FarmCompletion::Benchmarked`].
    Benchmark,
    /// Get the scene from the Model Repository; ends with [`FarmCompletion::Fetched`].
    Fetch(WorkId),
    /// Paint; ends with [`FarmCompletion::Painted`].
    Paint(PaintOrder),
    /// Stop painting this order: nobody wants it any more. Nothing is reported of it.
    Drop {
        /// Which zone.
        zone: ZoneId,
        /// The token of the order.
        fence: Revision,
    },
    /// Look how far orders are; ends with [`FarmCompletion::Looked`].
    Look(Vec<(ZoneId, Revision)>),
    /// The Master of this agent has left it out of the work.
    Dismissed {
        /// Why.
        reason: String,
    },
    /// An agent is left out of the work from now on: for those who watch.
    LeftOut {
        /// Who.
        agent: AgentId,
        /// Why.
        reason: String,
    },
    /// Zones wait for more machines than are there, to compare what these paint: for those who watch.
    TooFew {
        /// Machines that are there.
        present: usize,
        /// So many are needed.
        needed: usize,
    },
    /// Nothing was begun for long though zones waited and agents were free: the Master begins again from the Blackboard. For those who
    /// watch.
    Stalled {
        /// For how long.
        waited: Duration,
        /// Zones that wait.
        zones: usize,
        /// Agents that are free.
        free: usize,
    },
    /// Begin a new, empty film for this work: what was composed before is void.
    BeginFilm(Arc<WorkRow>),
    /// A zone's row has changed: for those who watch, and for the journal.
    ZoneChanged(Arc<ZoneRow>),
    /// What is known of an agent has changed, its credit or its speed, say: for those who watch.
    AgentChanged(Arc<AgentRow>),
    /// A round of the auction has ended, for those who watch.
    RoundClosed(RoundSummary),
    /// An agent has taken zones from another, for those who watch.
    Stolen(Theft),
    /// Look whether two paintings of a zone may be the same picture; ends with [`FarmCompletion::Compared`].
    Compare {
        /// Which zone.
        zone: ZoneId,
        /// Their samples.
        results: [ResultRef; 2],
    },
    /// Put a painted zone into the film; ends with [`FarmCompletion::Composed`].
    Compose {
        /// Which zone.
        zone: ZoneId,
        /// Its samples.
        result: ResultRef,
        /// With which weights.
        mask: Mask,
    },
    /// All zones are composed or given up.
    Finish {
        /// The zones given up.
        failed: Vec<ZoneId>,
    },
    /// The work cannot be done.
    Abandon {
        /// Why.
        reason: String,
    },
}

/// A completion or an event of the world.
#[derive(Clone, Debug)]
pub enum FarmCompletion {
    /// Of [`FarmEffect::Survey`].
    Surveyed(Result<Arc<Survey>, String>),
    /// Of [`FarmEffect::Benchmark`].
    Benchmarked {
        /// V_cp.
        power: RelativePower,
        /// Processors that will work on the agent's zones at once.
        lanes: f64,
    },
    /// Of [`FarmEffect::Fetch`].
    Fetched(WorkId),
    /// Of [`FarmEffect::Paint`].
    Painted {
        /// Which zone.
        zone: ZoneId,
        /// The token of the award.
        fence: Revision,
        /// What came of it.
        outcome: Result<PaintResult, String>,
    },
    /// Of [`FarmEffect::Look`].
    Looked(
        /// Of each order that is known: what of it is painted, in samples of single pixels.
        Vec<(ZoneId, Revision, u64)>,
    ),
    /// Of [`FarmEffect::Compare`].
    Compared {
        /// Which zone.
        zone: ZoneId,
        /// Their samples.
        results: [ResultRef; 2],
        /// Whether they look alike, or which of them cannot be had.
        outcome: Result<bool, ResultRef>,
    },
    /// Of [`FarmEffect::Compose`].
    Composed {
        /// Which zone.
        zone: ZoneId,
        /// Why the samples could not be used.
        outcome: Result<(), String>,
    },
    /// Somebody wants a zone painted again that is done or given up.
    Requeue {
        /// Which zone.
        zone: ZoneId,
        /// The token of the samples that are to go, so that no others do; `None`: it was given up.
        fence: Option<Revision>,
    },
    /// The user wants to stop: no more zones are given out.
    Stop,
}

/// A finished paint order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaintResult {
    /// Where the samples are.
    pub result: ResultRef,
    /// Processor time that they took.
    pub busy: Duration,
    /// Whether that is a measurement: nothing was loaded, compiled or started meanwhile.
    pub is_measured: bool,
    /// The zone's estimated relative error, where it was asked for and can be known; where cells stop by theirs, the greatest
    /// of those that were looked at.
    pub error: Option<f64>,
    /// Share of the pixels that are to have more samples, where the error says so; else 1.
    pub unfinished: f64,
}

/// An event of the farm.
pub type FarmEvent = Event<FarmContent, FarmValue, FarmCompletion>;

/// An action of the farm.
pub type FarmAction = Action<FarmContent, FarmValue, FarmEffect>;
