//! Pixel reconstruction filters, used by importance sampling: a sample is drawn with the filter's own density and
//! counts fully for its pixel, and for no other. So pixels are independent of each other, whoever paints them.
//!
//! Source: Ernst, Stamminger, Greiner 2006, *Filter Importance Sampling*.

use std::sync::LazyLock;

/// A separable, non-negative pixel filter. The radius is half its width, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// The pixel itself.
    Box,
    /// A tent of that radius.
    Tent {
        /// Where it reaches 0.
        radius: f32,
    },
    /// A Gaussian, cut off at `radius`.
    Gaussian {
        /// Where it is cut off.
        radius: f32,
        /// Standard deviation.
        sigma: f32,
    },
    /// The Blackman-Harris window, close to a Gaussian but 0 at its edge.
    BlackmanHarris {
        /// Where it reaches 0.
        radius: f32,
    },
}

impl Default for Filter {
    /// Blackman-Harris of radius 1.5.
    fn default() -> Self {
        Self::BlackmanHarris { radius: 1.5 }
    }
}

impl Filter {
    fn radius(self) -> f32 {
        match self {
            Self::Box => 0.5,
            Self::Tent { radius } | Self::Gaussian { radius, .. } | Self::BlackmanHarris { radius } => radius,
        }
    }

    /// The density at distance `x` from the center, not normalized.
    fn density(self, x: f64) -> f64 {
        let radius = f64::from(self.radius());
        match self {
            Self::Box => 1.0,
            Self::Tent { .. } => (1.0 - x.abs() / radius).max(0.0),
            Self::Gaussian { sigma, .. } => {
                let s = x / f64::from(sigma);
                exp_negative(0.5 * s * s)
            }
            Self::BlackmanHarris { .. } => {
                let c = cos(std::f64::consts::PI * x / radius);
                // cos 2a and cos 3a by Chebyshev's polynomials.
                0.35875 + 0.48829 * c + 0.14128 * (2.0 * c * c - 1.0) + 0.01168 * (4.0 * c * c * c - 3.0 * c)
            }
        }
    }
}

/// Number of intervals of a table of quantiles.
const INTERVALS: usize = 512;

/// The offset at probability i / INTERVALS, for a filter of radius 1. Between them the density counts as constant.
type Quantiles = [f32; INTERVALS + 1];

static TENT: LazyLock<Quantiles> = LazyLock::new(|| quantiles(Filter::Tent { radius: 1.0 }));
static BLACKMAN_HARRIS: LazyLock<Quantiles> = LazyLock::new(|| quantiles(Filter::BlackmanHarris { radius: 1.0 }));

/// Draws offsets from a pixel's center by the density of a filter.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    radius: f32,
    shape: Shape,
}

#[derive(Clone, Debug)]
enum Shape {
    Uniform,
    Shared(&'static Quantiles),
    Own(Box<Quantiles>),
}

impl FilterSampler {
    /// The sampler of a filter; cheap except for a Gaussian. Radii and sigmas that are not above 0 count as a box.
    pub fn new(filter: Filter) -> Self {
        let radius = filter.radius();
        let sound = radius > 0.0 && radius.is_finite();
        let shape = match filter {
            Filter::Tent { .. } if sound => Shape::Shared(&TENT),
            Filter::BlackmanHarris { .. } if sound => Shape::Shared(&BLACKMAN_HARRIS),
            Filter::Gaussian { sigma, .. } if sound && sigma > 0.0 => {
                Shape::Own(Box::new(quantiles(Filter::Gaussian { radius: 1.0, sigma: sigma / radius })))
            }
            _ => return Self { radius: 0.5, shape: Shape::Uniform },
        };
        Self { radius, shape }
    }

    /// The offset from the pixel's center, in pixels, from two uniform numbers in [0, 1).
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> [f32; 2] {
        let quantiles = match &self.shape {
            Shape::Uniform => return u.map(|u| u - 0.5),
            Shape::Shared(quantiles) => quantiles,
            Shape::Own(quantiles) => &**quantiles,
        };
        u.map(|u| {
            let scaled = u * INTERVALS as f32;
            let index = (scaled as usize).min(INTERVALS - 1);
            let (low, high) = (quantiles[index], quantiles[index + 1]);
            self.radius * (low + (scaled - index as f32) * (high - low))
        })
    }
}

/// Inverts the integral of the density of a filter of radius 1, summed on a fine grid by the trapezoidal rule.
fn quantiles(filter: Filter) -> Quantiles {
    const STEPS: usize = 8 * INTERVALS;
    let at = |step: usize| 2.0 * step as f64 / STEPS as f64 - 1.0;
    let mut integral = vec![0.0; STEPS + 1];
    for step in 0..STEPS {
        integral[step + 1] = integral[step] + 0.5 * (filter.density(at(step)) + filter.density(at(step + 1)));
    }
    let total = integral[STEPS];
    let mut step = 0;
    std::array::from_fn(|i| {
        let target = total * i as f64 / INTERVALS as f64;
        while step + 1 < STEPS && integral[step + 1] < target {
            step += 1;
        }
        let gain = integral[step + 1] - integral[step];
        let part = if gain > 0.0 { ((target - integral[step]) / gain).clamp(0.0, 1.0) } else { 0.0 };
        (at(step) + part * (at(step + 1) - at(step))) as f32
    })
}

/// e^−x for x ≥ 0. By sums and products only, so that tables have the same bits on every platform.
fn exp_negative(x: f64) -> f64 {
    let reduced = -x.min(700.0) / 1024.0;
    let series = (1..=16).rev().fold(1.0, |sum, n| 1.0 + sum * reduced / f64::from(n));
    (0..10).fold(series, |power, _| power * power)
}

/// The cosine for |x| ≤ π; see [`exp_negative`] for why it is not that of std.
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
    fn samples_follow_the_density_of_the_filter() {
        let filters = [
            Filter::Box,
            Filter::Tent { radius: 1.0 },
            Filter::Gaussian { radius: 1.5, sigma: 0.5 },
            Filter::BlackmanHarris { radius: 1.5 },
        ];
        for filter in filters {
            let sampler = FilterSampler::new(filter);
            let radius = filter.radius();
            let count = 100_000;
            let mut bins = [0.0; 20];
            for i in 0..count {
                let [x, y] = sampler.sample([(i as f32 + 0.5) / count as f32, 0.5]);
                assert!(x.abs() <= radius && y.abs() < 1e-3, "{filter:?}: {x} {y}");
                bins[(((x / radius + 1.0) * 10.0) as usize).min(19)] += 1.0 / f64::from(count);
            }
            let fine = |bin: usize| {
                (0..100)
                    .map(|i| {
                        filter.density(f64::from(radius) * ((bin as f64 + (f64::from(i) + 0.5) / 100.0) / 10.0 - 1.0))
                    })
                    .sum::<f64>()
            };
            let total: f64 = (0..20).map(fine).sum();
            for (bin, &share) in bins.iter().enumerate() {
                assert!(
                    (share - fine(bin) / total).abs() < 1.5e-3,
                    "{filter:?} bin {bin}: {share} {}",
                    fine(bin) / total
                );
            }
        }
    }

    #[test]
    fn a_filter_without_width_counts_as_a_box() {
        let sampler = FilterSampler::new(Filter::Tent { radius: 0.0 });
        assert!((sampler.sample([0.25, 0.75])[0] + 0.25).abs() < 1e-6);
        let sampler = FilterSampler::new(Filter::Gaussian { radius: f32::NAN, sigma: 0.5 });
        assert!(sampler.sample([0.999, 0.0])[0].is_finite());
    }
}
