//! Settings of the partition.

use std::str::FromStr;

use bottega_image::Rect;

/// The level to which the partition is carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Level {
    /// No partition: the whole frame is one zone.
    Whole,
    /// Recursive division by minimum size and maximum complexity (the paper's first level).
    Divided,
    /// Neighbouring zones of similar complexity joined (the second level).
    Joined,
    /// All zones of nearly the same expected time (the third level).
    #[default]
    Balanced,
}

impl Level {
    /// All levels, from 0 to 3.
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

/// No such level of partition.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown partition level `{found}`: use 0, 1, 2 or 3")]
pub struct UnknownLevel {
    /// What was asked for.
    pub found: String,
}

/// What zones have in common after the third level. The paper asks for "nearly the same complexity/size ratio", in order
/// "to obtain tasks that all require roughly the same rendering time"; these are two things.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Balance {
    /// The expected time. Zones are small where the picture is complex.
    #[default]
    Time,
    /// The complexity a pixel. Each zone holds as much of what is complex, for its size, as every other.
    Ratio,
}

/// The limits of zones that the user may set: the parameters of the paper's levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZoneLimits {
    /// The least width and height of a zone, in pixels. Only a frame that is itself smaller has smaller zones.
    pub side_min: u32,
    /// Level 1 cuts what is more complex than this share of the frame's complexity. `None`: one part in as many as
    /// zones are wanted.
    pub complexity_max: Option<f64>,
    /// Level 2 joins zones whose costs a pixel differ by at most this share of the greater one.
    pub similarity: f64,
    /// What level 3 makes equal.
    pub balance: Balance,
}

impl Default for ZoneLimits {
    fn default() -> Self {
        Self { side_min: 8, complexity_max: None, similarity: 0.15, balance: Balance::default() }
    }
}

/// The aims of the Analyst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartitionSettings {
    /// How far to go.
    pub level: Level,
    /// How many zones are wanted. The third level makes so many; where no limit says otherwise, the first cuts down
    /// to the frame's complexity divided by it.
    pub zone_count: u32,
    /// So many zones are wanted at least, however dear they are: one for each agent.
    pub zones_least: u32,
    /// Level 2 joins nothing to more than this multiple of the maximum complexity. (The paper names no bound; without
    /// one an even scene becomes one zone.)
    pub joined_max: f64,
    /// What the user says of zones.
    pub limits: ZoneLimits,
}

impl PartitionSettings {
    /// Zones at most.
    const ZONES_MAX: u32 = 1 << 20;

    /// Enough zones for so many agents that none waits at the end for another, but none so small that its messages
    /// cost more than its pixels.
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

    /// The same within limits.
    ///
    /// - `zones`: how many are wanted; `None`: so many that none of them has to exceed the maximum complexity, or, where there is
    ///   no such limit, as before.
    #[must_use]
    pub fn within(self, zones: Option<u32>, limits: ZoneLimits) -> Self {
        let by_complexity = limits.complexity_max.map(|share| (1.0 / share).ceil() as u32);
        let zone_count = zones.or(by_complexity).unwrap_or(self.zone_count).clamp(1, Self::ZONES_MAX);
        Self { zone_count, limits, ..self }
    }

    /// The same with so many zones at most, whatever the limits say.
    #[must_use]
    pub(crate) fn at_most(self, zones: u32) -> Self {
        let complexity_max = self.limits.complexity_max.map(|share| share.max(1.0 / f64::from(zones.max(1))));
        Self { zone_count: self.zone_count.min(zones), limits: ZoneLimits { complexity_max, ..self.limits }, ..self }
    }

    /// The complexity of a zone above which the first level cuts it, of a frame's.
    pub(super) fn complexity_max(&self, of_frame: f64) -> f64 {
        match self.limits.complexity_max {
            Some(share) => of_frame * share,
            None => of_frame / f64::from(self.zone_count.max(1)),
        }
    }
}
