//! The capacity of the bin, by Little's law: the number of units done per second times their waiting time in seconds.
//!
//! If a resource has no work because the bin is full of other resources' work, the capacity grows: the paper's
//! marginalisation. It shrinks slowly when that is over.
//!
//! If units have shorter maximum delays, the capacity is smaller, so that the last unit is begun within half of the
//! shortest recent maximum delay, whatever the order.

use std::time::Duration;

use super::time::Time;
use crate::HraConfig;

/// Minimum maximum delay that affects the capacity; shorter ones only mark a unit as urgent.
const DELAY_MIN: Duration = Duration::from_millis(1);
/// Minimum interval for measuring the rate.
const INTERVAL_MIN: Duration = Duration::from_millis(10);
/// Factor by which the capacity grows when a resource finds none of its work, and shrinks per interval.
const GROWTH: f64 = 1.5;
const SHRINKAGE: f64 = 0.995;
/// Weight of the newest interval in the rate.
const WEIGHT: f64 = 0.3;

/// The capacity of the bin: units wait for about [`HraConfig::bin_delay`], within bounds.
#[derive(Clone, Debug)]
pub(crate) struct BinLength {
    max: usize,
    min: usize,
    delay: Duration,
    /// Shortest recent maximum delay.
    tightest: Duration,
    /// Minimum capacity, however short the delays are: enough for each resource to have one unit in progress and one
    /// waiting.
    least: f64,
    /// Factor on the capacity by Little's law; at least 1.
    stretch: f64,
    /// Units per second; `None`: unknown.
    rate: Option<f64>,
    since: Time,
    count: u64,
    /// True if there was always something to do in the current interval.
    busy: bool,
}

impl BinLength {
    /// Capacity before the rate is known, within bounds.
    const AT_FIRST: usize = 1024;

    pub(crate) fn new(config: &HraConfig, resources: usize) -> Self {
        let max = config.bin_capacity.max(1);
        let min = config.bin_min.clamp(1, max);
        Self {
            max,
            min,
            delay: config.bin_delay,
            tightest: Duration::MAX,
            least: 2.0 * resources as f64,
            stretch: 1.0,
            rate: None,
            since: Time::ZERO,
            count: 0,
            busy: false,
        }
    }

    /// Returns the current capacity.
    pub(crate) fn capacity(&self) -> usize {
        let wanted = self.rate.map_or(Self::AT_FIRST, |rate| (rate * self.delay.as_secs_f64()) as usize);
        let stretched = self.stretch * wanted.clamp(self.min, self.max) as f64;
        let in_time = self.rate.map_or(f64::INFINITY, |rate| 0.5 * rate * self.tightest.as_secs_f64());
        (stretched.min(in_time.max(self.least).max(1.0)) as usize).min(self.max)
    }

    /// Takes in the maximum delay of a submitted unit.
    pub(crate) fn may_wait(&mut self, max_delay: Duration) {
        self.tightest = self.tightest.min(max_delay.max(DELAY_MIN));
    }

    /// Notes that a resource found none of its work in the bin, though there is some outside. Returns true if the bin
    /// grows.
    pub(crate) fn starved(&mut self) -> bool {
        let (before, stretch) = (self.capacity(), self.stretch);
        while self.capacity() == before && self.stretch < 1e6 * stretch {
            self.stretch *= GROWTH;
        }
        let grows = self.capacity() > before;
        if !grows {
            self.stretch = stretch;
        }
        grows
    }

    /// Returns the expected waiting time behind `units` others; zero before the rate is known.
    pub(crate) fn wait_behind(&self, units: usize) -> Duration {
        let seconds = self.rate.filter(|&rate| rate > 0.0).map_or(0.0, |rate| units as f64 / rate);
        Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
    }

    /// Notes that `units` were taken, with `waiting` left.
    pub(crate) fn taken(&mut self, now: Time, units: usize, waiting: usize) {
        self.count += units as u64;
        let elapsed = now.since(self.since);
        if elapsed >= INTERVAL_MIN && self.count >= 4 {
            let rate = self.count as f64 / elapsed.as_secs_f64();
            self.stretch = (self.stretch * SHRINKAGE).max(1.0);
            self.tightest =
                Duration::try_from_secs_f64(self.tightest.as_secs_f64() / SHRINKAGE).unwrap_or(Duration::MAX);
            // An interval in which resources were idle shows less than they can do
            let counts = self.busy || self.rate.is_none_or(|known| rate > known);
            if counts {
                self.rate = Some(self.rate.map_or(rate, |known| known + WEIGHT * (rate - known)));
            }
            (self.since, self.count, self.busy) = (now, 0, true);
        }
        self.busy &= waiting > 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> HraConfig {
        HraConfig { bin_capacity: 5_000, bin_min: 10, bin_delay: Duration::from_millis(100), ..HraConfig::default() }
    }

    fn after(units_a_second: u64, seconds: u64) -> BinLength {
        let mut length = BinLength::new(&config(), 1);
        for unit in 1..=units_a_second * seconds {
            length.taken(Time::from_nanos(unit * 1_000_000_000 / units_a_second), 1, 5);
        }
        length
    }

    #[test]
    fn short_delays_shorten_it_for_a_while_and_urgent_units_do_not_close_it() {
        let mut length = after(2_000, 2);
        length.may_wait(Duration::from_millis(50));
        assert_eq!(length.capacity(), 50);
        length.may_wait(Duration::ZERO);
        assert!((1..=2).contains(&length.capacity()), "{length:?}");
        for unit in 1..=40_000 {
            length.taken(Time::at(Duration::from_secs(2)).after(Duration::from_micros(500 * unit)), 1, 5);
        }
        assert!(length.capacity() > 150, "{length:?}");
    }

    #[test]
    fn what_waits_is_the_rate_times_the_delay_within_bounds() {
        assert_eq!(BinLength::new(&config(), 1).capacity(), 1024);
        assert!(after(2_000, 2).capacity().abs_diff(200) <= 2);
        assert_eq!(after(20, 10).capacity(), 10);
        assert_eq!(after(200_000, 1).capacity(), 5_000);
        let wait = after(2_000, 2).wait_behind(100);
        assert!(wait.abs_diff(Duration::from_millis(50)) < Duration::from_millis(1), "{wait:?}");
    }
}
