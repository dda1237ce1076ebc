//! Settings of the partition.

use std::str::FromStr;

use bottega_image::Rect;

/// The last level of the partition to carry out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Level {
    /// The whole frame is one zone.
    Whole,
    /// Level 1: recursive division by minimum size and maximum complexity.
    Divided,
    /// Level 2: neighboring zones of similar complexity are joined.
    Joined,
    /// Level 3: all zones have nearly the same expected time, or another [`Balance`].
    #[default]
    Balanced,
}

impl Level {
    /// All levels, 0 to 3.
    pub const ALL: [Self; 4] = [Self::Whole, Self::Divided, Self::Joined, Self::Balanced];
}

impl FromStr for Level {
    type Err = UnknownLevel;

    fn from_str(text: &str) -> Result<Self, UnknownLevel> {
        match text {
            "0" => Ok(Self::Whole),
            "1" => Ok(Self::Divided),
            "2" => Ok(Self::Joined),
            "3" => Ok(Self::Balanced),
            _ => Err(UnknownLevel { found: text.to_owned() }),
        }
    }
}

/// The error of parsing an unknown level of the partition.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown partition level `{found}`: use 0, 1, 2 or 3")]
pub struct UnknownLevel {
    /// The text that was given.
    pub found: String,
}

/// The quantity that level 3 makes equal. The paper asks for "nearly the same complexity/size ratio", in order "to
/// obtain tasks that all require roughly the same rendering time"; these are two different things.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Balance {
    /// The expected time. Zones are small where the picture is complex.
    #[default]
    Time,
    /// The complexity per pixel.
    Ratio,
}

/// The user's limits on zones: the parameters of the paper's levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZoneLimits {
    /// Minimum width and height of a zone, in pixels. Only a smaller frame has smaller zones.
    pub side_min: u32,
    /// Level 1 cuts zones with more than this share of the frame's complexity. `None`: one over the number of zones
    /// wanted.
    pub complexity_max: Option<f64>,
    /// Level 2 joins zones whose costs per pixel differ by at most this share of the greater one.
    pub similarity: f64,
    /// The quantity that level 3 makes equal.
    pub balance: Balance,
}

impl Default for ZoneLimits {
    fn default() -> Self {
        Self { side_min: 8, complexity_max: None, similarity: 0.15, balance: Balance::default() }
    }
}

/// The Analyst's target for the partition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartitionSettings {
    /// The last level to carry out.
    pub level: Level,
    /// Number of zones wanted. Level 3 makes that many; level 1 cuts zones above the frame's complexity divided by this
    /// number, unless limited otherwise.
    pub zone_count: u32,
    /// Minimum number of zones, however expensive each is: one per agent.
    pub zones_least: u32,
    /// Level 2 joins zones up to this multiple of the maximum complexity. (The paper sets no bound; without one a
    /// uniform scene becomes one zone.)
    pub joined_max: f64,
    /// The user's limits.
    pub limits: ZoneLimits,
}

impl PartitionSettings {
    /// Maximum number of zones.
    const ZONES_MAX: u32 = 1 << 20;

    /// Makes the target for this many agents: enough zones that no agent waits long at the end for another, but none so
    /// small that its messages cost more than its pixels.
    ///
    /// - `level`: the last level to carry out.
    /// - `frame`: the pixels to paint.
    pub fn for_agents(level: Level, agents: usize, frame: Rect) -> Self {
        const ZONES_PER_AGENT: u64 = 8;
        const ZONES_MIN: u64 = 16;
        const ZONES_MAX: u64 = 1 << 16;
        const PIXELS_PER_ZONE_MIN: u64 = 1024;
        let wanted = (agents as u64).saturating_mul(ZONES_PER_AGENT).clamp(ZONES_MIN, ZONES_MAX);
        let affordable = (frame.area() / PIXELS_PER_ZONE_MIN).max(1);
        let zone_count = wanted.min(affordable) as u32;
        let zones_least = (agents.max(1) as u64).min(zone_count.into()) as u32;
        Self { level, zone_count, zones_least, joined_max: 2.0, limits: ZoneLimits::default() }
    }

    /// Returns the settings with the user's limits.
    ///
    /// - `zones`: the number wanted; `None`: the least at which no zone exceeds the maximum complexity, or unchanged
    ///   if there is no maximum.
    #[must_use]
    pub fn within(self, zones: Option<u32>, limits: ZoneLimits) -> Self {
        let by_complexity = limits.complexity_max.map(|share| (1.0 / share).ceil() as u32);
        let zone_count = zones.or(by_complexity).unwrap_or(self.zone_count).clamp(1, Self::ZONES_MAX);
        Self { zone_count, limits, ..self }
    }

    /// Returns the settings with at most this many zones, whatever the limits are.
    #[must_use]
    pub(crate) fn at_most(self, zones: u32) -> Self {
        let complexity_max = self.limits.complexity_max.map(|share| share.max(1.0 / f64::from(zones.max(1))));
        Self { zone_count: self.zone_count.min(zones), limits: ZoneLimits { complexity_max, ..self.limits }, ..self }
    }

    /// Returns the complexity above which level 1 cuts a zone, given that of the frame.
    pub(super) fn complexity_max(&self, of_frame: f64) -> f64 {
        match self.limits.complexity_max {
            Some(share) => of_frame * share,
            None => of_frame / f64::from(self.zone_count.max(1)),
        }
    }
}
