//! The times at which a stage is read.

use openusd::usd::{Stage, TimeCode};

use crate::options::LoadOptions;

/// Least number of steps per second, and most steps in all, while the shutter is open.
const STEPS: (f64, f64) = (60.0, 16.0);

/// The times at which a stage is read, as time codes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StageTimes {
    /// The time of the picture, or when its shutter opens.
    pub(super) first: f64,
    /// Later times, up to when the shutter is closed; empty: it is open for no time.
    pub(super) later: Vec<f64>,
    /// Time codes per second.
    pub(super) rate: f64,
}

impl StageTimes {
    /// Returns the times that the options select. Without a time, the earliest sample counts.
    pub(super) fn new(stage: &Stage, options: &LoadOptions) -> Self {
        let rate = stage.time_codes_per_second();
        let rate = if rate.is_finite() && rate > 0.0 { rate } else { 24.0 };
        let Some(shutter) = options.open_shutter().filter(crate::motion::Shutter::is_sound) else {
            let first = options.at.map_or(TimeCode::EARLIEST.value(), |seconds| f64::from(seconds) * rate);
            return Self { first, later: Vec::new(), rate };
        };
        let span = shutter.close - shutter.open;
        let steps = if shutter.is_instant() { 0 } else { (span * STEPS.0).ceil().clamp(1.0, STEPS.1) as u32 };
        let time = |step: u32| (shutter.open + span * f64::from(step) / f64::from(steps)) * rate;
        Self { first: shutter.open * rate, later: (1..=steps).map(time).collect(), rate }
    }

    /// Returns a time code in seconds.
    pub(super) fn seconds(&self, code: f64) -> f64 {
        code / self.rate
    }
}
