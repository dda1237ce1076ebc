//! The importance map: expected cost and visual importance of each part of the picture.
//!
//! Made by the Analyst from the engine's quick [`Survey`], before and independent of all rendering (MAGarRO, section
//! 3.3). Costs are relative: their mean over the frame is 1 per pixel, so the complexity of a zone is a number of
//! average pixels.

mod channel;
mod cost;
mod outlook;
mod saliency;
mod sums;
mod visual;

use std::{fmt, str::FromStr};

use bottega_engines::Survey;
use bottega_image::Rect;

pub use self::channel::{Channel, ChannelSet, UnknownChannel};
pub(crate) use self::outlook::Outlook;
pub use self::outlook::{OUTLOOK_COLUMNS, OUTLOOK_ROWS, PictureOutlook, TaskFeatures, TaskOutlook};
use self::sums::Sums;

/// Minimum cost of a cell, as a share of the frame's mean: that of a sample whose ray misses the scene.
const COST_FLOOR: f64 = 0.02;
/// Maximum number of survey cells of a map.
const CELLS_MAX: u64 = 1 << 26;

/// The function that gives a survey cell its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImportanceFunction {
    /// One plus the levels of recursion in mirror and transparent surfaces. Source: MAGarRO, section 3.3. (The paper
    /// gives no value for places without such surfaces; they get 1.)
    Paper,
    /// Time per sample, predicted from these channels: `bench/attempts/farm.md` has the accuracy.
    PredictedCost(ChannelSet),
    /// Visibility of an error, from these channels. Zones then have equal visual importance instead of equal time.
    Visual(ChannelSet),
}

impl ImportanceFunction {
    /// Names of all functions in the command line and JSON.
    const NAMES: [&str; 3] = ["paper", "predicted", "visual"];

    /// Returns the function with other channels; the paper's has a single fixed one.
    #[must_use]
    pub fn of_channels(self, channels: ChannelSet) -> Self {
        match self {
            Self::Paper => Self::Paper,
            Self::PredictedCost(_) => Self::PredictedCost(channels),
            Self::Visual(_) => Self::Visual(channels),
        }
    }

    /// Returns the channels given to the function, including those that it does not use.
    pub fn channels(self) -> ChannelSet {
        match self {
            Self::Paper => ChannelSet::NONE.with(Channel::Recursion),
            Self::PredictedCost(channels) | Self::Visual(channels) => channels,
        }
    }
}

impl Default for ImportanceFunction {
    fn default() -> Self {
        Self::PredictedCost(ChannelSet::ALL)
    }
}

impl FromStr for ImportanceFunction {
    type Err = ImportanceError;

    fn from_str(name: &str) -> Result<Self, ImportanceError> {
        match name {
            "paper" => Ok(Self::Paper),
            "predicted" => Ok(Self::PredictedCost(ChannelSet::ALL)),
            "visual" => Ok(Self::Visual(ChannelSet::ALL)),
            _ => Err(ImportanceError::UnknownFunction { name: name.to_owned() }),
        }
    }
}

impl fmt::Display for ImportanceFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let index = match self {
            Self::Paper => 0,
            Self::PredictedCost(_) => 1,
            Self::Visual(_) => 2,
        };
        f.write_str(Self::NAMES[index])
    }
}

/// An error in making an importance map, or in parsing the name of its function.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImportanceError {
    /// The survey has no cells, too many, or another number of pixels than cells.
    #[error("survey of {width} × {height} cells holds {found} pixels")]
    SurveySize {
        /// Columns of cells.
        width: u32,
        /// Rows of cells.
        height: u32,
        /// Number of pixels found.
        found: usize,
    },
    /// The frame is empty or reaches beyond the survey.
    #[error("no pixel of the frame {frame} lies in the surveyed picture {surveyed}")]
    OutsideSurvey {
        /// The pixels to paint.
        frame: Rect,
        /// The pixels that the survey covers.
        surveyed: Rect,
    },
    /// No importance function has this name.
    #[error("unknown importance function `{name}`: there are {}", ImportanceFunction::NAMES.join(", "))]
    UnknownFunction {
        /// The name that was given.
        name: String,
    },
}

/// The importance map of one picture: predicted cost and visual importance of each survey cell.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportanceMap {
    /// Predicted cost per pixel; mean 1 over the frame, each at least [`COST_FLOOR`] of it.
    cost: Sums,
    /// Visual importance, 0..=1.
    importance: Sums,
}

impl ImportanceMap {
    /// Makes the map of a picture.
    ///
    /// - `survey`: covers the pixels of `surveyed` evenly.
    /// - `frame`: the pixels to paint, within `surveyed`. Their mean cost becomes 1.
    ///
    /// Values that are not finite or not positive count as 0. A survey without any cost gives a uniform map.
    ///
    /// # Errors
    /// The survey has no cells, too many cells, or another number of pixels than cells; or the frame is empty or not
    /// within `surveyed`.
    pub fn new(
        survey: &Survey,
        surveyed: Rect,
        frame: Rect,
        function: ImportanceFunction,
    ) -> Result<Self, ImportanceError> {
        let cells = u64::from(survey.width) * u64::from(survey.height);
        if cells == 0 || cells > CELLS_MAX || cells != survey.pixels.len() as u64 {
            let found = survey.pixels.len();
            return Err(ImportanceError::SurveySize { width: survey.width, height: survey.height, found });
        }
        if frame.is_empty() || !surveyed.encloses(&frame) {
            return Err(ImportanceError::OutsideSurvey { frame, surveyed });
        }
        let importance = match function {
            ImportanceFunction::Visual(channels) => visual::importance(survey, channels),
            _ => visual::importance(survey, ChannelSet::ALL),
        };
        let cost = match function {
            ImportanceFunction::Paper => Channel::Recursion.values(survey).iter().map(|levels| 1.0 + levels).collect(),
            ImportanceFunction::PredictedCost(channels) => cost::predicted(survey, channels),
            ImportanceFunction::Visual(_) => importance.clone(),
        };
        let size = (survey.width, survey.height);
        let cost = normalized(&Sums::new(surveyed, size, cost), &frame);
        Ok(Self { cost, importance: Sums::new(surveyed, size, importance) })
    }

    /// Makes a uniform map, for a picture about which nothing is known: every pixel has cost 1 and visual importance ½.
    ///
    /// - `frame`: the pixels that it covers.
    pub fn uniform(frame: Rect) -> Self {
        let even = |value: f32| Sums::new(frame, (1, 1), vec![value]);
        Self { cost: even(1.0), importance: even(0.5) }
    }

    /// Returns the numbers of columns and rows of cells.
    pub fn size(&self) -> (u32, u32) {
        self.cost.size()
    }

    /// Returns the predicted cost per pixel of each cell, row-major; the mean over the frame is 1.
    pub fn cost(&self) -> &[f32] {
        self.cost.values()
    }

    /// Returns the visual importance of each cell, row-major, 0..=1.
    pub fn importance(&self) -> &[f32] {
        self.importance.values()
    }

    /// Returns the map as a grayscale picture, row-major, one value per cell: the cost from 0 (least, black) to 1 (greatest, white).
    pub fn grey(&self) -> Vec<f32> {
        let cost = self.cost();
        let least = cost.iter().copied().fold(f32::INFINITY, f32::min);
        let most = cost.iter().copied().fold(0.0, f32::max);
        let range = if most > least { most - least } else { 1.0 };
        cost.iter().map(|cost| (cost - least) / range).collect()
    }

    /// Returns the predicted cost of all pixels of `rect`, in average pixels of the frame. Positive unless `rect` is
    /// empty. Constant time.
    ///
    /// # Panics
    /// If `rect` reaches beyond the survey.
    pub fn complexity(&self, rect: &Rect) -> f64 {
        if rect.is_empty() {
            return 0.0;
        }
        // A difference of large sums: rounding must not make the cost vanish.
        self.cost.integral(rect).max(rect.area() as f64 * COST_FLOOR * 1e-3)
    }

    /// Returns the predicted cost per pixel of `rect`, in average pixels of the frame: the paper's complexity/size
    /// ratio. 0 if `rect` is empty.
    ///
    /// # Panics
    /// If `rect` reaches beyond the survey.
    pub fn complexity_density(&self, rect: &Rect) -> f64 {
        if rect.is_empty() { 0.0 } else { self.complexity(rect) / rect.area() as f64 }
    }

    /// Returns the mean visual importance of the pixels of `rect`, 0..=1; 0 if it is empty. Constant time.
    ///
    /// # Panics
    /// If `rect` reaches beyond the survey.
    pub fn importance_of(&self, rect: &Rect) -> f64 {
        if rect.is_empty() { 0.0 } else { (self.importance.integral(rect) / rect.area() as f64).clamp(0.0, 1.0) }
    }
}

/// Scales the cost to mean 1 over the frame, with every cell at least [`COST_FLOOR`].
fn normalized(cost: &Sums, frame: &Rect) -> Sums {
    let mean = |cost: &Sums| cost.integral(frame) / frame.area() as f64;
    // Apply the floor before the division, because it changes the mean.
    let before = mean(cost);
    let least = if before > 0.0 { before * COST_FLOOR } else { 1.0 };
    let raised = cost.map(|value| value.max(least as f32));
    let after = mean(&raised);
    raised.map(|value| (f64::from(value) / after) as f32)
}

#[cfg(test)]
mod tests {
    use bottega_engines::SurveyPixel;
    use proptest::prelude::*;

    use super::*;

    fn survey_of(width: u32, height: u32, levels: impl Fn(u32, u32) -> f32) -> Survey {
        let pixels = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| SurveyPixel {
                recursion_levels: levels(x, y),
                steps: 10.0 * levels(x, y),
                path_length: 2.0,
                ..SurveyPixel::default()
            })
            .collect();
        Survey { width, height, pixels, zones_max: None }
    }

    #[test]
    fn the_paper_counts_recursion_levels_and_shows_simple_as_dark() {
        let survey = survey_of(2, 1, |x, _| if x == 0 { 0.0 } else { 3.0 });
        let frame = Rect::of_size(200, 100);
        let map = ImportanceMap::new(&survey, frame, frame, ImportanceFunction::Paper).unwrap();
        assert_eq!(map.grey(), [0.0, 1.0]);
        let (left, right) = (Rect::new(0, 0, 100, 100), Rect::new(100, 0, 200, 100));
        assert!((map.complexity(&right) / map.complexity(&left) - 4.0).abs() < 1e-5);
        assert!((map.complexity_density(&frame) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_pixel_smaller_than_a_cell_takes_its_part_of_it() {
        let survey = survey_of(1, 1, |_, _| 1.0);
        let surveyed = Rect::of_size(64, 64);
        let map = ImportanceMap::new(&survey, surveyed, surveyed, ImportanceFunction::default()).unwrap();
        assert!((map.complexity(&Rect::new(3, 9, 4, 10)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn values_that_are_no_numbers_are_not_believed() {
        let survey = survey_of(3, 3, |x, _| [f32::NAN, f32::INFINITY, -4.0][x as usize]);
        let frame = Rect::of_size(9, 9);
        for function in ImportanceFunction::NAMES.map(|name| name.parse().unwrap()) {
            let map = ImportanceMap::new(&survey, frame, frame, function).unwrap();
            assert!(map.cost().iter().all(|cost| cost.is_finite() && *cost > 0.0));
            assert!(map.importance().iter().all(|value| (0.0..=1.0).contains(value)));
        }
    }

    #[test]
    fn functions_are_written_as_they_are_read() {
        for name in ImportanceFunction::NAMES {
            assert_eq!(name.parse::<ImportanceFunction>().unwrap().to_string(), name);
        }
        assert!("cost".parse::<ImportanceFunction>().is_err());
    }

    #[test]
    fn a_channel_that_is_off_tells_no_places_apart() {
        let survey = survey_of(4, 1, |x, _| x as f32);
        let frame = Rect::of_size(40, 10);
        let map =
            |channels| ImportanceMap::new(&survey, frame, frame, ImportanceFunction::PredictedCost(channels)).unwrap();
        assert!(map(ChannelSet::NONE).cost().iter().all(|cost| (cost - 1.0).abs() < 1e-6));
        // Only the steps differ in this survey.
        let without = ChannelSet::ALL.iter().filter(|&channel| channel != Channel::Steps).collect();
        assert_eq!(map(without), map(ChannelSet::NONE));
        assert_eq!(map(ChannelSet::NONE.with(Channel::Steps)).cost(), map(ChannelSet::ALL).cost());
    }

    #[test]
    fn the_importance_of_a_rectangle_is_the_mean_of_its_pixels() {
        let mut survey = survey_of(8, 8, |_, _| 1.0);
        for (i, pixel) in survey.pixels.iter_mut().enumerate() {
            pixel.noise = (i % 5) as f32;
            pixel.color = [1.0; 3];
        }
        let frame = Rect::of_size(16, 24);
        let map = ImportanceMap::new(&survey, frame, frame, ImportanceFunction::Paper).unwrap();
        let of_pixel = |x: u32, y: u32| f64::from(map.importance()[(y / 3 * 8 + x / 2) as usize]);
        for rect in [frame, Rect::new(3, 5, 11, 17), Rect::new(15, 23, 16, 24), Rect::new(2, 2, 2, 9)] {
            let sum: f64 = rect.pixels().map(|(x, y)| of_pixel(x, y)).sum();
            assert!((map.importance_of(&rect) - sum / rect.area().max(1) as f64).abs() < 1e-6, "{rect}");
        }
        assert!(map.importance_of(&frame) > 0.0);
    }

    #[test]
    fn a_survey_that_lies_about_its_size_is_refused() {
        let frame = Rect::of_size(4, 4);
        let mut survey = survey_of(2, 2, |_, _| 0.0);
        survey.pixels.pop();
        assert!(matches!(
            ImportanceMap::new(&survey, frame, frame, ImportanceFunction::Paper),
            Err(ImportanceError::SurveySize { found: 3, .. })
        ));
        let survey = survey_of(2, 2, |_, _| 0.0);
        let outside = Rect::new(2, 2, 5, 5);
        assert!(ImportanceMap::new(&survey, frame, outside, ImportanceFunction::Paper).is_err());
    }

    proptest! {
        #[test]
        fn complexity_is_additive_and_positive(
            (width, height) in (1u32..9, 1u32..9),
            (columns, rows) in (1u32..60, 1u32..60),
            (cut, seed) in (0.0f64..1.0, 0u32..1000),
        ) {
            let survey = survey_of(width, height, |x, y| ((x * 7 + y * 13 + seed) % 5) as f32);
            let frame = Rect::of_size(columns, rows);
            let map = ImportanceMap::new(&survey, frame, frame, ImportanceFunction::default()).unwrap();
            let x = (cut * f64::from(columns)) as u32;
            let left = map.complexity(&Rect::new(0, 0, x, rows));
            let right = map.complexity(&Rect::new(x, 0, columns, rows));
            let whole = map.complexity(&frame);
            prop_assert!((left + right - whole).abs() <= 1e-9 * whole.max(1.0));
            prop_assert!((whole - frame.area() as f64).abs() < 1e-4 * whole);
            for (x, y) in frame.pixels() {
                prop_assert!(map.complexity(&Rect::new(x, y, x + 1, y + 1)) > 0.0);
            }
        }
    }
}
