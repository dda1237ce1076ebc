//! The importance map: what each place of the picture will cost, and how much it matters.
//!
//! Made by the Analyst from the engine's fast [`Survey`], before and independent of all rendering (MAGarRO,
//! section 3.3). Costs are relative: the mean over the frame is 1 a pixel, so the complexity of a zone reads as "so
//! many average pixels".

use std::{fmt, str::FromStr};

use bottega_engines::{Survey, SurveyPixel};
use bottega_image::Rect;

/// Cost of shading one path vertex (material, light choice, random numbers), in traversal steps.
const STEPS_PER_VERTEX: f32 = 12.0;
/// The least cost of a cell, as a share of the frame's mean: what a sample costs that leaves the scene at once.
const COST_FLOOR: f64 = 0.02;
/// Weight of relative noise in visual importance; the rest is contrast.
const NOISE_WEIGHT: f32 = 0.5;
/// Luminance below which noise is not seen relative to it, as a share of the mean luminance.
const DARK: f32 = 0.1;
/// Survey cells that a map accepts.
const CELLS_MAX: u64 = 1 << 26;

/// What a cell of the survey is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ImportanceFunction {
    /// Levels of recursion in mirror and transparent surfaces, and one for the first surface. Source: MAGarRO,
    /// section 3.3. (The paper does not say what a place without such surfaces is worth; some time it needs.)
    Paper,
    /// Traversal steps plus 12 for every path vertex, smoothed over 3 × 3 cells: proportional to the time that a
    /// sample takes in the built-in engine.
    #[default]
    PredictedCost,
}

impl FromStr for ImportanceFunction {
    type Err = ImportanceError;

    fn from_str(name: &str) -> Result<Self, ImportanceError> {
        match name {
            "paper" => Ok(Self::Paper),
            "cost" => Ok(Self::PredictedCost),
            _ => Err(ImportanceError::UnknownFunction { name: name.to_owned() }),
        }
    }
}

impl fmt::Display for ImportanceFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Paper => "paper",
            Self::PredictedCost => "cost",
        })
    }
}

/// Why there is no map.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImportanceError {
    /// The survey does not hold what it says.
    #[error("survey of {width} × {height} cells holds {found} pixels")]
    SurveySize {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Pixels found.
        found: usize,
    },
    /// There is nothing to look up.
    #[error("no pixel of the frame {frame} lies in the surveyed picture {surveyed}")]
    OutsideSurvey {
        /// The pixels to paint.
        frame: Rect,
        /// The pixels that the survey covers.
        surveyed: Rect,
    },
    /// No such function.
    #[error("unknown importance function `{name}`: use `paper` or `cost`")]
    UnknownFunction {
        /// What was asked for.
        name: String,
    },
}

/// The importance map of one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportanceMap {
    surveyed: Rect,
    width: u32,
    height: u32,
    /// `[width × height]`, mean over the frame 1, each at least [`COST_FLOOR`] of it.
    cost: Vec<f32>,
    /// `[width × height]`, 0..=1.
    importance: Vec<f32>,
    /// Summed areas of `cost`, `[(width + 1) × (height + 1)]`.
    sums: Vec<f64>,
}

impl ImportanceMap {
    /// Makes the map.
    ///
    /// - `survey`: covers the pixels of `surveyed` evenly.
    /// - `frame`: the pixels that will be painted, within `surveyed`. Their mean cost becomes 1.
    ///
    /// Values that are no finite positive number count as 0. A survey without any cost gives a uniform map.
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
        let cost = match function {
            ImportanceFunction::Paper => survey.pixels.iter().map(|pixel| 1.0 + sane(pixel.recursion_levels)).collect(),
            ImportanceFunction::PredictedCost => {
                smoothed(survey, |pixel| sane(pixel.steps) + STEPS_PER_VERTEX * sane(pixel.path_length))
            }
        };
        let mut map = Self {
            surveyed,
            width: survey.width,
            height: survey.height,
            cost,
            importance: visual_importance(survey),
            sums: Vec::new(),
        };
        map.normalize(&frame);
        Ok(map)
    }

    /// The map of a picture of which nothing is known: every pixel costs 1.
    pub fn uniform(frame: Rect) -> Self {
        let mut map =
            Self { surveyed: frame, width: 1, height: 1, cost: vec![1.0], importance: vec![0.5], sums: Vec::new() };
        map.sums = summed(1, 1, &map.cost);
        map
    }

    fn normalize(&mut self, frame: &Rect) {
        self.sums = summed(self.width, self.height, &self.cost);
        let mean = self.integral(frame) / frame.area() as f64;
        // The floor is set before the division: a cell may lie under it, their mean not.
        let least = if mean > 0.0 { mean * COST_FLOOR } else { 1.0 };
        let mut total = 0.0;
        for cost in &mut self.cost {
            *cost = cost.max(least as f32);
            total += f64::from(*cost);
        }
        debug_assert!(total > 0.0);
        self.sums = summed(self.width, self.height, &self.cost);
        let mean = self.integral(frame) / frame.area() as f64;
        for cost in &mut self.cost {
            *cost = (f64::from(*cost) / mean) as f32;
        }
        self.sums = summed(self.width, self.height, &self.cost);
    }

    /// Columns and rows of cells.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Predicted cost a pixel by cell, row-major; the mean over the frame is 1.
    pub fn cost(&self) -> &[f32] {
        &self.cost
    }

    /// Visual importance by cell, row-major, 0..=1: relative noise and contrast to the surroundings.
    pub fn importance(&self) -> &[f32] {
        &self.importance
    }

    /// The picture that a person looks at: cost by cell from 0 (least complex, dark) to 1 (most complex, white).
    pub fn grey(&self) -> Vec<f32> {
        let least = self.cost.iter().copied().fold(f32::INFINITY, f32::min);
        let most = self.cost.iter().copied().fold(0.0, f32::max);
        let range = if most > least { most - least } else { 1.0 };
        self.cost.iter().map(|cost| (cost - least) / range).collect()
    }

    /// Predicted cost of all pixels of `rect`, in average pixels of the frame. Positive unless `rect` is empty.
    /// Constant time. Panics when `rect` reaches out of the surveyed picture.
    pub fn complexity(&self, rect: &Rect) -> f64 {
        if rect.is_empty() {
            return 0.0;
        }
        // Differences of large sums: what is lost in rounding may not make a cost vanish.
        self.integral(rect).max(rect.area() as f64 * COST_FLOOR * 1e-3)
    }

    /// Predicted cost a pixel of `rect`: the paper's complexity/size ratio.
    pub fn density(&self, rect: &Rect) -> f64 {
        if rect.is_empty() { 0.0 } else { self.complexity(rect) / rect.area() as f64 }
    }

    /// Integral of cost over pixels.
    fn integral(&self, rect: &Rect) -> f64 {
        assert!(self.surveyed.encloses(rect), "{rect} is not in the surveyed picture {}", self.surveyed);
        let pixels_per_cell = self.surveyed.area() as f64 / (f64::from(self.width) * f64::from(self.height));
        let cells =
            self.sum_before(rect.x1, rect.y1) - self.sum_before(rect.x0, rect.y1) - self.sum_before(rect.x1, rect.y0)
                + self.sum_before(rect.x0, rect.y0);
        cells * pixels_per_cell
    }

    /// Sum of all that lies above and left of a pixel's corner, in cells. The integral of a function that is constant
    /// in each cell is bilinear in each cell, so interpolation is exact.
    fn sum_before(&self, x: u32, y: u32) -> f64 {
        let (column, u) = cell_of(x - self.surveyed.x0, self.surveyed.width(), self.width);
        let (row, v) = cell_of(y - self.surveyed.y0, self.surveyed.height(), self.height);
        let stride = self.width as usize + 1;
        let at = |column: usize, row: usize| self.sums[row * stride + column];
        let (next_column, next_row) = ((column + 1).min(self.width as usize), (row + 1).min(self.height as usize));
        let above = at(column, row) * (1.0 - u) + at(next_column, row) * u;
        let below = at(column, next_row) * (1.0 - u) + at(next_column, next_row) * u;
        above * (1.0 - v) + below * v
    }
}

/// The cell in which a pixel's edge lies, and how far in it, 0..1.
fn cell_of(offset: u32, pixels: u32, cells: u32) -> (usize, f64) {
    // Exact in integers, so that an edge of a cell is never missed by rounding.
    let scaled = u64::from(offset) * u64::from(cells);
    let cell = scaled / u64::from(pixels);
    (cell as usize, (scaled % u64::from(pixels)) as f64 / f64::from(pixels))
}

fn sane(value: f32) -> f32 {
    if value.is_finite() && value > 0.0 { value.min(1e9) } else { 0.0 }
}

fn summed(width: u32, height: u32, values: &[f32]) -> Vec<f64> {
    let (width, height) = (width as usize, height as usize);
    let stride = width + 1;
    let mut sums = vec![0.0; stride * (height + 1)];
    for y in 0..height {
        let mut row = 0.0;
        for x in 0..width {
            row += f64::from(values[y * width + x]);
            sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
        }
    }
    sums
}

/// A value of each cell, averaged with its neighbours by the weights 1 2 1 in both directions: a survey of few samples
/// a cell is noisy, and costs of neighbouring pixels are alike.
fn smoothed(survey: &Survey, value: impl Fn(&SurveyPixel) -> f32) -> Vec<f32> {
    let (width, height) = (survey.width as usize, survey.height as usize);
    let values: Vec<f32> = survey.pixels.iter().map(value).collect();
    let blurred_x: Vec<f32> = (0..values.len())
        .map(|i| {
            let (x, row) = (i % width, i - i % width);
            0.25 * values[row + x.saturating_sub(1)] + 0.5 * values[i] + 0.25 * values[row + (x + 1).min(width - 1)]
        })
        .collect();
    (0..values.len())
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let above = blurred_x[y.saturating_sub(1) * width + x];
            let below = blurred_x[(y + 1).min(height - 1) * width + x];
            0.25 * above + 0.5 * blurred_x[i] + 0.25 * below
        })
        .collect()
}

/// How much an error would be seen: half relative noise (what a sample still has to remove), half contrast of a cell
/// to its surroundings (where the eye goes: centre against surround, in the manner of Itti, Koch and Niebur 1998).
fn visual_importance(survey: &Survey) -> Vec<f32> {
    let luminance = |pixel: &SurveyPixel| {
        let [r, g, b] = pixel.color;
        0.2126 * sane(r) + 0.7152 * sane(g) + 0.0722 * sane(b)
    };
    let surround = smoothed(survey, luminance);
    let mean = surround.iter().map(|&value| f64::from(value)).sum::<f64>() / surround.len() as f64;
    let dark = (mean as f32 * DARK).max(f32::MIN_POSITIVE);
    let channel = |value: f32, around: f32| value / (value + around + dark);
    survey
        .pixels
        .iter()
        .zip(&surround)
        .map(|(pixel, &around)| {
            let noise = channel(sane(pixel.noise), around);
            let contrast = channel((luminance(pixel) - around).abs(), around);
            NOISE_WEIGHT * noise + (1.0 - NOISE_WEIGHT) * contrast
        })
        .collect()
}

#[cfg(test)]
mod tests {
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
        Survey { width, height, pixels }
    }

    #[test]
    fn the_paper_counts_recursion_levels_and_shows_simple_as_dark() {
        let survey = survey_of(2, 1, |x, _| if x == 0 { 0.0 } else { 3.0 });
        let frame = Rect::of_size(200, 100);
        let map = ImportanceMap::new(&survey, frame, frame, ImportanceFunction::Paper).unwrap();
        assert_eq!(map.grey(), [0.0, 1.0]);
        let (left, right) = (Rect::new(0, 0, 100, 100), Rect::new(100, 0, 200, 100));
        assert!((map.complexity(&right) / map.complexity(&left) - 4.0).abs() < 1e-5);
        assert!((map.density(&frame) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_pixel_smaller_than_a_cell_takes_its_part_of_it() {
        let survey = survey_of(1, 1, |_, _| 1.0);
        let surveyed = Rect::of_size(64, 64);
        let map = ImportanceMap::new(&survey, surveyed, surveyed, ImportanceFunction::PredictedCost).unwrap();
        assert!((map.complexity(&Rect::new(3, 9, 4, 10)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn values_that_are_no_numbers_are_not_believed() {
        let survey = survey_of(3, 3, |x, _| [f32::NAN, f32::INFINITY, -4.0][x as usize]);
        let frame = Rect::of_size(9, 9);
        for function in [ImportanceFunction::Paper, ImportanceFunction::PredictedCost] {
            let map = ImportanceMap::new(&survey, frame, frame, function).unwrap();
            assert!(map.cost().iter().all(|cost| cost.is_finite() && *cost > 0.0));
            assert!(map.importance().iter().all(|value| (0.0..=1.0).contains(value)));
        }
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
            let map = ImportanceMap::new(&survey, frame, frame, ImportanceFunction::PredictedCost).unwrap();
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
