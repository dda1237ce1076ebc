//! The luminous intensity of a lamp by direction.

use super::planes::HalfPlane;

/// The luminous intensity of a lamp for each direction, in candela.
///
/// A direction has a vertical angle, from 0° straight down to 180° straight up, and a horizontal angle from 0° to 360°
/// (photometry of type C). Other types are converted.
#[derive(Clone, Debug, PartialEq)]
pub struct IesProfile {
    /// Vertical angles in degrees, ascending.
    vertical: Vec<f64>,
    /// Horizontal angles in degrees, ascending from 0 to 360.
    horizontal: Vec<f64>,
    /// Intensities in candela: one column of vertical angles after another.
    candela: Vec<f64>,
    /// Luminous flux of the bare lamps in lumens; `None`: the intensities are absolute.
    lamp_lumens: Option<f64>,
}

impl IesProfile {
    /// Makes a profile of a table.
    ///
    /// - `candela`: one column of vertical angles after another.
    pub(super) fn new(vertical: Vec<f64>, planes: &[HalfPlane], table: &[f64], lamp_lumens: Option<f64>) -> Self {
        let count = vertical.len();
        let column = |plane: &HalfPlane| table[plane.column * count..][..count].iter().copied();
        let candela = planes.iter().flat_map(column).collect();
        Self { vertical, horizontal: planes.iter().map(|plane| plane.angle).collect(), candela, lamp_lumens }
    }

    /// Returns the vertical angles of the table, in degrees.
    pub(super) fn vertical(&self) -> &[f64] {
        &self.vertical
    }

    /// Returns the horizontal angles of the table, in degrees.
    pub(super) fn horizontal(&self) -> &[f64] {
        &self.horizontal
    }

    /// Returns a value of the table by the numbers of its horizontal and vertical angle.
    pub(super) fn at(&self, horizontal: usize, vertical: usize) -> f64 {
        self.candela[horizontal * self.vertical.len() + vertical]
    }

    /// Returns the luminous flux of the bare lamps, in lumens; `None`: the file gives absolute intensities.
    pub fn lamp_lumens(&self) -> Option<f64> {
        self.lamp_lumens
    }

    /// Returns the greatest intensity, in candela.
    pub fn peak(&self) -> f64 {
        self.candela.iter().copied().fold(0.0, f64::max)
    }

    /// Returns true if the intensity is the same at all horizontal angles.
    pub fn is_round(&self) -> bool {
        let (first, others) = self.candela.split_at(self.vertical.len());
        others.chunks_exact(self.vertical.len()).all(|column| column == first)
    }

    /// Returns true if the table covers more than a hemisphere.
    pub(crate) fn covers_sphere(&self) -> bool {
        self.vertical[self.vertical.len() - 1] - self.vertical[0] > 95.0
    }

    /// Returns the intensity of a direction, in candela, linear between the angles of the table; 0 beyond them.
    ///
    /// - `vertical`, `horizontal`: in degrees.
    pub fn candela(&self, vertical: f64, horizontal: f64) -> f64 {
        let Some((v, v_share)) = cell(&self.vertical, vertical) else { return 0.0 };
        let Some((h, h_share)) = cell(&self.horizontal, horizontal.rem_euclid(360.0)) else { return 0.0 };
        let column = |h: usize| self.at(h, v) + v_share * (self.at(h, v + 1) - self.at(h, v));
        let first = column(h);
        first + h_share * (column(h + 1) - first)
    }

    /// Returns the luminous flux of the profile in lumens: the integral of the intensity over all directions.
    pub fn lumens(&self) -> f64 {
        // Between two vertical angles the intensity is linear in the angle θ: ∫ (a + b θ) sin θ dθ
        let between = |low: f64, high: f64, from: f64, to: f64| {
            let slope = (to - from) / (high - low);
            let whole = |angle: f64, value: f64| slope * angle.sin() - value * angle.cos();
            whole(high, to) - whole(low, from)
        };
        let column = |h: usize| {
            let pairs = self.vertical.windows(2).zip(0..);
            let part = |(pair, v): (&[f64], usize)| {
                between(pair[0].to_radians(), pair[1].to_radians(), self.at(h, v), self.at(h, v + 1))
            };
            pairs.map(part).sum::<f64>()
        };
        let columns: Vec<f64> = (0..self.horizontal.len()).map(column).collect();
        let steps = self.horizontal.windows(2).zip(columns.windows(2));
        steps.map(|(angles, sums)| 0.5 * (sums[0] + sums[1]) * (angles[1] - angles[0]).to_radians()).sum()
    }
}

/// Returns the number of the interval in which an angle lies, and its share of the interval; `None`: in none.
pub(super) fn cell(angles: &[f64], angle: f64) -> Option<(usize, f64)> {
    // Within the rounding of angles in degrees
    const SLACK: f64 = 1e-9;
    let last = angles.len() - 1;
    if !(angles[0] - SLACK..=angles[last] + SLACK).contains(&angle) {
        return None;
    }
    let index = angles.partition_point(|&one| one <= angle).clamp(1, last) - 1;
    let share = (angle - angles[index]) / (angles[index + 1] - angles[index]);
    Some((index, share.clamp(0.0, 1.0)))
}
