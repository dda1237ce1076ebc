//! The cost model: learned costs of a primitive on a resource.

use std::time::Duration;

/// The cost of one primitive on one resource: time = fixed + per item · size, fitted to measurements.
///
/// The mean is exponentially weighted: the newest measurement has weight [`CostModel::WEIGHT`], older ones decay
/// geometrically. The fixed part comes from a least-squares line with a memory ten times as long, because it takes many
/// noisy measurements. While all sizes are similar the two parts cannot be separated: the fixed part stays as it was
/// (initially 0), and the rest is attributed to the items.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CostModel {
    units: u64,
    items: u64,
    mean_size: f64,
    mean_ns: f64,
    line: CostLine,
    fixed_ns: f64,
    /// Mean square of the relative prediction error.
    miss: f64,
}

/// Moments of size and time, for the least-squares line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct CostLine {
    count: f64,
    mean_size: f64,
    mean_ns: f64,
    variance_size: f64,
    covariance: f64,
}

impl CostLine {
    fn observe(&mut self, size: f64, ns: f64) {
        self.count += 1.0;
        let weight = (1.0 / self.count).max(0.1 * CostModel::WEIGHT);
        let (delta_size, delta_ns) = (size - self.mean_size, ns - self.mean_ns);
        self.mean_size += weight * delta_size;
        self.mean_ns += weight * delta_ns;
        self.variance_size = (1.0 - weight) * (self.variance_size + weight * delta_size * delta_size);
        self.covariance = (1.0 - weight) * (self.covariance + weight * delta_size * delta_ns);
    }

    /// Returns the part of the time that does not depend on the size, if sizes differ by at least a tenth.
    fn fixed_ns(&self) -> Option<f64> {
        let tell = self.mean_size > 0.0 && self.variance_size >= 0.01 * self.mean_size * self.mean_size;
        tell.then(|| {
            let per_item = (self.covariance / self.variance_size).clamp(0.0, self.mean_ns / self.mean_size);
            self.mean_ns - per_item * self.mean_size
        })
    }
}

impl CostModel {
    /// Weight of the newest measurement in the exponentially weighted mean, 0..1. The first ten measurements have equal
    /// weights.
    pub const WEIGHT: f64 = 0.1;

    /// Makes a model from an earlier run: number of units, mean items per unit, and the line.
    pub(crate) fn known(units: u64, items: u64, fixed_ns: f64, ns_per_item: f64, miss: f64) -> Self {
        let mean_size = if units > 0 { items as f64 / units as f64 } else { 0.0 };
        let mean_ns = fixed_ns + ns_per_item * mean_size;
        Self { units, items, mean_size, mean_ns, fixed_ns, miss, ..Self::default() }
    }

    /// Adds a measurement: one unit of `size` items took `busy`.
    pub fn observe(&mut self, size: u64, busy: Duration) {
        self.observe_many(1, size, busy);
    }

    /// Adds a measurement of `units` units handed over together, with `size` items in all, that took `busy`. The fixed part is
    /// then that of handing over.
    pub fn observe_many(&mut self, units: u64, size: u64, busy: Duration) {
        let ns = busy.as_nanos() as f64;
        // Use a plain average of the first measurements, so that the very first has no lasting effect
        let seen = self.units as f64;
        let weight = (1.0 / (seen + 1.0)).max(Self::WEIGHT);
        if self.units > 0 && ns > 0.0 {
            let (fixed, per_item) = self.parts();
            let miss = ((fixed + per_item * size as f64 - ns) / ns).clamp(-10.0, 10.0);
            self.miss += weight * (miss * miss - self.miss);
        }
        self.units = self.units.saturating_add(units.max(1));
        self.items = self.items.saturating_add(size);
        let delta_size = size as f64 - self.mean_size;
        let delta_ns = ns - self.mean_ns;
        self.mean_size += weight * delta_size;
        self.mean_ns += weight * delta_ns;
        self.line.observe(size as f64, ns);
        self.fixed_ns = self.line.fixed_ns().unwrap_or(self.fixed_ns);
    }

    /// Returns the number of units measured.
    pub fn units(&self) -> u64 {
        self.units
    }

    /// Returns the number of items measured.
    pub fn items(&self) -> u64 {
        self.items
    }

    /// Returns the nanoseconds per additional item; not negative.
    pub fn ns_per_item(&self) -> f64 {
        self.parts().1
    }

    /// Returns the nanoseconds per unit or packet before its first item; not negative.
    pub fn fixed_ns(&self) -> f64 {
        self.parts().0
    }

    /// Returns the expected time of a unit of `size` items; `None` without measurements.
    pub fn predict(&self, size: u64) -> Option<Duration> {
        self.predict_ns(size).map(|ns| Duration::from_nanos(ns as u64))
    }

    /// Returns the expected time in nanoseconds; `None` without measurements.
    pub(crate) fn predict_ns(&self, size: u64) -> Option<f64> {
        let (fixed, per_item) = self.parts();
        (self.units > 0).then_some(fixed + per_item * size as f64)
    }

    /// Returns the root mean square of the relative prediction error, 0.1 for 10 %; `None` before two units were
    /// measured.
    pub fn uncertainty(&self) -> Option<f64> {
        (self.units > 1).then(|| self.miss.sqrt())
    }

    /// Returns the fixed and per-item nanoseconds, both at least 0, of the line through the mean.
    fn parts(&self) -> (f64, f64) {
        if self.mean_size > 0.0 {
            let fixed = self.fixed_ns.clamp(0.0, self.mean_ns.max(0.0));
            (fixed, (self.mean_ns - fixed).max(0.0) / self.mean_size)
        } else {
            (self.mean_ns, 0.0)
        }
    }
}

/// Divides `total` items among resources with these costs so that all that get any finish at the same time: within 2 %
/// of each other, if an item takes less than that of the whole. Returns the number of items for each resource, in the
/// order of `costs`.
///
/// - `costs`: a resource whose cost is `None`, or has no measurements, gets no items; if all are like that, the items
///   are not divided, and all numbers are 0.
pub fn split_work(total: u64, costs: &[Option<CostModel>]) -> Vec<u64> {
    let line = |cost: &Option<CostModel>| cost.filter(|cost| cost.units() > 0).map(|cost| cost.parts());
    super::plan::split(total, &costs.iter().map(line).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_fixed_cost_is_distinguished_from_the_cost_per_item() {
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

    #[test]
    fn the_fixed_part_is_kept_while_all_sizes_are_alike() {
        let mut model = CostModel::default();
        for size in [1_u64, 2, 4, 8].into_iter().chain([16; 200]) {
            model.observe(size, Duration::from_nanos(5_000 + 100 * size));
        }
        assert!((model.fixed_ns() - 5_000.0).abs() < 500.0, "{model:?}");
    }

    #[test]
    fn the_uncertainty_is_how_far_predictions_are_off() {
        let (mut steady, mut noisy) = (CostModel::default(), CostModel::default());
        for unit in 0..200_u64 {
            steady.observe(10, Duration::from_micros(100));
            noisy.observe(10, Duration::from_micros(if unit % 2 == 0 { 80 } else { 120 }));
        }
        assert!(steady.uncertainty().is_some_and(|share| share < 1e-3), "{steady:?}");
        assert!(noisy.uncertainty().is_some_and(|share| (0.15..0.3).contains(&share)), "{noisy:?}");
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
