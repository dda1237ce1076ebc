//! The outlook of zones: predicted times and features from the survey, before painting.

use bottega_engines::{Survey, SurveyPixel};
use bottega_image::Rect;

use super::{
    COST_FLOOR, Channel, ChannelSet,
    channel::{sane, smoothed},
    cost::{predicted, predicted_of},
    sums::Sums,
};

/// Seconds per nanosecond.
const NANOSECOND: f64 = 1e-9;

/// Width of the grid of a [`PictureOutlook`], in cells.
pub const OUTLOOK_COLUMNS: u32 = 32;
/// Height of the grid of a [`PictureOutlook`], in cells.
pub const OUTLOOK_ROWS: u32 = 24;
/// Maximum of [`TaskFeatures::bounces`].
const BOUNCES_MAX: f64 = 1e3;

/// Features that distinguish tasks, from the survey's paths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaskFeatures {
    /// Degree of reflection and refraction, 0..=1: mean over the survey's cells of the number of consecutive mirrored
    /// or refracted bounces per path, at most 1 per cell.
    pub glass: f64,
    /// Texture lookups per path vertex: mean over the survey's cells, at most 1 per cell.
    pub texture: f64,
    /// Share of path segments inside media, 0..=1.
    pub media: f64,
    /// Share of the predicted time that rays towards lights take, 0..=1.
    pub shadow: f64,
    /// Share of the predicted time that surfaces of several lobes and textures take, 0..=1.
    pub material: f64,
    /// Mean number of vertices of a path, at most 1000.
    pub bounces: f64,
}

/// The survey's prediction for a part of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaskOutlook {
    /// The pixels of the part.
    pub rect: Rect,
    /// Predicted time of one sample in every pixel of the part, all together, in seconds of the reference machine.
    pub sample_time: f64,
    /// The features of the part, for the model of its technique.
    pub features: TaskFeatures,
}

/// The survey's predictions for the zones of a picture, and for the cells of a grid over it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureOutlook {
    /// The pixels that the grid covers evenly.
    pub frame: Rect,
    /// The prediction for each zone, in the order of their ids.
    pub zones: Vec<TaskOutlook>,
    /// Predicted seconds of the reference machine per sample and pixel, row-major, [`OUTLOOK_COLUMNS`] ×
    /// [`OUTLOOK_ROWS`].
    pub grid: Vec<f64>,
}

impl PictureOutlook {
    /// Returns the predicted seconds of the reference machine per sample and pixel, over the whole picture; 0 without a
    /// grid.
    pub fn mean_density(&self) -> f64 {
        self.grid.iter().sum::<f64>() / self.grid.len().max(1) as f64
    }
}

/// The survey's predictions for a picture; independent of experience.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outlook {
    /// Predicted time per sample, in nanoseconds of the reference machine.
    time: Sums,
    /// The parts of the time for rays towards lights, and for materials.
    shadow: Sums,
    material: Sums,
    glass: Sums,
    texture: Sums,
    media: Sums,
    bounces: Sums,
}

impl Outlook {
    /// Predicts the time of a sample for each cell of a survey.
    ///
    /// - `survey`: valid, as for an [`ImportanceMap`](super::ImportanceMap); covers the pixels of `surveyed` evenly.
    pub(crate) fn new(survey: &Survey, surveyed: Rect) -> Self {
        let sums = |values: Vec<f32>| Sums::new(surveyed, (survey.width, survey.height), values);
        let share = |value: fn(&SurveyPixel) -> f32| sums(smoothed(survey, |pixel| value(pixel).clamp(0.0, 1.0)));
        let time = sums(predicted(survey, ChannelSet::ALL));
        let mean = time.integral(&surveyed) / surveyed.area().max(1) as f64;
        Self {
            time: time.map(|value| value.max((mean * COST_FLOOR) as f32)),
            shadow: sums(predicted_of(survey, Channel::Shadow)),
            material: sums(predicted_of(survey, Channel::Material)),
            bounces: sums(smoothed(survey, |pixel| sane(pixel.path_length))),
            glass: share(|pixel| sane(pixel.recursion_levels)),
            texture: share(|pixel| sane(pixel.lookups) / sane(pixel.path_length).max(1.0)),
            media: share(|pixel| sane(pixel.media) / (sane(pixel.path_length) + 1.0)),
        }
    }

    /// Returns the predictions for zones, and for the grid over `frame`. Panics if a zone or `frame` reaches beyond the
    /// survey.
    pub(crate) fn of_picture(&self, frame: &Rect, zones: impl Iterator<Item = Rect>) -> PictureOutlook {
        let cells = (0..OUTLOOK_ROWS).flat_map(|row| (0..OUTLOOK_COLUMNS).map(move |column| (column, row)));
        let grid = cells.map(|(column, row)| {
            let cell = grid_cell(frame, column, row);
            self.time.integral(&cell).max(0.0) * NANOSECOND / cell.area() as f64
        });
        PictureOutlook { frame: *frame, zones: zones.map(|rect| self.of(&rect)).collect(), grid: grid.collect() }
    }

    /// Returns the prediction for the pixels of `rect`. Constant time. Panics if `rect` reaches beyond the survey.
    pub(crate) fn of(&self, rect: &Rect) -> TaskOutlook {
        let mean = |sums: &Sums| sums.integral(rect) / rect.area().max(1) as f64;
        let share = |sums: &Sums| mean(sums).clamp(0.0, 1.0);
        let time = self.time.integral(rect).max(0.0);
        let of_time = |sums: &Sums| if time > 0.0 { (sums.integral(rect) / time).clamp(0.0, 1.0) } else { 0.0 };
        TaskOutlook {
            rect: *rect,
            sample_time: time * NANOSECOND,
            features: TaskFeatures {
                glass: share(&self.glass),
                texture: share(&self.texture),
                media: share(&self.media),
                shadow: of_time(&self.shadow),
                material: of_time(&self.material),
                bounces: mean(&self.bounces).clamp(0.0, BOUNCES_MAX),
            },
        }
    }
}

/// Returns the pixels of a cell of the grid: at least one.
fn grid_cell(frame: &Rect, column: u32, row: u32) -> Rect {
    let part = |start: u32, end: u32, place: u32, count: u32| {
        let side = u64::from(end - start);
        let at = |place: u32| start + (side * u64::from(place) / u64::from(count)) as u32;
        let first = at(place).min(end - 1);
        (first, at(place + 1).max(first + 1))
    };
    let ((x0, x1), (y0, y1)) =
        (part(frame.x0, frame.x1, column, OUTLOOK_COLUMNS), part(frame.y0, frame.y1, row, OUTLOOK_ROWS));
    Rect::new(x0, y0, x1, y1)
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
