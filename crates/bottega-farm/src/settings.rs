//! The settings of a picture, and the choice for a zone.

use std::{fmt, str::FromStr, time::Duration};

use bottega_engines::Tunables;
use bottega_image::{Rect, Sides};

/// Share of the final samples that profiling takes (MAGarRO, section 3.4: "around 5% of the final number of rays").
const PROFILE_SHARE: f64 = 0.05;

/// Side of a cell, in pixels: large enough for an error that is estimated from few samples, small enough to follow the scene.
pub(crate) const CELL_SIDE: u32 = 32;

/// The degree to which the rules may spend less than the user's settings: the paper's Optimization Level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Optimization {
    /// The user's settings exactly, everywhere: the picture is then the same, bit for bit, whoever painted it.
    #[default]
    Off,
    /// VS.
    VerySmall,
    /// S.
    Small,
    /// N.
    Normal,
    /// B.
    Big,
    /// VB.
    VeryBig,
}

impl Optimization {
    /// All levels, weakest first.
    pub const ALL: [Self; 6] = [Self::Off, Self::VerySmall, Self::Small, Self::Normal, Self::Big, Self::VeryBig];

    /// The level as the value of the rules' input `optimization_level`: 1 (very small) to 5 (very big). `None` when it is off.
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

/// No such level of optimization.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown optimization level `{found}`: use off, vs, s, n, b or vb")]
pub struct UnknownOptimization {
    /// What was asked for.
    pub found: String,
}

impl FromStr for Optimization {
    type Err = UnknownOptimization;

    fn from_str(text: &str) -> Result<Self, UnknownOptimization> {
        let found = Self::ALL.into_iter().find(|level| level.to_string() == text.to_ascii_lowercase());
        found.ok_or_else(|| UnknownOptimization { found: text.to_owned() })
    }
}

/// The use of a zone's error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ErrorUse {
    /// Nothing: it is not estimated.
    #[default]
    None,
    /// It says how much more a zone gets than others.
    Weighs,
    /// Whoever has this error, or less, stops.
    Stops(f64),
}

/// The goal of a zone: when it has enough samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Goal {
    /// When it has as many as were asked for.
    #[default]
    Samples,
    /// When the estimated relative error of each of its cells is at most this: the root of the mean over the pixels of squared
    /// error over squared value. A cell is 32 × 32 pixels of a grid that depends on nothing, and stops by its own pixels
    /// alone: so the picture is the same whoever paints it, where the engine is exact by pixel. Engines that cannot
    /// paint parts of a zone stop zone by zone.
    Error(f64),
    /// When so much time has passed since the work began. How good the picture is then depends on the machines.
    Time(Duration),
}

impl Goal {
    /// Samples of a zone's first look where nobody knows yet how many it will need.
    pub(crate) const FIRST_SAMPLES: u32 = 8;

    /// What a zone's error is needed for.
    pub fn error_use(&self) -> ErrorUse {
        match *self {
            Self::Samples => ErrorUse::None,
            Self::Error(wanted) => ErrorUse::Stops(wanted),
            Self::Time(_) => ErrorUse::Weighs,
        }
    }

    /// Zones and their pieces have edges at multiples of so many pixels, or at those of the frame.
    pub(crate) fn grid(&self) -> u32 {
        if matches!(self, Self::Error(_)) { CELL_SIDE } else { 1 }
    }
}

/// The settings of a work, as the user asked: the same for all its zones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkSettings {
    /// The whole picture, from (0, 0).
    pub picture: Rect,
    /// The pixels that are painted: the picture or its crop window.
    pub frame: Rect,
    /// Samples a pixel, at least 1; with a goal the most that a pixel gets.
    pub samples: u32,
    /// When a zone is finished.
    pub goal: Goal,
    /// Everything else that the rules may lower.
    pub tunables: Tunables,
    /// How far they may.
    pub optimization: Optimization,
}

/// What a zone is painted with. Decided once, by the agent that profiles the zone: its first samples are kept, and
/// samples of two settings may not be mixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Settings of the engine.
    pub tunables: Tunables,
    /// Samples a pixel.
    pub samples: u32,
    /// Widths of the interpolation bands beyond the zone's edges, in pixels; 0: none.
    pub bands: Sides<u32>,
}

impl Choice {
    /// The user's settings exactly.
    pub fn unchanged(settings: &WorkSettings) -> Self {
        Self { tunables: settings.tunables, samples: settings.samples, bands: Sides::all(0) }
    }

    /// How many of the samples profiling takes.
    pub fn profile_samples(&self, goal: &Goal) -> u32 {
        let wanted = match goal {
            Goal::Samples => (f64::from(self.samples) * PROFILE_SHARE).round() as u32,
            Goal::Error(_) => Goal::FIRST_SAMPLES,
            // The whole picture is there as early as can be: nobody knows how many more the time allows.
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
