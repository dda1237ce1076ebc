//! Statistical tests of whether two noisy pictures have the same expectation.

use crate::{Film, Layout, picture::luminance};

/// Mean and variance of the samples of one value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Mean of the samples.
    pub mean: f64,
    /// Variance of one sample.
    pub variance: f64,
    /// Number of samples.
    pub samples: f64,
}

impl Moments {
    /// Returns the moments of the luminance of every pixel of a film, row by row. A pixel with fewer than two samples
    /// has infinite variance, so it is never rejected.
    pub fn of_film(film: &Film) -> Vec<Self> {
        film.rect()
            .pixels()
            .map(|(x, y)| {
                let [r, g, b, _] = film.color(x, y);
                let samples = f64::from(film.pixel(x, y)[Layout::SAMPLE_COUNT]);
                let variance = f64::from(film.variance_of_mean(x, y)) * samples;
                let known = samples >= 2.0;
                Self {
                    mean: f64::from(luminance([r, g, b])),
                    variance: if known { variance } else { f64::INFINITY },
                    samples: samples.max(1.0),
                }
            })
            .collect()
    }

    fn variance_of_mean(&self) -> f64 {
        self.variance / self.samples
    }
}

/// Returns the share of values that differ significantly; 0 without values. A two-sided z-test on each, with the Šidák
/// correction for n tests, α₁ = 1 − (1 − α)^(1/n). Mitsuba's tests accept a share of 0.0025 at α = 0.01.
///
/// - `significance`: α, in (0, 1).
///
/// The standard error is at least 10⁻⁶, so values without noise may differ by rounding. Panics if the lengths differ.
pub fn rejected_share(a: &[Moments], b: &[Moments], significance: f64) -> f64 {
    assert_eq!(a.len(), b.len(), "pictures of different sizes");
    if a.is_empty() {
        return 0.0;
    }
    // Compute 1 − (1 − α)^(1/n) without cancellation.
    let significance_of_one = -((-significance).ln_1p() / a.len() as f64).exp_m1();
    let differs = |(a, b): &(&Moments, &Moments)| {
        let standard_error = (a.variance_of_mean() + b.variance_of_mean()).sqrt().max(1e-6);
        // NaN is always rejected.
        let accepted = two_sided_p((a.mean - b.mean) / standard_error) >= significance_of_one;
        !accepted
    };
    a.iter().zip(b).filter(differs).count() as f64 / a.len() as f64
}

/// Computes [`rejected_share`] of the luminance of two films. Panics if their numbers of pixels differ.
pub fn rejected_share_of_films(a: &Film, b: &Film, significance: f64) -> f64 {
    rejected_share(&Moments::of_film(a), &Moments::of_film(b), significance)
}

/// Returns the difference of the means of two whole pictures in standard errors: it detects one percent of lost energy,
/// which tests of single pixels cannot. Values of unknown variance are left out. Panics if the lengths differ.
pub fn mean_z_score(a: &[Moments], b: &[Moments]) -> f64 {
    assert_eq!(a.len(), b.len(), "pictures of different sizes");
    let (mut difference, mut variance) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let of_both = a.variance_of_mean() + b.variance_of_mean();
        if of_both < f64::INFINITY {
            difference += a.mean - b.mean;
            variance += of_both;
        }
    }
    difference / variance.sqrt().max(1e-9 * a.len().max(1) as f64)
}

/// Returns the probability that a standard normal value is at least as far from 0 as `z`: erfc(|z| / √2).
pub(super) fn two_sided_p(z: f64) -> f64 {
    erfc_of_positive(z.abs() / std::f64::consts::SQRT_2)
}

/// Returns the complementary error function of x ≥ 0, with relative error below 10⁻¹⁰, also where it is tiny.
fn erfc_of_positive(x: f64) -> f64 {
    if x < 2.5 {
        // erf(x) = 2/√π · e^(−x²) · Σ 2ⁿ x^(2n+1) / (1·3·…·(2n+1)); Abramowitz and Stegun 7.1.6.
        let (mut term, mut sum, mut n) = (x, x, 1.0);
        while term > 1e-17 * sum {
            term *= 2.0 * x * x / (2.0 * n + 1.0);
            sum += term;
            n += 1.0;
        }
        return 1.0 - std::f64::consts::FRAC_2_SQRT_PI * (-x * x).exp() * sum;
    }
    // Continued fraction √π·e^(x²)·erfc(x) = 1/(x + (1/2)/(x + 1/(x + (3/2)/(x + …)))), from the inside; Abramowitz and
    // Stegun 7.1.14.
    let fraction = (1..=60).rev().fold(x, |inner, n| x + 0.5 * f64::from(n) / inner);
    0.5 * std::f64::consts::FRAC_2_SQRT_PI * (-x * x).exp() / fraction
}

#[cfg(test)]
mod tests {
    use bottega_kernels::SplitMix64;

    use super::*;

    /// Moments of pictures of 2000 pixels, 64 uniform samples each, scaled by `factor`.
    fn sampled(seed: u64, factor: f64) -> Vec<Moments> {
        let mut numbers = SplitMix64::new(seed);
        let samples = 64.0;
        (0..2000)
            .map(|pixel| {
                let brightness = factor * f64::from(1 + pixel % 7);
                let values: Vec<f64> = (0..64).map(|_| brightness * numbers.unit()).collect();
                let mean = values.iter().sum::<f64>() / samples;
                let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (samples - 1.0);
                Moments { mean, variance, samples }
            })
            .collect()
    }

    #[test]
    fn two_seeds_of_one_picture_are_accepted() {
        let (a, b) = (sampled(1, 1.0), sampled(2, 1.0));
        assert!(rejected_share(&a, &b, 0.01) <= 0.0025);
        assert!(mean_z_score(&a, &b).abs() < 4.0);
    }

    #[test]
    fn a_percent_of_light_lost_everywhere_shows_in_the_mean_only() {
        let (a, b) = (sampled(1, 1.0), sampled(2, 0.98));
        assert!(rejected_share(&a, &b, 0.01) <= 0.0025);
        assert!(mean_z_score(&a, &b) > 5.0, "{}", mean_z_score(&a, &b));
    }

    #[test]
    fn one_wrong_pixel_in_a_hundred_is_rejected() {
        let a = sampled(1, 1.0);
        let mut b = sampled(2, 1.0);
        b.iter_mut().step_by(100).for_each(|m| m.mean *= 2.0);
        assert!((rejected_share(&a, &b, 0.01) - 0.01).abs() < 1e-3);
        b[1].mean = f64::NAN;
        assert!((rejected_share(&a, &b, 0.01) - 0.0105).abs() < 1e-3);
    }

    #[test]
    fn values_without_noise_may_differ_by_rounding_only() {
        let exact = |mean| vec![Moments { mean, variance: 0.0, samples: 16.0 }; 10];
        assert_eq!(rejected_share(&exact(1.0), &exact(1.0 + 1e-7), 0.01), 0.0);
        assert_eq!(rejected_share(&exact(1.0), &exact(1.001), 0.01), 1.0);
    }

    #[test]
    fn the_tail_of_the_normal_distribution_has_its_published_values() {
        let expected = [
            (0.0, 1.0),
            (1.0, 0.317_310_507_862_914),
            (1.959_963_984_540_054, 0.05),
            (3.5, 4.652_581_580_710_501e-4),
            (3.54, 4.001_270_320_146_411e-4),
            (6.0, 1.973_175_290_075_396e-9),
        ];
        for (z, p) in expected {
            assert!((two_sided_p(z) - p).abs() < 1e-6 * p, "{z}: {} {p}", two_sided_p(z));
        }
    }
}
