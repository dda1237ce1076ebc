//! The outlook of zones: predicted times and features from the survey, before painting.

use bottega_engines::{Survey, SurveyPixel};
use bottega_image::Rect;

use super::{
    COST_FLOOR, ChannelSet,
    channel::{sane, smoothed},
    cost::predicted,
    sums::Sums,
};

/// Seconds per nanosecond.
const NANOSECOND: f64 = 1e-9;

/// Features that distinguish kinds of tasks, as shares of the survey's paths, each 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaskFeatures {
    /// Paths that hit a mirror or glass first.
    pub glass: f64,
    /// Vertices with a texture.
    pub texture: f64,
    /// Segments inside media.
    pub media: f64,
}

/// The survey's prediction for a part of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaskOutlook {
    /// Predicted time of one sample for each of its pixels, in seconds of the reference machine.
    pub sample_time: f64,
    /// Its features.
    pub features: TaskFeatures,
}

/// The survey's predictions for a picture; independent of experience.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outlook {
    /// Predicted time per sample, in nanoseconds of the reference machine.
    time: Sums,
    glass: Sums,
    texture: Sums,
    media: Sums,
}

impl Outlook {
    /// - `survey`: valid, as for an [`ImportanceMap`](super::ImportanceMap); covers the pixels of `surveyed` evenly.
    pub(crate) fn new(survey: &Survey, surveyed: Rect) -> Self {
        let sums = |values: Vec<f32>| Sums::new(surveyed, (survey.width, survey.height), values);
        let share = |value: fn(&SurveyPixel) -> f32| sums(smoothed(survey, |pixel| value(pixel).clamp(0.0, 1.0)));
        let time = sums(predicted(survey, ChannelSet::ALL));
        let mean = time.integral(&surveyed) / surveyed.area().max(1) as f64;
        Self {
            time: time.map(|value| value.max((mean * COST_FLOOR) as f32)),
            glass: share(|pixel| sane(pixel.recursion_levels)),
            texture: share(|pixel| sane(pixel.lookups) / sane(pixel.path_length).max(1.0)),
            media: share(|pixel| sane(pixel.media) / (sane(pixel.path_length) + 1.0)),
        }
    }

    /// The prediction for the pixels of `rect`. Constant time. Panics if `rect` reaches beyond the survey.
    pub(crate) fn of(&self, rect: &Rect) -> TaskOutlook {
        let mean = |sums: &Sums| (sums.integral(rect) / rect.area().max(1) as f64).clamp(0.0, 1.0);
        TaskOutlook {
            sample_time: self.time.integral(rect).max(0.0) * NANOSECOND,
            features: TaskFeatures { glass: mean(&self.glass), texture: mean(&self.texture), media: mean(&self.media) },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_shares_of_what_the_paths_of_a_part_meet() {
        let glass = SurveyPixel { recursion_levels: 2.0, path_length: 4.0, steps: 80.0, ..SurveyPixel::default() };
        let wood = SurveyPixel { lookups: 1.0, path_length: 2.0, steps: 20.0, ..SurveyPixel::default() };
        let fog = SurveyPixel { media: 3.0, path_length: 2.0, steps: f32::NAN, ..SurveyPixel::default() };
        let pixels: Vec<SurveyPixel> = (0..64 * 8).map(|i| [glass, wood, fog, wood][i % 64 / 16]).collect();
        let survey = Survey { width: 64, height: 8, pixels, zones_max: None };
        let outlook = Outlook::new(&survey, Rect::of_size(640, 80));
        let of = |x: u32| outlook.of(&Rect::new(x, 0, x + 80, 80));
        let near = |value: f64, wanted: f64| (value - wanted).abs() < 0.02;
        let (left, second, third) = (of(40), of(200), of(360));
        assert!(near(left.features.glass, 1.0) && near(left.features.texture, 0.0), "{left:?}");
        assert!(near(second.features.texture, 0.5) && near(second.features.glass, 0.0), "{second:?}");
        assert!(near(third.features.media, 1.0) && third.sample_time > 0.0, "{third:?}");
        assert!(left.sample_time > 2.0 * second.sample_time);
    }
}
