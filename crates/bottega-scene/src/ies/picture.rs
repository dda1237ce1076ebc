//! A profile as a picture by direction.

use super::profile::{IesProfile, cell};
use crate::image::Image;

/// The interpolation between the angles of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IesInterpolation {
    /// Straight lines through the values.
    #[default]
    Linear,
    /// Cubic curves through the values, as Blender's node *IES Texture*.
    Cubic,
}

/// A profile as a picture: the intensity of each direction over [`IesProfile::peak`].
///
/// Its layout is [`EnvironmentMapping::LatitudeLongitudeToPoles`](crate::EnvironmentMapping): the upper row is straight down,
/// the lower one straight up. The horizontal angle grows to the right, from 0° at the left edge.
#[derive(Clone, Debug, PartialEq)]
pub struct IesPicture {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Values from 0 to 1, row by row.
    pub values: Vec<f32>,
}

/// Steps over the vertical angles, from the fewest to the most.
const ROW_STEPS: [usize; 3] = [180, 360, 720];
/// Fewest and most columns of a lamp that is not round.
const COLUMNS: [usize; 2] = [180, 720];
/// Columns between two horizontal angles of a table.
const COLUMNS_BETWEEN: f64 = 8.0;

impl IesPicture {
    /// Converts to an image.
    pub(crate) fn to_image(&self, name: &str) -> Image {
        let texels = self.values.iter().map(|&value| [value; 3]).collect();
        Image::from_linear_rgb(name, self.width, self.height, texels)
    }
}

impl IesProfile {
    /// Returns the profile as a picture.
    pub fn picture(&self, interpolation: IesInterpolation) -> IesPicture {
        // The fewest rows that have all angles of the table among theirs
        let is_among = |steps: usize| {
            let step = 180.0 / steps as f64;
            self.vertical().iter().all(|angle| (angle / step - (angle / step).round()).abs() < 1e-3)
        };
        let is_linear = interpolation == IesInterpolation::Linear;
        let exact = ROW_STEPS.into_iter().find(|&steps| is_linear && is_among(steps));
        self.picture_of(exact.unwrap_or(ROW_STEPS[2]), interpolation, |angle| (angle, 1.0))
    }

    /// Returns the profile as a picture whose rows show other vertical angles, and are dimmed.
    ///
    /// - `of_angle`: from the vertical angle of a direction, in degrees, to that of the profile, and a factor from 0 to 1.
    pub(crate) fn changed_picture(&self, of_angle: impl Fn(f64) -> (f64, f64)) -> IesPicture {
        self.picture_of(ROW_STEPS[2], IesInterpolation::Linear, of_angle)
    }

    fn picture_of(
        &self,
        row_steps: usize,
        interpolation: IesInterpolation,
        of_angle: impl Fn(f64) -> (f64, f64),
    ) -> IesPicture {
        let width = self.columns();
        let scale = self.peak().recip();
        let scale = if scale.is_finite() { scale } else { 0.0 };
        let mut values = Vec::with_capacity(width * (row_steps + 1));
        for row in 0..=row_steps {
            let (vertical, factor) = of_angle(row as f64 * 180.0 / row_steps as f64);
            for column in 0..width {
                let horizontal = (column as f64 + 0.5) * 360.0 / width as f64;
                let candela = match interpolation {
                    IesInterpolation::Linear => self.candela(vertical, horizontal),
                    IesInterpolation::Cubic => self.cubic(vertical, horizontal),
                };
                values.push((candela * factor * scale).max(0.0) as f32);
            }
        }
        IesPicture { width: width as u32, height: row_steps as u32 + 1, values }
    }

    /// Returns the number of columns that show the horizontal angles.
    fn columns(&self) -> usize {
        if self.is_round() {
            return 1;
        }
        let step = self.horizontal().windows(2).map(|pair| pair[1] - pair[0]).fold(360.0, f64::min);
        ((360.0 * COLUMNS_BETWEEN / step.max(1e-3)).ceil() as usize).clamp(COLUMNS[0], COLUMNS[1])
    }

    /// Returns the intensity of a direction, in candela, by cubic curves; 0 beyond the angles of the table.
    fn cubic(&self, vertical: f64, horizontal: f64) -> f64 {
        let (Some((v, v_share)), Some((h, h_share))) =
            (cell(self.vertical(), vertical), cell(self.horizontal(), horizontal.rem_euclid(360.0)))
        else {
            return 0.0;
        };
        let rows = self.vertical().len();
        let low = self.vertical()[0];
        let column = |h: usize| {
            // Below the lower pole the table is as above it, also where the lamp is not symmetric
            let before = match v {
                0 if low < 1e-6 => self.at(h, 1),
                0 => self.at(h, 0),
                v => self.at(h, v - 1),
            };
            let after = match v + 2 {
                next if next < rows => self.at(h, next),
                _ => self.at(h, v + 1),
            };
            catmull_rom([before, self.at(h, v), self.at(h, v + 1), after], v_share)
        };
        // As by Cycles, whose test for a full circle fails by rounding: at 0° and 360° the curve has a kink
        let after = if h + 2 < self.horizontal().len() { h + 2 } else { h };
        catmull_rom([h.saturating_sub(1), h, h + 1, after].map(column), h_share).max(0.0)
    }
}

/// Returns the curve of Catmull and Rom through four values at equal distances, between the second and the third.
fn catmull_rom([a, b, c, d]: [f64; 4], x: f64) -> f64 {
    0.5 * ((d + 3.0 * (b - c) - a) * x * x * x + (2.0 * a - 5.0 * b + 4.0 * c - d) * x * x + (c - a) * x) + b
}
