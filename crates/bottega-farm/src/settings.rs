//! Settings of a picture, and the choice for a zone.

use std::{fmt, str::FromStr, time::Duration};

use bottega_engines::Tunables;
use bottega_image::{Rect, Sides};

/// Share of the final samples that profiling takes (MAGarRO, section 3.4: "around 5% of the final number of rays").
const PROFILE_SHARE: f64 = 0.05;

/// Side of a cell, in pixels: large enough to estimate an error from few samples, small enough to follow the scene.
pub(crate) const CELL_SIDE: u32 = 32;

/// The degree to which rules may lower the user's settings: the paper's Optimization Level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Optimization {
    /// The user's settings everywhere: the picture is bit-identical for any agents, if the engine is exact per pixel.
    #[default]
    Off,
    /// Level 1, very small (VS).
    VerySmall,
    /// Level 2, small (S).
    Small,
    /// Level 3, normal (N).
    Normal,
    /// Level 4, big (B).
    Big,
    /// Level 5, very big (VB).
    VeryBig,
}

impl Optimization {
    /// All levels, weakest first.
    pub const ALL: [Self; 6] = [Self::Off, Self::VerySmall, Self::Small, Self::Normal, Self::Big, Self::VeryBig];

    /// Returns the value of the rules' input `optimization_level`: 1 (very small) to 5 (very big). `None` if off.
    pub fn rule_input(self) -> Option<f64> {
        match self {
            Self::Off => None,
            Self::VerySmall => Some(1.0),
            Self::Small => Some(2.0),
            Self::Normal => Some(3.0),
            Self::Big => Some(4.0),
            Self::VeryBig => Some(5.0),
        }
    }
}

impl fmt::Display for Optimization {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Off => "off",
            Self::VerySmall => "vs",
            Self::Small => "s",
            Self::Normal => "n",
            Self::Big => "b",
            Self::VeryBig => "vb",
        })
    }
}

/// The error of parsing an unknown level of optimization.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown optimization level `{found}`: use off, vs, s, n, b or vb")]
pub struct UnknownOptimization {
    /// The text that was given.
    pub found: String,
}

impl FromStr for Optimization {
    type Err = UnknownOptimization;

    fn from_str(text: &str) -> Result<Self, UnknownOptimization> {
        let found = Self::ALL.into_iter().find(|level| level.to_string() == text.to_ascii_lowercase());
        found.ok_or_else(|| UnknownOptimization { found: text.to_owned() })
    }
}

/// The use that is made of the estimated error of a zone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ErrorUse {
    /// The error is not estimated.
    #[default]
    None,
    /// Zones with a larger error get more samples.
    Weighs,
    /// Cells with this relative error or less stop.
    Stops(f64),
}

/// The condition under which a zone has enough samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Goal {
    /// The zone has the number of samples requested.
    #[default]
    Samples,
    /// The estimated relative error of each cell of the zone is at most this: the root of the mean over the pixels of
    /// squared error over squared value. A cell is a square of 32 × 32 pixels of a fixed grid and stops by its own
    /// pixels alone, so the picture is the same for any agents, if the engine is exact per pixel. Engines that cannot
    /// paint parts of a zone stop zone by zone.
    Error(f64),
    /// This much time has passed since the work began. The quality depends on the machines.
    Time(Duration),
}

impl Goal {
    /// Number of first samples of a zone with a goal of error or time.
    pub(crate) const FIRST_SAMPLES: u32 = 8;

    /// Returns the use that zones with this goal make of their estimated error.
    pub fn error_use(&self) -> ErrorUse {
        match *self {
            Self::Samples => ErrorUse::None,
            Self::Error(wanted) => ErrorUse::Stops(wanted),
            Self::Time(_) => ErrorUse::Weighs,
        }
    }

    /// Returns the grid of edges, in pixels: zones and their pieces end at multiples of it, or at the frame's edges.
    pub(crate) fn grid(&self) -> u32 {
        if matches!(self, Self::Error(_)) { CELL_SIDE } else { 1 }
    }
}

/// The user's settings of a work: the same for all its zones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkSettings {
    /// The whole picture, from (0, 0).
    pub picture: Rect,
    /// The pixels to paint: the picture or its crop window.
    pub frame: Rect,
    /// Samples per pixel, at least 1; with a goal of error or time their maximum.
    pub samples: u32,
    /// The condition under which a zone is finished.
    pub goal: Goal,
    /// The settings of the engine that rules may lower, in addition to `samples`.
    pub tunables: Tunables,
    /// The degree to which rules may lower `samples` and `tunables`.
    pub optimization: Optimization,
}

/// The settings of one zone. Normally chosen by the agent that profiles it and then fixed: samples of different
/// settings must not be mixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The settings of the engine: the numbers of bounces and of light samples.
    pub tunables: Tunables,
    /// Samples per pixel.
    pub samples: u32,
    /// Widths of the interpolation bands beyond the zone's edges, in pixels; 0: none.
    pub bands: Sides<u32>,
}

impl Choice {
    /// Makes the choice that keeps the user's settings, without bands.
    pub fn unchanged(settings: &WorkSettings) -> Self {
        Self { tunables: settings.tunables, samples: settings.samples, bands: Sides::all(0) }
    }

    /// Returns the number of samples per pixel that profiling takes.
    pub fn profile_samples(&self, goal: &Goal) -> u32 {
        let wanted = match goal {
            Goal::Samples => (f64::from(self.samples) * PROFILE_SHARE).round() as u32,
            Goal::Error(_) => Goal::FIRST_SAMPLES,
            // The whole picture is done as early as possible: how many more goals the time allows is unknown.
            Goal::Time(_) => 1,
        };
        wanted.clamp(1, self.samples.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_written_as_they_are_read() {
        for level in Optimization::ALL {
            assert_eq!(level.to_string().parse(), Ok(level));
        }
        assert!("loud".parse::<Optimization>().is_err());
    }

    #[test]
    fn profiling_takes_a_twentieth_and_at_least_one_sample() {
        let tunables = Tunables { max_depth: 8, light_samples: 1 };
        let choice = |samples| Choice { tunables, samples, bands: Sides::all(0) };
        assert_eq!(choice(1).profile_samples(&Goal::Samples), 1);
        assert_eq!(choice(16).profile_samples(&Goal::Samples), 1);
        assert_eq!(choice(1000).profile_samples(&Goal::Samples), 50);
        assert_eq!(choice(1000).profile_samples(&Goal::Error(0.1)), 8);
        assert_eq!(choice(4).profile_samples(&Goal::Time(Duration::from_secs(1))), 1);
    }
}
