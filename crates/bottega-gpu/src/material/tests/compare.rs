//! A comparison of numbers that are the same but for rounding.

/// Relative difference that is always allowed.
const TOLERANCE: f32 = 1e-4;
/// How far an input is moved, to see by how much the answer depends on its last places: some units in the last place, as
/// many as the formulas lose on the way.
pub(super) const NUDGE: f32 = 4e-7;

/// How two numbers compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Match {
    /// The same within [`TOLERANCE`].
    Close,
    /// As near as the last places of the inputs tell.
    Conditioned,
    Off,
}

/// Whether `b` is `a` but for rounding; `nudged`: what `a` becomes when its inputs are moved by [`NUDGE`].
pub(super) fn agree(a: &[f32], b: &[f32], nudged: impl FnOnce() -> Vec<Vec<f32>>) -> Match {
    let size = a.iter().fold(1e-6, |size: f32, x| size.max(x.abs()));
    let near =
        |slack: f32| a.iter().zip(b).all(|(x, y)| (x - y).abs() <= TOLERANCE * size + slack || (x - y).abs() < 1e-6);
    if near(0.0) {
        return Match::Close;
    }
    let spread = |other: &Vec<f32>| a.iter().zip(other).fold(0.0, |most: f32, (x, y)| most.max((x - y).abs()));
    if near(2.0 * nudged().iter().map(spread).fold(0.0, f32::max)) { Match::Conditioned } else { Match::Off }
}

/// How many of many cases agree.
#[derive(Debug, Default)]
pub(super) struct CaseTally {
    pub(super) all: usize,
    /// Close only in view of how much depends on the last places.
    pub(super) conditioned: usize,
    pub(super) off: usize,
}

impl CaseTally {
    pub(super) fn count(&mut self, agrees: Match) {
        self.all += 1;
        self.conditioned += usize::from(agrees == Match::Conditioned);
        self.off += usize::from(agrees == Match::Off);
    }

    /// Whether less than `share` is off (a choice between two ways fell the other way), and no more than one in ten, or that
    /// share, close only in view of its condition.
    pub(super) fn is_sound(&self, share: f32) -> bool {
        self.all > 0
            && self.off as f32 <= share * self.all as f32
            && (self.conditioned as f32) < share.max(0.1) * self.all as f32
    }
}

/// What may be off where nothing else is said.
pub(super) const RARELY: f32 = 1e-3;
