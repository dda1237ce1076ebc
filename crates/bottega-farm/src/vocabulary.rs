//! The effects that the farm's agents request, and the completions that answer them.

use std::{ops::Range, sync::Arc, time::Duration};

use bottega_agents::{Action, AgentId, Event, Revision};
use bottega_engines::{EnginePreference, Survey, Tunables};
use bottega_image::Rect;

use crate::{
    AgentRow, ErrorUse, FarmContent, FarmValue, ImportanceMap, Mask, Partition, PictureOutlook, RelativePower,
    ResultRef, RoundSummary, Theft, WorkId, WorkRow, ZoneId, ZoneRow,
};

/// An order to paint a zone, or some of its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct PaintOrder {
    /// The id of the zone.
    pub zone: ZoneId,
    /// The fencing token of the order.
    pub fence: Revision,
    /// The pixels, including the band.
    pub rect: Rect,
    /// The range of samples of each pixel.
    pub samples: Range<u32>,
    /// The settings to paint with: the number of bounces and of light samples.
    pub tunables: Tunables,
    /// The preference for one of the engines, if there are several.
    pub preference: EnginePreference,
    /// The earlier samples, which `samples` continues. `None`: `samples` starts at 0.
    pub from: Option<ResultRef>,
    /// The use of the zone's estimated error.
    pub error_use: ErrorUse,
    /// The maximum number of samples per pixel, over this order and later ones.
    pub samples_max: u32,
    /// Expected processor time of the agent, if known: for progress displays and for cutting long work into passes.
    pub time_estimated: Option<Duration>,
}

/// Maximum time between two steps of an order's progress, in own time on all processors of its agent; but at least the
/// time of one sample in all pixels of the order. Longer orders are painted in passes.
pub const STEP_MAX: Duration = Duration::from_secs(10);

/// An effect that an agent of the farm requests from its driver.
#[derive(Clone, Debug)]
pub enum FarmEffect {
    /// Survey the scene; answered by [`FarmCompletion::Surveyed`].
    Survey {
        /// The whole picture.
        picture: Rect,
        /// Number of columns of cells.
        width: u32,
        /// Number of rows of cells.
        height: u32,
    },
    /// The result of the Analyst, for observers.
    Analyzed {
        /// The importance map.
        map: Arc<ImportanceMap>,
        /// The zones of the picture.
        partition: Arc<Partition>,
        /// The survey's predictions.
        outlook: Arc<PictureOutlook>,
    },
    /// Run the benchmark; answered by [`FarmCompletion::Benchmarked`].
    Benchmark,
    /// Fetch the scene from the Model Repository; answered by [`FarmCompletion::Fetched`].
    Fetch(WorkId),
    /// Paint the samples of this order; answered by [`FarmCompletion::Painted`], unless the order is cancelled or the
    /// job is stopped.
    Paint(PaintOrder),
    /// Cancel painting of this order; it is not answered.
    Drop {
        /// The id of the zone.
        zone: ZoneId,
        /// The fencing token of the order.
        fence: Revision,
    },
    /// Query the progress of orders; answered by [`FarmCompletion::Looked`].
    Look(Vec<(ZoneId, Revision)>),
    /// The Master has excluded this agent from the work, or the AMS has ended the agent.
    Dismissed {
        /// The reason, as text for the user.
        reason: String,
    },
    /// An agent is excluded from the work from now on; for observers.
    LeftOut {
        /// The name of the agent.
        agent: AgentId,
        /// The reason, as text for the user.
        reason: String,
    },
    /// Zones wait because there are fewer machines than are needed to compare paintings; for observers.
    TooFew {
        /// Number of machines present.
        present: usize,
        /// Number of machines needed.
        needed: usize,
    },
    /// A stall: zones waited and agents were free, but nothing was started for too long. The Master restarts from the
    /// Blackboard. For observers.
    Stalled {
        /// The time without progress.
        waited: Duration,
        /// Number of waiting zones.
        zones: usize,
        /// Number of free agents.
        free: usize,
    },
    /// Begin a new, empty film for this work; what was composed before is discarded.
    BeginFilm(Arc<WorkRow>),
    /// A zone's row has changed; for observers and the journal.
    ZoneChanged(Arc<ZoneRow>),
    /// An agent's row has changed, for example its credit or speed; for observers.
    AgentChanged(Arc<AgentRow>),
    /// A round of the auction has ended; for observers.
    RoundClosed(RoundSummary),
    /// An agent has taken zones from another; for observers.
    Stolen(Theft),
    /// Compare two paintings of a zone by their look; answered by [`FarmCompletion::Compared`].
    Compare {
        /// The id of the zone.
        zone: ZoneId,
        /// The two paintings.
        results: [ResultRef; 2],
    },
    /// Add a painted zone to the film; answered by [`FarmCompletion::Composed`].
    Compose {
        /// The id of the zone.
        zone: ZoneId,
        /// The samples of the zone, by reference.
        result: ResultRef,
        /// The weights of the zone's pixels.
        mask: Mask,
    },
    /// The work is finished: all zones are composed or given up.
    Finish {
        /// The zones that were given up.
        failed: Vec<ZoneId>,
    },
    /// The work has failed.
    Abandon {
        /// The reason, as text for the user.
        reason: String,
    },
}

/// The answer to an effect, or an event from outside the agents.
#[derive(Clone, Debug)]
pub enum FarmCompletion {
    /// The answer to [`FarmEffect::Survey`]: the survey; or the error, as text for the user.
    Surveyed(Result<Arc<Survey>, String>),
    /// The answer to [`FarmEffect::Benchmark`].
    Benchmarked {
        /// V_cp: the relative power of the agent; 1 is the reference machine, 0.5 is twice as fast.
        power: RelativePower,
        /// Number of processors that will work on the agent's zones at once.
        lanes: f64,
    },
    /// The answer to [`FarmEffect::Fetch`]: the scene of this work is here, and the preparation for all zones is done.
    Fetched(WorkId),
    /// The answer to [`FarmEffect::Paint`].
    Painted {
        /// The id of the zone.
        zone: ZoneId,
        /// The fencing token of the order.
        fence: Revision,
        /// The result; or the error, as text for the user.
        outcome: Result<PaintResult, String>,
    },
    /// The answer to [`FarmEffect::Look`].
    Looked(
        /// Progress of each known order: the number of painted samples, summed over its pixels.
        Vec<(ZoneId, Revision, u64)>,
    ),
    /// The answer to [`FarmEffect::Compare`].
    Compared {
        /// The id of the zone.
        zone: ZoneId,
        /// The two paintings.
        results: [ResultRef; 2],
        /// True if the paintings look alike; or the painting that could not be fetched.
        outcome: Result<bool, ResultRef>,
    },
    /// The answer to [`FarmEffect::Compose`].
    Composed {
        /// The id of the zone.
        zone: ZoneId,
        /// `Err`: the samples could not be used, with the reason as text for the user.
        outcome: Result<(), String>,
    },
    /// A request to paint again a zone that is done or given up. The Master ignores it if the zone is held or has other
    /// samples by then.
    Requeue {
        /// The id of the zone.
        zone: ZoneId,
        /// The fencing token of the samples to discard: newer samples are kept. `None`: the zone was given up.
        fence: Option<Revision>,
    },
    /// The user's request to stop: no more zones are given out.
    Stop,
}

/// The result of a paint order: the reference to the samples, their time and error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaintResult {
    /// The reference to the samples.
    pub result: ResultRef,
    /// Processor time of the painting.
    pub busy: Duration,
    /// `true`: `busy` is a measurement; nothing was loaded, compiled or started meanwhile.
    pub is_measured: bool,
    /// The zone's estimated relative error, if requested and known; where cells stop by their own errors, the greatest
    /// error estimated.
    pub error: Option<f64>,
    /// Share of the pixels that need more samples for the requested error, 0..=1; 1 without such a goal.
    pub unfinished: f64,
}

/// An event for an agent of the farm.
pub type FarmEvent = Event<FarmContent, FarmValue, FarmCompletion>;

/// An action requested by an agent of the farm.
pub type FarmAction = Action<FarmContent, FarmValue, FarmEffect>;
