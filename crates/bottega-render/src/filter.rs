//! Pixel reconstruction filters by importance sampling: a sample is drawn with the filter's density and counts fully for
//! its own pixel only, so pixels are independent of each other. Where a filter is negative, samples are drawn by its
//! absolute value and weighted with its sign.
//!
//! Source: Ernst, Stamminger, Greiner 2006, *Filter Importance Sampling*.

use std::sync::LazyLock;

pub use bottega_scene::FilmFilter as Filter;

fn radius(filter: Filter) -> f32 {
    match filter {
        Filter::Box { radius }
        | Filter::Tent { radius }
        | Filter::Gaussian { radius, .. }
        | Filter::Mitchell { radius, .. }
        | Filter::BlackmanHarris { radius } => radius,
    }
}

/// Returns the filter at distance `x` from the centre, not normalized.
fn value(filter: Filter, x: f64) -> f64 {
    let radius = f64::from(radius(filter));
    match filter {
        Filter::Box { .. } => 1.0,
        Filter::Tent { .. } => (1.0 - x.abs() / radius).max(0.0),
        Filter::Gaussian { sigma, .. } => {
            let bell = |x: f64| exp_negative(0.5 * (x / f64::from(sigma)) * (x / f64::from(sigma)));
            (bell(x) - bell(radius)).max(0.0)
        }
        Filter::Mitchell { b, c, .. } => {
            let (b, c, x) = (f64::from(b), f64::from(c), 2.0 * x.abs() / radius);
            if x < 1.0 {
                ((12.0 - 9.0 * b - 6.0 * c) * x + (-18.0 + 12.0 * b + 6.0 * c)) * x * x + (6.0 - 2.0 * b)
            } else {
                (((-b - 6.0 * c) * x + (6.0 * b + 30.0 * c)) * x + (-12.0 * b - 48.0 * c)) * x + (8.0 * b + 24.0 * c)
            }
        }
        Filter::BlackmanHarris { .. } => {
            let c = cos(std::f64::consts::PI * x / radius);
            // cos 2a and cos 3a by Chebyshev's polynomials
            0.35875 + 0.48829 * c + 0.14128 * (2.0 * c * c - 1.0) + 0.01168 * (4.0 * c * c * c - 3.0 * c)
        }
    }
}

/// Number of intervals of a filter's table of quantiles.
pub const INTERVALS: usize = 512;

/// Quantiles of the absolute value of a filter of radius 1: offsets at probabilities i / INTERVALS. The density between
/// them is constant.
#[derive(Clone, Debug)]
pub(crate) struct QuantileTable {
    pub(crate) quantiles: [f32; INTERVALS + 1],
    /// Integral of the absolute value over the integral; 1 for a filter that is nowhere negative.
    pub(crate) excess: f32,
    /// Offset beyond which the filter is negative; 1 or more: nowhere.
    pub(crate) sign_change: f32,
}

static TENT: LazyLock<QuantileTable> = LazyLock::new(|| table(Filter::Tent { radius: 1.0 }));
static BLACKMAN_HARRIS: LazyLock<QuantileTable> = LazyLock::new(|| table(Filter::BlackmanHarris { radius: 1.0 }));

/// A sampler of offsets from a pixel's centre, by the density of a filter.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    /// Radius in pixels.
    pub(crate) radius: f32,
    pub(crate) shape: FilterShape,
}

/// The density of a filter, for a radius of 1.
#[derive(Clone, Debug)]
pub(crate) enum FilterShape {
    /// The same everywhere.
    Uniform,
    /// A table for all filters of its kind.
    Shared(&'static QuantileTable),
    /// A table for the parameters of this filter.
    Own(Box<QuantileTable>),
}

impl FilterSampler {
    /// Creates the sampler of a filter; cheap except for Gaussian and Mitchell. A filter with an invalid radius or shape
    /// becomes a box of one pixel.
    pub fn new(filter: Filter) -> Self {
        let radius = radius(filter);
        let sound = radius > 0.0 && radius.is_finite();
        let shape = match filter {
            Filter::Box { .. } if sound => FilterShape::Uniform,
            Filter::Tent { .. } if sound => FilterShape::Shared(&TENT),
            Filter::BlackmanHarris { .. } if sound => FilterShape::Shared(&BLACKMAN_HARRIS),
            Filter::Gaussian { sigma, .. } if sound && sigma > 0.0 => {
                FilterShape::Own(Box::new(table(Filter::Gaussian { radius: 1.0, sigma: sigma / radius })))
            }
            Filter::Mitchell { b, c, .. } if sound && (0.0..=1.0).contains(&b) && (0.0..=1.0).contains(&c) => {
                FilterShape::Own(Box::new(table(Filter::Mitchell { radius: 1.0, b, c })))
            }
            _ => return Self { radius: 0.5, shape: FilterShape::Uniform },
        };
        Self { radius, shape }
    }

    /// Draws an offset from the pixel's centre. Returns it along x and y, in pixels, with the weight of the sample,
    /// which is negative where the filter is.
    ///
    /// - `u`: uniform random numbers in [0, 1).
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> ([f32; 2], f32) {
        let table = match &self.shape {
            FilterShape::Uniform => return (u.map(|u| self.radius * (2.0 * u - 1.0)), 1.0),
            FilterShape::Shared(table) => table,
            FilterShape::Own(table) => &**table,
        };
        let mut factor = 1.0;
        let offset = u.map(|u| {
            let scaled = u * INTERVALS as f32;
            let index = (scaled as usize).min(INTERVALS - 1);
            let (low, high) = (table.quantiles[index], table.quantiles[index + 1]);
            let x = low + (scaled - index as f32) * (high - low);
            factor *= if x.abs() < table.sign_change { table.excess } else { -table.excess };
            self.radius * x
        });
        (offset, factor)
    }
}

/// Inverts the integral of the absolute value of a filter of radius 1, summed on a fine grid by the trapezoidal rule.
fn table(filter: Filter) -> QuantileTable {
    const STEPS: usize = 8 * INTERVALS;
    let at = |step: usize| 2.0 * step as f64 / STEPS as f64 - 1.0;
    let mut integral = vec![0.0; STEPS + 1];
    let mut signed = 0.0;
    for step in 0..STEPS {
        let (low, high) = (value(filter, at(step)), value(filter, at(step + 1)));
        integral[step + 1] = integral[step] + 0.5 * (low.abs() + high.abs());
        signed += 0.5 * (low + high);
    }
    let total = integral[STEPS];
    let mut step = 0;
    let quantiles: [f32; INTERVALS + 1] = std::array::from_fn(|i| {
        let target = total * i as f64 / INTERVALS as f64;
        while step + 1 < STEPS && integral[step + 1] < target {
            step += 1;
        }
        let gain = integral[step + 1] - integral[step];
        let part = if gain > 0.0 { ((target - integral[step]) / gain).clamp(0.0, 1.0) } else { 0.0 };
        (at(step) + part * (at(step + 1) - at(step))) as f32
    });
    // Choose the sign change by the offsets as they are drawn, so that the mean weight of samples is exactly 1
    let turn = INTERVALS as f64 * (0.5 + 0.25 * (1.0 + signed / total));
    let sign_change = match quantiles.get(turn as usize..) {
        Some([low, high, ..]) => low + turn.fract() as f32 * (high - low),
        _ => f32::INFINITY,
    };
    QuantileTable { quantiles, excess: (total / signed) as f32, sign_change }
}

/// Returns e^−x for x ≥ 0. Uses sums and products only, so that tables have the same bits on every platform.
fn exp_negative(x: f64) -> f64 {
    let reduced = -x.min(700.0) / 1024.0;
    let series = (1..=16).rev().fold(1.0, |sum, n| 1.0 + sum * reduced / f64::from(n));
    (0..10).fold(series, |power, _| power * power)
}

/// Returns the cosine for |x| ≤ π, with the same bits on every platform like [`exp_negative`].
fn cos(x: f64) -> f64 {
    let square = x * x;
    (1..=14).rev().fold(1.0, |sum, n| 1.0 - sum * square / f64::from((2 * n) * (2 * n - 1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_agree_with_std() {
        for i in 0..=100 {
            let x = f64::from(i) * 0.0314;
            assert!((cos(x) - x.cos()).abs() < 1e-12);
            assert!((exp_negative(x * 5.0) - (-x * 5.0).exp()).abs() < 1e-12);
        }
    }

    #[test]
    fn samples_follow_the_filter() {
        let filters = [
            Filter::Box { radius: 0.5 },
            Filter::Box { radius: 1.25 },
            Filter::Tent { radius: 1.0 },
            Filter::Gaussian { radius: 1.5, sigma: 0.5 },
            Filter::Mitchell { radius: 2.0, b: 1.0 / 3.0, c: 1.0 / 3.0 },
            Filter::Mitchell { radius: 2.0, b: 0.0, c: 0.5 },
            Filter::BlackmanHarris { radius: 1.5 },
        ];
        for filter in filters {
            let sampler = FilterSampler::new(filter);
            let radius = radius(filter);
            let count = 100_000;
            // The other coordinate stays in the middle, where no filter is negative: divide by its factor
            let (_, middle) = sampler.sample([0.5, 0.5]);
            let mut bins = [0.0; 20];
            for i in 0..count {
                let ([x, y], factor) = sampler.sample([(i as f32 + 0.5) / count as f32, 0.5]);
                assert!(x.abs() <= radius && y.abs() < 1e-3, "{filter:?}: {x} {y}");
                let bin = (((x / radius + 1.0) * 10.0) as usize).min(19);
                bins[bin] += f64::from(factor / middle.sqrt()) / f64::from(count);
            }
            let fine = |bin: usize| {
                let x = |i: i32| f64::from(radius) * ((bin as f64 + (f64::from(i) + 0.5) / 100.0) / 10.0 - 1.0);
                (0..100).map(|i| value(filter, x(i))).sum::<f64>()
            };
            let total: f64 = (0..20).map(fine).sum();
            for (bin, &share) in bins.iter().enumerate() {
                let expected = fine(bin) / total;
                assert!((share - expected).abs() < 1.5e-3, "{filter:?} bin {bin}: {share} {expected}");
            }
        }
    }

    #[test]
    fn samples_count_one_on_the_mean() {
        for (b, c) in [(1.0 / 3.0, 1.0 / 3.0), (0.0, 0.5), (0.0, 1.0), (1.0, 0.0)] {
            let sampler = FilterSampler::new(Filter::Mitchell { radius: 2.0, b, c });
            let count = 100_000;
            let factor = |i: i32| f64::from(sampler.sample([(i as f32 + 0.5) / count as f32, 0.5]).1);
            let middle = f64::from(sampler.sample([0.5, 0.5]).1).sqrt();
            let mean = (0..count).map(factor).sum::<f64>() / f64::from(count) / middle;
            assert!((mean - 1.0).abs() < 1e-4, "{b} {c}: {mean}");
        }
    }

    #[test]
    fn a_filter_without_width_counts_as_a_pixel() {
        let sampler = FilterSampler::new(Filter::Tent { radius: 0.0 });
        assert!((sampler.sample([0.25, 0.75]).0[0] + 0.25).abs() < 1e-6);
        let sampler = FilterSampler::new(Filter::Gaussian { radius: f32::NAN, sigma: 0.5 });
        assert!(sampler.sample([0.999, 0.0]).0[0].is_finite());
    }
}
