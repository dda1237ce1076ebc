//! Credit: how well an agent's measured times match its promises.
//!
//! Source: MAGarRO, section 3.4, "Auctioning": what is added to an agent's credit is proportional to T_est − T.

use std::time::Duration;

/// Weight of earlier promises at each new one; about the last ten count.
const REMEMBERED: f64 = 0.9;
/// Lowest reliability at which promises are taken unchanged: estimates of zones are off by that much anyway.
const BELIEVED: f64 = 0.75;
/// Bounds of [`Credit::reliability`].
const RELIABILITY_RANGE: (f64, f64) = (1.0 / 16.0, 2.0);

/// An agent's record of promised and measured times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Credit {
    /// The paper's credit: the sum of T_est − T over the agent's zones in the present work, in seconds of
    /// reference-machine time.
    pub sum: f64,
    /// Promised times, in the agent's own seconds; a decaying sum in which older zones count less.
    pub promised: f64,
    /// Measured times of the same zones, in the agent's own seconds; a sum that decays in the same way.
    pub taken: f64,
}

impl Credit {
    /// Returns the ratio of promised to measured time: 1 if zones took as long as promised, 0.5 if twice as long. In
    /// 1/16..=2; 1 for an agent without zones.
    pub fn reliability(&self) -> f64 {
        let held = self.promised / self.taken;
        if held.is_finite() { held.clamp(RELIABILITY_RANGE.0, RELIABILITY_RANGE.1) } else { 1.0 }
    }

    /// Returns the factor on the agent's promises in an auction: 1, or the reliability where that is below the usual
    /// error of estimates.
    pub fn worth(&self) -> f64 {
        let reliability = self.reliability();
        if reliability < BELIEVED { reliability } else { 1.0 }
    }

    /// Returns the credit for the agent's next work: reliability is kept, [`Credit::sum`] starts at 0.
    #[must_use]
    pub fn carried_over(&self) -> Self {
        Self { sum: 0.0, ..*self }
    }

    /// Records a finished zone; ignores it if its estimate is zero.
    ///
    /// - `estimated`: T_est, in reference-machine time.
    /// - `own`: the agent's own seconds per second of the reference machine, as it reports them.
    /// - `taken`: the time from order to report, by the Master's clock.
    /// - `worth`: the time that measurements of other agents suggest for this zone, in reference-machine time. It
    ///   bounds the credit earned by an estimate that was too long; `None`: unknown, bounded by the measured time.
    pub fn learn(&mut self, estimated: Duration, own: f64, taken: Duration, worth: Option<Duration>) {
        let taken = taken.as_secs_f64();
        let measured = taken / own;
        // Bound the estimate
        let most = measured + worth.map_or(measured, |worth| worth.as_secs_f64());
        let estimated = estimated.as_secs_f64().min(most);
        let promised = estimated * own;
        if !(promised > 0.0 && measured.is_finite()) {
            return;
        }
        // Add T_est − T to the paper's credit
        self.sum += estimated - measured;
        if self.taken == 0.0 {
            // Start with two kept promises: an agent that paints two zones at a time reports the first one late.
            (self.promised, self.taken) = (2.0 * promised, 2.0 * promised);
        }
        // Add promised and measured time to the decaying sums
        self.promised = REMEMBERED * self.promised + promised;
        self.taken = REMEMBERED * self.taken + taken;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn who_needs_twice_as_long_is_believed_half_as_much_after_some_zones() {
        let mut credit = Credit::default();
        assert_eq!(credit.reliability(), 1.0);
        credit.learn(SECOND, 0.5, SECOND, Some(SECOND));
        assert!((0.6..0.8).contains(&credit.reliability()), "{credit:?}");
        assert_eq!(credit.sum, -1.0);
        for _ in 0..30 {
            credit.learn(SECOND, 0.5, SECOND, Some(SECOND));
        }
        assert!((credit.reliability() - 0.5).abs() < 0.02, "{credit:?}");
        assert_eq!(credit.worth(), credit.reliability());
        for _ in 0..30 {
            credit.learn(SECOND, 0.5, SECOND / 2, Some(SECOND));
        }
        assert!(credit.reliability() > 0.95 && credit.sum == -31.0, "{credit:?}");
        assert_eq!(credit.worth(), 1.0);
    }

    #[test]
    fn a_promise_earns_at_most_what_its_zone_is_worth() {
        let mut credit = Credit::default();
        // It was profiled while its agent read the scene: 134.8 s were expected of a third of a second.
        let (estimated, taken) = (Duration::from_secs_f64(134.8), Duration::from_millis(300));
        credit.learn(estimated, 1.0, taken, Some(Duration::from_millis(400)));
        assert!((credit.sum - 0.4).abs() < 1e-9, "{credit:?}");
        // One that breaks its word after that is found out as soon as any.
        for _ in 0..6 {
            credit.learn(SECOND, 1.0, 4 * SECOND, Some(SECOND));
        }
        assert!(credit.worth() < 0.5 && credit.sum < -17.0, "{credit:?}");
        let mut alone = Credit::default();
        alone.learn(estimated, 1.0, taken, None);
        assert!((alone.sum - 0.3).abs() < 1e-9, "{alone:?}");
    }

    #[test]
    fn nonsense_is_bounded() {
        let mut credit = Credit::default();
        for (own, taken) in [(f64::NAN, SECOND), (0.0, SECOND), (1e300, Duration::MAX), (1.0, Duration::ZERO)] {
            credit.learn(SECOND, own, taken, Some(SECOND));
            assert!(credit.sum.is_finite() && (1.0 / 16.0..=2.0).contains(&credit.reliability()), "{credit:?}");
        }
    }
}
