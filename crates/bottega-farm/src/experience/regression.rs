//! A linear model that is fitted online, by recursive least squares.
//!
//! Source: Ljung 1999, *System Identification*, §11.2 (recursive least squares with forgetting); Huber 1964 for the
//! bound on outliers.

use serde::{Deserialize, Serialize};

use super::features::{FEATURES, FeatureVector};

/// Residuals beyond this many standard deviations count as that many, so that one wrong time has little effect.
const OUTLIER: f64 = 2.0;
/// Bound on weights and variances of a sound model.
const VALUE_MAX: f64 = 1e4;

/// A linear model y ≈ weights · x, whose first feature is the constant 1, with the covariance of its weights. Starts from a prior, and each observation moves it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Regression {
    /// The weight of each feature.
    weights: FeatureVector,
    /// The covariance of the weights, symmetric.
    covariance: [FeatureVector; FEATURES],
    /// The weight of all observations; older ones count less.
    count: f64,
}

impl Regression {
    /// A model without observations.
    ///
    /// - `weights`: the expected weights.
    /// - `deviations`: how far each weight may be from the expected one (standard deviation).
    pub(super) fn new(weights: FeatureVector, deviations: &FeatureVector) -> Self {
        let mut covariance = [[0.0; FEATURES]; FEATURES];
        for (place, deviation) in deviations.iter().enumerate() {
            covariance[place][place] = deviation * deviation;
        }
        Self { weights, covariance, count: 0.0 }
    }

    /// The same model of y + `shift`.
    pub(super) fn shifted(&self, shift: f64) -> Self {
        let mut shifted = self.clone();
        shifted.weights[0] += shift;
        shifted
    }

    /// The expected value of y.
    pub(super) fn expected(&self, x: &FeatureVector) -> f64 {
        dot(&self.weights, x)
    }

    /// The variance of the expected value, from what is not known of the weights.
    pub(super) fn variance(&self, x: &FeatureVector) -> f64 {
        dot(&self.spread(x), x).max(0.0)
    }

    /// Learns an observation.
    ///
    /// - `noise`: standard deviation of y at known weights.
    /// - `weight`: how much it counts, above 0, 1 for a full one.
    pub(super) fn learn(&mut self, x: &FeatureVector, y: f64, noise: f64, weight: f64) {
        let spread = self.spread(x);
        let variance = dot(&spread, x).max(0.0) + noise * noise / weight;
        let limit = OUTLIER * variance.sqrt();
        let residual = (y - self.expected(x)).clamp(-limit, limit);
        if !residual.is_finite() || variance <= 0.0 {
            return;
        }
        // Move the weights along the gain, and narrow the covariance by what was learned
        for row in 0..FEATURES {
            let gain = spread[row] / variance;
            self.weights[row] += gain * residual;
            for (cell, other) in self.covariance[row].iter_mut().zip(&spread) {
                *cell -= gain * other;
            }
        }
        self.count += weight;
    }

    /// Lets earlier observations count less: widens the covariance by 1 ∕ `kept`, up to that of the prior.
    pub(super) fn forget(&mut self, kept: f64, deviations: &FeatureVector) {
        // Scaling rows and columns alike keeps the matrix positive semi-definite
        let scale = |place: usize| {
            let now = self.covariance[place][place].max(f64::MIN_POSITIVE);
            (deviations[place] * deviations[place] / now).min(1.0 / kept).max(1.0).sqrt()
        };
        let scales: FeatureVector = std::array::from_fn(scale);
        for (row, of_row) in self.covariance.iter_mut().zip(&scales) {
            row.iter_mut().zip(&scales).for_each(|(cell, of_column)| *cell *= of_row * of_column);
        }
        self.count *= kept;
    }

    /// The weight of all observations; older ones count less.
    pub(super) fn count(&self) -> f64 {
        self.count
    }

    /// The weight of each feature.
    pub(super) fn weights(&self) -> &FeatureVector {
        &self.weights
    }

    /// True if all numbers are plausible, and no variance is negative.
    pub(super) fn is_sound(&self) -> bool {
        let is_plausible = |value: &f64| value.abs() <= VALUE_MAX;
        let covariances = self.covariance.iter().flatten();
        self.weights.iter().chain(covariances).all(is_plausible)
            && (0..FEATURES).all(|place| self.covariance[place][place] >= -1e-9)
            && self.count.is_finite()
            && self.count >= 0.0
    }

    /// The covariance times `x`.
    fn spread(&self, x: &FeatureVector) -> FeatureVector {
        std::array::from_fn(|row| dot(&self.covariance[row], x))
    }
}

fn dot(a: &FeatureVector, b: &FeatureVector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
