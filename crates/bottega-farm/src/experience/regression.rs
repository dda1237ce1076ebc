//! A linear model that is fitted online, by recursive least squares.
//!
//! Source: Ljung 1999, *System Identification*, §11.2 (recursive least squares with forgetting); Potter's square-root form
//! (Maybeck 1979, *Stochastic Models, Estimation, and Control*, §7.3), in which rounding cannot make a variance negative; Huber
//! 1964 for the bound on outliers.

use serde::{Deserialize, Serialize};

use super::features::{FEATURES, FeatureVector};

/// Residuals beyond this many standard deviations count as that many, so that one wrong time has little effect.
const OUTLIER: f64 = 2.0;
/// Bound on weights and deviations of a sound model.
const VALUE_MAX: f64 = 1e4;

/// A linear model y ≈ weights · x, whose first feature is the constant 1, with the covariance of its
/// weights. Starts from a prior, and each observation moves it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Regression {
    /// The weight of each feature.
    weights: FeatureVector,
    /// A square root R of the covariance of the weights, which is R Rᵀ; row by row.
    root: [FeatureVector; FEATURES],
    /// The weight of all observations; older ones count less.
    count: f64,
}

impl Regression {
    /// Makes a model without observations.
    ///
    /// - `weights`: the expected weights.
    /// - `deviations`: how far each weight may be from the expected one (standard deviation).
    pub(super) fn new(weights: FeatureVector, deviations: &FeatureVector) -> Self {
        let row = |place: usize| std::array::from_fn(|column| if column == place { deviations[place] } else { 0.0 });
        Self { weights, root: std::array::from_fn(row), count: 0.0 }
    }

    /// Returns the model of y + `shift` instead of y.
    pub(super) fn shifted(&self, shift: f64) -> Self {
        let mut shifted = self.clone();
        shifted.weights[0] += shift;
        shifted
    }

    /// Returns the expected value of y.
    pub(super) fn expected(&self, x: &FeatureVector) -> f64 {
        dot(&self.weights, x)
    }

    /// Returns the variance of the expected value, from the uncertainty of the weights.
    pub(super) fn variance(&self, x: &FeatureVector) -> f64 {
        let shares = self.shares(x);
        dot(&shares, &shares)
    }

    /// Learns an observation.
    ///
    /// - `noise`: standard deviation of y at known weights.
    /// - `weight`: how much it counts, above 0, 1 for a full one.
    pub(super) fn learn(&mut self, x: &FeatureVector, y: f64, noise: f64, weight: f64) {
        let shares = self.shares(x);
        let of_noise = noise * noise / weight;
        let variance = dot(&shares, &shares) + of_noise;
        let limit = OUTLIER * variance.sqrt();
        let residual = (y - self.expected(x)).clamp(-limit, limit);
        if !residual.is_finite() || variance <= 0.0 {
            return;
        }
        // Move the weights along the gain, and narrow the root of the covariance by what was learned
        let narrowing = 1.0 / (1.0 + (of_noise / variance).sqrt());
        for (weight, row) in self.weights.iter_mut().zip(&mut self.root) {
            let gain = dot(row, &shares) / variance;
            *weight += gain * residual;
            row.iter_mut().zip(&shares).for_each(|(cell, share)| *cell -= narrowing * gain * share);
        }
        self.count += weight;
    }

    /// Lets earlier observations count less: widens the covariance by 1 ∕ `kept`, up to that of the prior.
    pub(super) fn forget(&mut self, kept: f64, deviations: &FeatureVector) {
        for (row, deviation) in self.root.iter_mut().zip(deviations) {
            let variance = dot(row, row).max(f64::MIN_POSITIVE);
            let scale = (deviation * deviation / variance).min(1.0 / kept).max(1.0).sqrt();
            row.iter_mut().for_each(|cell| *cell *= scale);
        }
        self.count *= kept;
    }

    /// Returns the weight of all observations; older ones count less.
    pub(super) fn count(&self) -> f64 {
        self.count
    }

    /// Returns the weight of each feature.
    pub(super) fn weights(&self) -> &FeatureVector {
        &self.weights
    }

    /// Returns true if all numbers are plausible.
    pub(super) fn is_sound(&self) -> bool {
        let is_plausible = |value: &f64| value.abs() <= VALUE_MAX;
        self.weights.iter().chain(self.root.iter().flatten()).all(is_plausible)
            && self.count.is_finite()
            && self.count >= 0.0
    }

    /// Returns the transposed root times `x`: the variance of x · weights is the sum of their squares.
    fn shares(&self, x: &FeatureVector) -> FeatureVector {
        std::array::from_fn(|column| self.root.iter().zip(x).map(|(row, value)| row[column] * value).sum())
    }
}

fn dot(a: &FeatureVector, b: &FeatureVector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
