//! The times and errors of all methods.

use bottega_farm::{Level, Optimization};
use bottega_image::Picture;

/// The parts that follow the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ways {
    /// None: everything as the farm does it.
    Ours,
    /// The expert rules only.
    PapersRules,
    /// All that `--as-in-paper` sets: importance, balance of zones, auction, adaptation and expert rules; one zone per agent
    /// at a time, none cut or taken over.
    Papers,
}

impl Ways {
    /// Returns the name used in JSON.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ours => "ours",
            Self::PapersRules => "papers-rules",
            Self::Papers => "papers",
        }
    }

    pub(super) fn named(name: &str) -> Option<Self> {
        [Self::Ours, Self::PapersRules, Self::Papers].into_iter().find(|ways| ways.name() == name)
    }
}

/// The times of one method, in seconds, by number of agents.
#[derive(Clone, Debug)]
pub(super) struct MagarroRow {
    pub(super) level: Level,
    pub(super) optimization: Optimization,
    pub(super) ways: Ways,
    /// Measured time of one agent with one thread.
    pub(super) measured: f64,
    /// Wall time of the survey within it.
    pub(super) survey: f64,
    /// Measured time of two agents in two processes of one thread each, if available.
    pub(super) pair: Option<f64>,
    /// The replayed time of that pair, with each processor as fast as next to a busy one and the second agent joining when the
    /// Master knew it.
    pub(super) replayed_pair: Option<f64>,
    /// Replayed times, by `AGENTS`.
    pub(super) replayed: [f64; 4],
    pub(super) zones: usize,
    pub(super) error: Option<PictureError>,
}

/// The difference of an image to the one without optimization.
#[derive(Clone, Copy, Debug)]
pub(super) struct PictureError {
    pub(super) rmse: f64,
    /// Mean absolute difference of the displayed images, in percent of white.
    pub(super) percent: f64,
    pub(super) flip: f64,
}

/// The times and errors of all methods, and two of the images.
#[derive(Clone, Debug)]
pub(super) struct MagarroReport {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) samples: u32,
    pub(super) light_samples: u32,
    pub(super) max_depth: u32,
    /// The speed of a processor while another one renders, relative to its speed alone.
    pub(super) speed_beside: f64,
    /// Without partition and optimization.
    pub(super) whole: MagarroRow,
    /// Level 3 without optimization.
    pub(super) off: MagarroRow,
    /// The difference between two seeds of that.
    pub(super) noise: PictureError,
    /// Optimization n, levels 1 to 3.
    pub(super) levels: Vec<MagarroRow>,
    /// Level 3, by `OPTIMIZATIONS`.
    pub(super) optimizations: Vec<MagarroRow>,
    /// Level 3, by `OPTIMIZATIONS`, with the paper's expert rules.
    pub(super) papers_rules: Vec<MagarroRow>,
    /// Optimization n, levels 1 to 3, everything as in the paper.
    pub(super) papers_levels: Vec<MagarroRow>,
    pub(super) pictures: Pictures,
}

#[derive(Clone, Debug)]
pub(super) struct Pictures {
    pub(super) off: Picture,
    pub(super) very_big: Picture,
}
