//! What a primitive costs on a resource, learnt from what was measured.

use std::time::Duration;

/// Cost of one primitive on one resource: time = fixed + per item · size, fitted to what was measured.
///
/// An exponentially weighted least-squares line: the newest unit weighs [`CostModel::WEIGHT`], older ones fade
/// geometrically. While all units seen had the same size the two parts cannot be told apart, and all of the time is
/// put down to the items.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CostModel {
    units: u64,
    items: u64,
    mean_size: f64,
    mean_ns: f64,
    variance_size: f64,
    covariance: f64,
}

impl CostModel {
    /// Weight of the newest measurement once the average has warmed up.
    pub const WEIGHT: f64 = 0.1;

    /// Takes in that `size` items took `busy`.
    pub fn observe(&mut self, size: u64, busy: Duration) {
        self.units += 1;
        self.items = self.items.saturating_add(size);
        // A plain average over the first units, so that the very first one does not linger.
        let weight = (1.0 / self.units as f64).max(Self::WEIGHT);
        let delta_size = size as f64 - self.mean_size;
        let delta_ns = busy.as_nanos() as f64 - self.mean_ns;
        self.mean_size += weight * delta_size;
        self.mean_ns += weight * delta_ns;
        self.variance_size = (1.0 - weight) * (self.variance_size + weight * delta_size * delta_size);
        self.covariance = (1.0 - weight) * (self.covariance + weight * delta_size * delta_ns);
    }

    /// Units seen.
    pub fn units(&self) -> u64 {
        self.units
    }

    /// Items seen.
    pub fn items(&self) -> u64 {
        self.items
    }

    /// Nanoseconds that one more item costs; never negative.
    pub fn ns_per_item(&self) -> f64 {
        self.line().1
    }

    /// Nanoseconds that a unit costs before its first item; never negative.
    pub fn fixed_ns(&self) -> f64 {
        self.line().0
    }

    /// Expected time of a unit; `None` before the first was seen.
    pub fn predict(&self, size: u64) -> Option<Duration> {
        let (fixed, per_item) = self.line();
        (self.units > 0).then(|| Duration::from_nanos((fixed + per_item * size as f64) as u64))
    }

    /// (fixed, per item) in nanoseconds, both at least 0, through the mean of what was seen.
    fn line(&self) -> (f64, f64) {
        let through_zero = if self.mean_size > 0.0 { self.mean_ns / self.mean_size } else { 0.0 };
        // Sizes that differ by less than a tenth say nothing about the slope.
        if self.variance_size < 0.01 * self.mean_size * self.mean_size || self.mean_size == 0.0 {
            return if self.mean_size > 0.0 { (0.0, through_zero) } else { (self.mean_ns, 0.0) };
        }
        let per_item = (self.covariance / self.variance_size).clamp(0.0, through_zero);
        (self.mean_ns - per_item * self.mean_size, per_item)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_fixed_cost_is_told_from_the_cost_per_item() {
        let mut model = CostModel::default();
        for size in [100_u64, 900, 300, 500, 700].into_iter().cycle().take(100) {
            model.observe(size, Duration::from_nanos(2_000 + 30 * size));
        }
        assert!((model.ns_per_item() - 30.0).abs() < 0.01, "{model:?}");
        assert!((model.fixed_ns() - 2_000.0).abs() < 10.0, "{model:?}");
        assert_eq!(model.units(), 100);
    }

    #[test]
    fn a_change_of_speed_is_learnt_within_some_fifty_units() {
        let mut model = CostModel::default();
        for unit in 0..150 {
            let ns_per_item = if unit < 100 { 10 } else { 40 };
            model.observe(1_000, Duration::from_nanos(1_000 * ns_per_item));
        }
        assert!((model.ns_per_item() - 40.0).abs() < 1.0, "{model:?}");
    }

    proptest! {
        #[test]
        fn costs_are_finite_and_never_negative(
            seen in prop::collection::vec((0_u64..1 << 40, 0_u64..1 << 40), 1..60),
            size in 0_u64..1 << 40,
        ) {
            let mut model = CostModel::default();
            for (size, ns) in seen {
                model.observe(size, Duration::from_nanos(ns));
            }
            prop_assert!(model.ns_per_item() >= 0.0 && model.ns_per_item().is_finite());
            prop_assert!(model.fixed_ns() >= -1e-3 * model.mean_ns && model.fixed_ns().is_finite());
            prop_assert!(model.predict(size).is_some());
        }
    }
}
