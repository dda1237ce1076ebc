//! Time per sample, predicted from the counts of the survey.

use bottega_engines::{Survey, SurveyPixel};

use super::{
    Channel, ChannelSet,
    channel::{sane, smoothed},
};

/// A term of the time per sample.
struct CostTerm {
    /// The channel of the term.
    channel: Channel,
    /// Returns the count of a pixel, per path.
    count: fn(&SurveyPixel) -> f32,
    /// Time per count, in nanoseconds of the machine on which the weights were fitted. Only ratios matter.
    weight: f32,
}

/// The terms, fitted by least squares; `bench/attempts/farm.md` has the fit and its accuracy on scenes that were left out.
/// Counts whose fitted weight was negligible (a constant per sample, vertices in addition to rays) are left out.
const TERMS: [CostTerm; 4] = [
    CostTerm { channel: Channel::Steps, count: |pixel| pixel.steps, weight: 50.0 },
    CostTerm { channel: Channel::Shadow, count: |pixel| pixel.shadow_rays, weight: 476.0 },
    CostTerm { channel: Channel::Material, count: |pixel| pixel.layered, weight: 151.0 },
    CostTerm { channel: Channel::Material, count: |pixel| pixel.lookups, weight: 711.0 },
];

/// Returns the predicted time per sample of each cell, row-major, smoothed over 3 × 3 cells. A channel that is off
/// counts everywhere as its mean.
pub(super) fn predicted(survey: &Survey, channels: ChannelSet) -> Vec<f32> {
    let cells = survey.pixels.len();
    let mean = |term: &CostTerm| {
        survey.pixels.iter().map(|pixel| f64::from(sane((term.count)(pixel)))).sum::<f64>() / cells as f64
    };
    let means: [f32; TERMS.len()] = std::array::from_fn(|i| mean(&TERMS[i]) as f32);
    smoothed(survey, |pixel| {
        let counted = |(term, mean): (&CostTerm, &f32)| {
            let count = if channels.contains(term.channel) { sane((term.count)(pixel)) } else { *mean };
            term.weight * count
        };
        TERMS.iter().zip(&means).map(counted).sum::<f32>()
    })
}

/// Returns the part of the predicted time per sample that the counts of one channel take, like [`predicted`].
pub(super) fn predicted_of(survey: &Survey, channel: Channel) -> Vec<f32> {
    smoothed(survey, |pixel| {
        let terms = TERMS.iter().filter(|term| term.channel == channel);
        terms.map(|term| term.weight * sane((term.count)(pixel))).sum::<f32>()
    })
}
