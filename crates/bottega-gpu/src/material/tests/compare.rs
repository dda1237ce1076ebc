//! Comparison of numbers up to rounding.

/// The relative difference that is always allowed.
const TOLERANCE: f32 = 1e-4;
/// The relative change of an input that tests how strongly an answer depends on its last digits: a few units in the last place,
/// as many as the formulas lose.
pub(super) const NUDGE: f32 = 4e-7;

/// The result of comparing two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Match {
    /// Equal within [`TOLERANCE`].
    Close,
    /// As close as the precision of the inputs allows.
    Conditioned,
    Off,
}

/// Compares `a` and `b`; `nudged`: the result `a` for inputs changed by [`NUDGE`].
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

/// Counts of cases by their result.
#[derive(Debug, Default)]
pub(super) struct CaseTally {
    pub(super) all: usize,
    /// Close only in view of their condition.
    pub(super) conditioned: usize,
    pub(super) off: usize,
}

impl CaseTally {
    pub(super) fn count(&mut self, agrees: Match) {
        self.all += 1;
        self.conditioned += usize::from(agrees == Match::Conditioned);
        self.off += usize::from(agrees == Match::Off);
    }

    /// True if at most `share` of the cases differ (a random choice fell the other way), and fewer than a tenth, or than `share`
    /// if that is larger, are close only in view of their condition.
    pub(super) fn is_sound(&self, share: f32) -> bool {
        self.all > 0
            && self.off as f32 <= share * self.all as f32
            && (self.conditioned as f32) < share.max(0.1) * self.all as f32
    }
}

/// The default share of cases that may differ.
pub(super) const RARELY: f32 = 1e-3;
