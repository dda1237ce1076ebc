//! The times and errors of all ways to paint.

use bottega_farm::{Level, Optimization};
use bottega_image::Picture;

/// What is as in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ways {
    /// As the farm does it.
    Ours,
    /// The set of expert rules, and nothing else.
    PapersRules,
    /// All that `--as-in-paper` stands for: importance, balance of zones, auction, adaptation and expert rules.
    Papers,
}

impl Ways {
    /// As it is called in JSON.
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

/// Times of one way to paint, in seconds, by number of agents.
#[derive(Clone, Debug)]
pub(super) struct MagarroRow {
    pub(super) level: Level,
    pub(super) optimization: Optimization,
    pub(super) ways: Ways,
    /// One agent, one thread.
    pub(super) measured: f64,
    /// Wall time of the look at the scene within it.
    pub(super) survey: f64,
    /// Two agents in two processes of one thread each, if that was measured.
    pub(super) pair: Option<f64>,
    /// Those two replayed, each as fast as a processor is beside another one, the second from when the Master knew it.
    pub(super) replayed_pair: Option<f64>,
    /// Replayed, by `AGENTS`.
    pub(super) replayed: [f64; 4],
    pub(super) zones: usize,
    pub(super) error: Option<PictureError>,
}

/// How a picture differs from the one without optimization.
#[derive(Clone, Copy, Debug)]
pub(super) struct PictureError {
    pub(super) rmse: f64,
    /// Mean absolute difference of what a display shows, in percent of white.
    pub(super) percent: f64,
    pub(super) flip: f64,
}

/// The times and errors of all ways to paint, and two of the pictures.
#[derive(Clone, Debug)]
pub(super) struct MagarroReport {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) samples: u32,
    pub(super) light_samples: u32,
    pub(super) max_depth: u32,
    /// How fast a processor is while another one paints; alone it is 1.
    pub(super) speed_beside: f64,
    /// No partition, no optimization.
    pub(super) whole: MagarroRow,
    /// Level 3 without optimization.
    pub(super) off: MagarroRow,
    /// Between two seeds of that.
    pub(super) noise: PictureError,
    /// Optimization n, levels 1 to 3.
    pub(super) levels: Vec<MagarroRow>,
    /// Level 3, by `OPTIMIZATIONS`.
    pub(super) optimizations: Vec<MagarroRow>,
    /// The same with the paper's set of expert rules.
    pub(super) papers_rules: Vec<MagarroRow>,
    /// Level 3, optimization n, all as in the paper.
    pub(super) paper: MagarroRow,
    pub(super) pictures: Pictures,
}

#[derive(Clone, Debug)]
pub(super) struct Pictures {
    pub(super) off: Picture,
    pub(super) very_big: Picture,
}
