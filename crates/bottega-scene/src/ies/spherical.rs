//! Types A and B: tables by angles around two axes of a goniometer, converted to type C.

use super::planes::HalfPlane;
use super::profile::{IesProfile, cell};

/// Vertical and horizontal steps of the converted table.
const STEPS: [usize; 2] = [180, 144];

/// A table of type A or B.
///
/// The angles 0 and 0 are the axis of the lamp, which becomes straight down of type C. Of type A, the vertical angle is the
/// elevation, and the horizontal one turns around the vertical axis; of type B they change roles.
pub(super) struct Goniometer {
    is_type_a: bool,
    vertical: Vec<f64>,
    horizontal: Vec<f64>,
    /// One column of vertical angles after another.
    candela: Vec<f64>,
}

impl Goniometer {
    /// Makes the table.
    ///
    /// - `kind`: 2: type B; 3: type A.
    pub(super) fn new(
        kind: usize,
        vertical: Vec<f64>,
        horizontal: Vec<f64>,
        candela: Vec<f64>,
    ) -> Result<Self, String> {
        let (first, last) = (horizontal[0], horizontal[horizontal.len() - 1]);
        if horizontal.len() < 2 || !(-90.0..=0.0).contains(&first) || !(0.0..=90.0).contains(&last) {
            let name = if kind == 3 { 'A' } else { 'B' };
            return Err(format!(
                "the horizontal angles of type {name} go from {first}° to {last}°; they must go from −90° or 0° to 90°"
            ));
        }
        Ok(Self { is_type_a: kind == 3, vertical, horizontal, candela })
    }

    /// Returns the intensity of a direction whose axis is +z: x to the side, y up.
    fn along(&self, [x, y, z]: [f64; 3]) -> f64 {
        let elevation = |up: f64| up.clamp(-1.0, 1.0).asin().to_degrees();
        let (v, h) = if self.is_type_a {
            (elevation(y), x.atan2(z).to_degrees())
        } else {
            (y.atan2(z).to_degrees(), elevation(x))
        };
        // A table that begins at 0° is that of one side
        let folded = |angles: &[f64], angle: f64| if angles[0].abs() < 1e-3 { angle.abs() } else { angle };
        let (v, h) = (folded(&self.vertical, v), folded(&self.horizontal, h));
        let (Some((i, v)), Some((j, h))) = (cell(&self.vertical, v), cell(&self.horizontal, h)) else { return 0.0 };
        let count = self.vertical.len();
        let column = |j: usize| {
            let pair = &self.candela[j * count + i..][..2];
            pair[0] + v * (pair[1] - pair[0])
        };
        column(j) + h * (column(j + 1) - column(j))
    }

    /// Converts to type C.
    pub(super) fn profile(&self, lamp_lumens: Option<f64>) -> IesProfile {
        let [rows, columns] = STEPS;
        let vertical: Vec<f64> = (0..=rows).map(|row| row as f64 * 180.0 / rows as f64).collect();
        let angle = |column: usize| column as f64 * 360.0 / columns as f64;
        let planes: Vec<HalfPlane> = (0..=columns).map(|column| HalfPlane { angle: angle(column), column }).collect();
        let mut table = Vec::with_capacity(vertical.len() * planes.len());
        for plane in &planes {
            // 0° and 360° are one
            let (sin_h, cos_h) = (plane.angle % 360.0).to_radians().sin_cos();
            for vertical in &vertical {
                let (sin_v, cos_v) = vertical.to_radians().sin_cos();
                table.push(self.along([sin_v * cos_h, sin_v * sin_h, cos_v]));
            }
        }
        IesProfile::new(vertical, &planes, &table, lamp_lumens)
    }
}
