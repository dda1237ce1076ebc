//! The settings of a job, and its errors.

use std::{collections::BTreeMap, sync::Arc, thread};

use bottega_engines::Tunables;
use bottega_image::{Layout, Rect};

use super::benchmark::MachineSpeed;
use crate::{
    AdaptationRule, AuctionRule, BandWidth, Credit, EngineChoice, Experience, Expert, Goal, ImportanceFunction, Level,
    Optimization, Subject, WorkSettings, ZoneLimits,
};

/// Maximum number of agents of one job.
pub const AGENTS_MAX: usize = 1 << 10;
/// Maximum number of agents that must agree on a zone.
pub const VERIFY_MAX: u32 = 16;
/// Maximum number of zones that an agent works on at once.
pub const PREFETCH_MAX: u32 = 1 << 10;
/// The settings of a job: picture, quality, agents, and what was learned before.
#[derive(Clone, Debug)]
pub struct JobSettings {
    /// Width of the whole picture, in pixels.
    pub width: u32,
    /// Height of the whole picture, in pixels.
    pub height: u32,
    /// The pixels to render: the whole picture or a part of it.
    pub crop: Rect,
    /// Samples per pixel.
    pub samples: u32,
    /// The condition on which a zone is finished; unless it is a number of samples, `samples` is the most per pixel.
    pub goal: Goal,
    /// The other render settings, which rules may lower.
    pub tunables: Tunables,
    /// The values that the film holds, as the engine's tiles do.
    pub layout: Layout,
    /// The last level of the partition to carry out.
    pub level: Level,
    /// The approximate number of zones. `None`: determined by the number of agents and the limits.
    pub zones: Option<u32>,
    /// The limits on zones in the partition.
    pub zone_limits: ZoneLimits,
    /// The degree to which rules may lower `samples` and `tunables`.
    pub optimization: Optimization,
    /// The number of Render Agents of this process, at most [`AGENTS_MAX`].
    pub agents: usize,
    /// The width of the bands between zones.
    pub bands: BandWidth,
    /// The rule sets of the agents, at least one; used in turn if there are fewer than agents.
    pub experts: Vec<Expert>,
    /// The rules for the choice between two engines; `None`: no preference.
    pub engine_choice: Option<EngineChoice>,
    /// The number of processors that the engine uses.
    pub processors: usize,
    /// The importance function of the Analyst.
    pub importance: ImportanceFunction,
    /// The rule of the auctions.
    pub auction: AuctionRule,
    /// The rule by which agents learn their speed.
    pub adaptation: AdaptationRule,
    /// The credit of machines from earlier works: see [`MasterConfig::credits`](crate::MasterConfig::credits).
    pub credits: Arc<BTreeMap<String, Credit>>,
    /// The measured zone times of this machine from earlier works.
    pub experience: Arc<Experience>,
    /// The measured zone times of all machines of the farm together, in reference time.
    pub experience_of_farm: Arc<Experience>,
    /// The identifier of engine, integrator and other settings that affect zone times: experience is kept per technique.
    pub technique: Arc<str>,
    /// The identity of the picture, by which a later job with the same picture is recognized.
    pub subject: Subject,
    /// V_cp of this machine by its benchmark, and its load now.
    pub benchmark: MachineSpeed,
    /// The number of zones that an agent works on at once; at most [`PREFETCH_MAX`].
    pub prefetch: u32,
    /// `true`: near the end zones are cut, and idle agents take over late ones. Agents of one process never do: they
    /// share its processors.
    pub shares_tail: bool,
    /// The number of agents on different machines that must agree on a zone before it counts; 1: no comparison.
    pub verify: u32,
    /// `true`: agents of other platforms may take part, with other engines; then results are only compared approximately.
    pub strangers: bool,
}

impl JobSettings {
    /// Returns true if zones whose time is known well from earlier works need no profile: not by the paper's rules, and
    /// not where agents are compared, because a profile compares them early.
    pub(crate) fn trusts_forecasts(&self) -> bool {
        let is_paper = self.auction == AuctionRule::Paper || self.adaptation == AdaptationRule::Paper;
        !is_paper && self.verify <= 1 && !self.strangers
    }

    /// Returns the settings of a picture of `width` × `height` pixels and `samples` samples per pixel, with defaults
    /// for all others.
    ///
    /// - `tunables`: the other render settings, which rules may lower.
    /// - `layout`: the values that the film holds.
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
            experience_of_farm: Arc::default(),
            technique: "".into(),
            subject: Subject::default(),
            benchmark: MachineSpeed::REFERENCE,
            prefetch: 2,
            shares_tail: true,
            verify: 1,
            strangers: false,
        }
    }

    /// Validates the settings. Returns those that are shared with other machines.
    pub(super) fn work(&self) -> Result<WorkSettings, JobError> {
        let picture = Rect::of_size(self.width, self.height);
        if picture.is_empty() || self.crop.is_empty() || !picture.encloses(&self.crop) {
            return Err(JobError::Crop { crop: self.crop, width: self.width, height: self.height });
        }
        for (what, value, most) in [
            ("samples", self.samples as usize, 1 << 24),
            ("agents", self.agents, AGENTS_MAX),
            ("rule sets", self.experts.len(), usize::MAX),
            ("zones in hand", self.prefetch as usize, PREFETCH_MAX as usize),
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

/// The reason why a job gave no picture.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The crop window is empty or outside the picture.
    #[error("the crop window {crop} holds no pixels of a picture of {width} × {height}")]
    Crop {
        /// The crop window.
        crop: Rect,
        /// Width of the picture, in pixels.
        width: u32,
        /// Height of the picture, in pixels.
        height: u32,
    },
    /// A number is 0 or above its maximum.
    #[error("{value} {what} cannot be")]
    Count {
        /// The name of the setting, in the plural, for display.
        what: &'static str,
        /// The value that is out of range.
        value: usize,
    },
    /// The stored progress was painted with other settings: another size, crop, number of samples, goal, optimization,
    /// or other [`Tunables`].
    #[error("the stored progress has other settings")]
    OtherWork,
    /// The requested error is not a positive finite number, or the requested time is 0.
    #[error("the requested error or time must be greater than 0")]
    Goal,
    /// The scene could not be surveyed, analyzed or prepared, or an agent ended before the work.
    #[error("the job was given up: {reason}")]
    Abandoned {
        /// The cause, for display.
        reason: String,
    },
    /// [`JobSettings::verify`] is above 1, but there are no other machines with which to compare results.
    #[error("cannot compare the results of agents: {reason}")]
    Verify {
        /// The reason why results cannot be compared, for display.
        reason: &'static str,
    },
    /// The Master has excluded all agents of this process.
    #[error("its agents are excluded from the job: {reason}")]
    LeftOut {
        /// The Master's reason, for display.
        reason: String,
    },
    /// A thread could not be started.
    #[error("cannot start a thread")]
    Thread(#[from] std::io::Error),
}
