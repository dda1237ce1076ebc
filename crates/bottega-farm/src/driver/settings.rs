//! The settings of a job, and the reasons why it may give no picture.

use std::{collections::BTreeMap, sync::Arc, thread};

use bottega_engines::Tunables;
use bottega_image::{Layout, Rect};

use crate::{
    AdaptationRule, AuctionRule, BandWidth, Credit, EngineChoice, Experience, Expert, Goal, ImportanceFunction, Level,
    Optimization, RelativePower, WorkSettings, ZoneLimits,
};

/// Agents of one job at most.
pub const AGENTS_MAX: usize = 1 << 10;
/// Agents that must make the same of a zone, at most.
pub const VERIFY_MAX: u32 = 16;
/// The settings of a job: what is painted, and how.
#[derive(Clone, Debug)]
pub struct JobSettings {
    /// Width of the whole picture, in pixels.
    pub width: u32,
    /// Height of the whole picture, in pixels.
    pub height: u32,
    /// The pixels that are painted: the whole picture or a part of it.
    pub crop: Rect,
    /// Samples a pixel.
    pub samples: u32,
    /// When a zone is finished; with another goal than samples, those are the most that a pixel gets.
    pub goal: Goal,
    /// The other settings that rules may lower.
    pub tunables: Tunables,
    /// Which values the film holds: as the engine's tiles do.
    pub layout: Layout,
    /// How far the partition goes.
    pub level: Level,
    /// About how many zones it makes. `None`: as many as suit the agents and the limits.
    pub zones: Option<u32>,
    /// What zones must be like.
    pub zone_limits: ZoneLimits,
    /// How far the rules may go.
    pub optimization: Optimization,
    /// How many Render Agents.
    pub agents: usize,
    /// How wide the bands between zones are.
    pub bands: BandWidth,
    /// The knowledge of the agents; they take turns when there are fewer than agents.
    pub experts: Vec<Expert>,
    /// What they know of engines, where several paint.
    pub engine_choice: Option<EngineChoice>,
    /// Processors of the engine.
    pub processors: usize,
    /// What a place is worth.
    pub importance: ImportanceFunction,
    /// How an auction is decided.
    pub auction: AuctionRule,
    /// How agents learn their speed.
    pub adaptation: AdaptationRule,
    /// How far the promises of machines held in works before: see [`MasterConfig::credits`](crate::MasterConfig::credits).
    pub credits: Arc<BTreeMap<String, Credit>>,
    /// What this machine has learnt in works before of how long zones take it.
    pub experience: Arc<Experience>,
    /// Engine, integrator and whatever else decides how a path is followed: what is learnt is learnt of that.
    pub technique: Arc<str>,
    /// V_cp by the [benchmark](crate::benchmark).
    pub benchmark: RelativePower,
    /// Zones that an agent has in hand at most.
    pub prefetch: u32,
    /// Agents of different machines that must make the same of a zone before it counts; 1: whoever paints it is believed.
    pub verify: u32,
    /// Whether agents of other platforms may take part, with engines of their own: what they paint can only be compared by its
    /// look.
    pub strangers: bool,
}

impl JobSettings {
    /// A picture with the default of everything that has one.
    pub fn new(width: u32, height: u32, samples: u32, tunables: Tunables, layout: Layout) -> Self {
        Self {
            width,
            height,
            crop: Rect::of_size(width, height),
            samples,
            goal: Goal::Samples,
            tunables,
            layout,
            level: Level::default(),
            zones: None,
            zone_limits: ZoneLimits::default(),
            optimization: Optimization::Off,
            agents: 1,
            bands: BandWidth::default(),
            experts: vec![Expert::path_tracing()],
            engine_choice: None,
            processors: thread::available_parallelism().map_or(1, std::num::NonZero::get),
            importance: ImportanceFunction::default(),
            auction: AuctionRule::default(),
            adaptation: AdaptationRule::default(),
            credits: Arc::default(),
            experience: Arc::default(),
            technique: "".into(),
            benchmark: RelativePower::REFERENCE,
            prefetch: 2,
            verify: 1,
            strangers: false,
        }
    }

    pub(super) fn work(&self) -> Result<WorkSettings, JobError> {
        let picture = Rect::of_size(self.width, self.height);
        if picture.is_empty() || self.crop.is_empty() || !picture.encloses(&self.crop) {
            return Err(JobError::Crop { crop: self.crop, width: self.width, height: self.height });
        }
        for (what, value, most) in [
            ("samples", self.samples as usize, 1 << 24),
            ("agents", self.agents, AGENTS_MAX),
            ("rule sets", self.experts.len(), usize::MAX),
            ("zones in hand", self.prefetch as usize, 1 << 10),
            ("agents to compare", self.verify as usize, VERIFY_MAX as usize),
        ] {
            if value == 0 || value > most {
                return Err(JobError::Count { what, value });
            }
        }
        let is_sound = match self.goal {
            Goal::Samples => true,
            Goal::Error(error) => error.is_finite() && error > 0.0,
            Goal::Time(time) => !time.is_zero(),
        };
        if !is_sound {
            return Err(JobError::Goal);
        }
        let Self { samples, goal, tunables, optimization, .. } = *self;
        Ok(WorkSettings { picture, frame: self.crop, samples, goal, tunables, optimization })
    }
}

/// Why a job gave no picture.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// There is nothing to paint.
    #[error("the crop window {crop} holds no pixels of a picture of {width} × {height}")]
    Crop {
        /// The window.
        crop: Rect,
        /// Width of the picture.
        width: u32,
        /// Height of the picture.
        height: u32,
    },
    /// A number that makes no sense.
    #[error("{value} {what} cannot be")]
    Count {
        /// Of what.
        what: &'static str,
        /// How many.
        value: usize,
    },
    /// What was kept is of another picture.
    #[error("what was kept is of other settings than these")]
    OtherWork,
    /// A goal that cannot be reached.
    #[error("the error or time asked for must be greater than 0")]
    Goal,
    /// The scene could not be analyzed, or the zones make no sense.
    #[error("the job was given up: {reason}")]
    Abandoned {
        /// Why.
        reason: String,
    },
    /// What agents paint cannot be compared.
    #[error("what agents paint cannot be compared: {reason}")]
    Verify {
        /// Why.
        reason: &'static str,
    },
    /// The Master of the work wants nothing of this process any more.
    #[error("its agents are left out of the job: {reason}")]
    LeftOut {
        /// Why.
        reason: String,
    },
    /// The operating system gives no thread.
    #[error("cannot start a thread")]
    Thread(#[from] std::io::Error),
}
