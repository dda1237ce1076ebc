//! The features of a zone, from which its time is predicted.

use crate::TaskOutlook;

/// Number of features, the constant 1 included.
pub(super) const FEATURES: usize = 10;

/// The values of the features of one zone.
pub(super) type FeatureVector = [f64; FEATURES];

/// A feature, for display.
pub(super) struct FeatureKind {
    /// The name of the feature, for display.
    pub(super) name: &'static str,
    /// The step of the feature for which a learned factor is shown.
    pub(super) step: f64,
    /// The weight's expected distance from 0 before anything is learned.
    pub(super) deviation: f64,
}

/// ln 2: the step of features that are logarithms, so that a factor per doubling is shown.
const DOUBLING: f64 = std::f64::consts::LN_2;

/// The features in the order of [`features_of`].
pub(super) const KINDS: [FeatureKind; FEATURES] = [
    FeatureKind { name: "all zones", step: 1.0, deviation: 2.0 },
    FeatureKind { name: "glass", step: 1.0, deviation: 0.4 },
    FeatureKind { name: "texture", step: 1.0, deviation: 0.4 },
    FeatureKind { name: "media", step: 1.0, deviation: 0.4 },
    FeatureKind { name: "rays towards lights", step: 1.0, deviation: 0.4 },
    FeatureKind { name: "materials", step: 1.0, deviation: 0.4 },
    FeatureKind { name: "bounces, twice as many", step: DOUBLING, deviation: 0.3 },
    FeatureKind { name: "complexity, twice the mean", step: DOUBLING, deviation: 0.3 },
    FeatureKind { name: "size, twice as large", step: DOUBLING, deviation: 0.15 },
    FeatureKind { name: "samples, twice as many", step: DOUBLING, deviation: 0.15 },
];

/// Bound on each feature.
const FEATURE_MAX: f64 = 8.0;

/// Returns the expected distance of each weight from 0 before anything is learned.
pub(super) fn deviations() -> FeatureVector {
    std::array::from_fn(|place| KINDS[place].deviation)
}

/// Returns the features of a zone. Each is about 0 for a usual zone, so that the first weight is the factor of usual
/// zones.
///
/// - `mean_density`: predicted seconds per sample and pixel of the whole picture.
/// - `samples`: samples per pixel.
pub(super) fn features_of(mean_density: f64, zone: &TaskOutlook, samples: u32) -> FeatureVector {
    let pixels = zone.rect.area().max(1) as f64;
    let log = |value: f64, usual: f64| (value / usual).max(1e-3).ln();
    let of = &zone.features;
    let values = [
        1.0,
        of.glass,
        of.texture,
        of.media,
        of.shadow - 0.3,
        of.material - 0.1,
        log(of.bounces, 3.0),
        log(zone.sample_time / pixels, mean_density),
        log(pixels, 1024.0),
        log(f64::from(samples), 16.0),
    ];
    values.map(|value| if value.is_finite() { value.clamp(-FEATURE_MAX, FEATURE_MAX) } else { 0.0 })
}
