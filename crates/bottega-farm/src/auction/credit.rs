//! Credit: how far an agent's promises held.
//!
//! Source: MAGarRO, section 3.4, "Auctioning": what is added to an agent's credit is proportional to T_est − T.

use std::time::Duration;

/// What is remembered of the promises before, at each new one: some ten of them count.
const REMEMBERED: f64 = 0.9;
/// Estimates of zones are off by so much by themselves: who holds this share of its promises is believed.
const BELIEVED: f64 = 0.75;
/// Nobody is believed more than twice, or less than a sixteenth.
const RELIABILITY_RANGE: (f64, f64) = (1.0 / 16.0, 2.0);

/// An agent's success and failure with the zones that it painted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Credit {
    /// The paper's: the sum of T_est − T over its zones, in seconds of reference-machine time.
    pub sum: f64,
    /// What it promised lately, in seconds of its own; the older, the less it counts.
    pub promised: f64,
    /// What that took, likewise.
    pub taken: f64,
}

impl Credit {
    /// How far its promises held: 1 when what it promised took as long as it said, 0.5 when it took twice as long.
    pub fn reliability(&self) -> f64 {
        let held = self.promised / self.taken;
        if held.is_finite() { held.clamp(RELIABILITY_RANGE.0, RELIABILITY_RANGE.1) } else { 1.0 }
    }

    /// What its word is worth in an auction: 1, unless it is clearly less reliable than estimates are by themselves.
    pub fn worth(&self) -> f64 {
        let reliability = self.reliability();
        if reliability < BELIEVED { reliability } else { 1.0 }
    }

    /// What counts of it in the next work: how far promises held, as if that had been one of the promises there, and no sum.
    #[must_use]
    pub fn carried_over(&self) -> Self {
        Self { sum: 0.0, ..*self }
    }

    /// It has painted a zone. However much too long the estimate was, it earns at most what the zone is worth.
    ///
    /// - `estimated`: T_est, reference-machine time.
    /// - `own`: what the agent says that a second of the reference machine takes it.
    /// - `taken`: how long the zone took it, by the clock of whoever gave it.
    /// - `worth`: what others find that such a zone takes, reference-machine time; `None`: nobody knows, and nothing is earned beyond
    ///   what it took.
    pub fn learn(&mut self, estimated: Duration, own: f64, taken: Duration, worth: Option<Duration>) {
        let taken = taken.as_secs_f64();
        let measured = taken / own;
        let most = measured + worth.map_or(measured, |worth| worth.as_secs_f64());
        let estimated = estimated.as_secs_f64().min(most);
        let promised = estimated * own;
        if !(promised > 0.0 && measured.is_finite()) {
            return;
        }
        self.sum += estimated - measured;
        if self.taken == 0.0 {
            // Who is new is taken to have held its word twice: who paints two zones at a time is late with the first.
            (self.promised, self.taken) = (2.0 * promised, 2.0 * promised);
        }
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
