//! Conversion between linear Rec. 709 and other primaries.

use glam::{DMat3, DVec2, DVec3, Mat3};

/// The treatment of a file's white point if it is not D65.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum WhitePoint {
    /// Adapted to ours: neutral colors stay neutral, as in OpenEXR's `AcesInputFile`.
    #[default]
    Adapted,
    /// Kept in its chromaticity, as in Mitsuba.
    Absolute,
}

/// Chromaticities (CIE 1931 x and y) of the primaries and white of a color space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chromaticities {
    /// Red, green and blue.
    pub primaries: [DVec2; 3],
    /// White: equal values of the primaries.
    pub white: DVec2,
}

impl Chromaticities {
    /// Rec. 709, the color space of all pictures.
    pub const REC709: Self = Self {
        primaries: [DVec2::new(0.64, 0.33), DVec2::new(0.3, 0.6), DVec2::new(0.15, 0.06)],
        white: DVec2::new(0.3127, 0.329),
    };

    /// Makes chromaticities from eight numbers: x and y of red, green, blue and white.
    pub fn from_numbers(numbers: [f64; 8]) -> Self {
        let [red, green, blue, white] = [0, 2, 4, 6].map(|index| DVec2::new(numbers[index], numbers[index + 1]));
        Self { primaries: [red, green, blue], white }
    }

    /// Returns true if both are equal within the rounding of files.
    fn is_nearly(&self, other: &Self) -> bool {
        let is_near = |a: &DVec2, b: &DVec2| (*a - *b).abs().max_element() < 5e-4;
        is_near(&self.white, &other.white) && self.primaries.iter().zip(&other.primaries).all(|(a, b)| is_near(a, b))
    }

    /// Returns true if the primaries are X, Y and Z themselves.
    fn is_xyz(&self) -> bool {
        self.primaries == [DVec2::X, DVec2::Y, DVec2::ZERO]
    }

    /// Returns the conversion from this space to linear Rec. 709.
    ///
    /// # Errors
    /// The chromaticities are those of no color space; the text says so, for a message about the file.
    pub fn to_rec709(&self, white_point: WhitePoint) -> Result<Conversion, String> {
        if self.is_nearly(&Self::REC709) {
            return Ok(Conversion::NONE);
        }
        let unusable = || "its chromaticities are those of no color space".to_owned();
        let is_plausible = |c: &DVec2| c.is_finite() && c.abs().max_element() <= 10.0;
        if !self.primaries.iter().all(is_plausible) || !is_plausible(&self.white) || self.white.y <= 0.0 {
            return Err(unusable());
        }
        let xyz = self.xyz_from_rgb();
        // XYZ has no white point to adapt.
        let adapted = match white_point {
            WhitePoint::Adapted if !self.is_xyz() => adaptation(xyz_of(self.white), xyz_of(Self::REC709.white)),
            _ => DMat3::IDENTITY,
        };
        let matrix = Self::REC709.xyz_from_rgb().inverse() * adapted * xyz;
        if matrix.is_finite() { Ok(Conversion(Some(matrix.as_mat3()))) } else { Err(unusable()) }
    }

    /// Returns the conversion from linear Rec. 709 to this space, white to white, as its rows; `None`: they are the same.
    pub(crate) fn rows_from_rec709(&self) -> Option<[[f32; 3]; 3]> {
        if self.is_nearly(&Self::REC709) {
            return None;
        }
        let adapted = adaptation(xyz_of(Self::REC709.white), xyz_of(self.white));
        let matrix = self.xyz_from_rgb().inverse() * adapted * Self::REC709.xyz_from_rgb();
        Some(matrix.transpose().as_mat3().to_cols_array_2d())
    }

    fn xyz_from_rgb(&self) -> DMat3 {
        let [red, green, blue] = self.primaries.map(direction_of);
        let primaries = DMat3::from_cols(red, green, blue);
        primaries * DMat3::from_diagonal(primaries.inverse() * xyz_of(self.white))
    }
}

/// A linear map from the colors of a file to linear Rec. 709.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conversion(Option<Mat3>);

impl Conversion {
    /// The identity, which changes no color.
    pub const NONE: Self = Self(None);

    /// Returns the conversion from CIE XYZ, in which D65 is (0.9505, 1, 1.089).
    pub fn from_xyz() -> Self {
        Self(Some(Chromaticities::REC709.xyz_from_rgb().inverse().as_mat3()))
    }

    /// Returns true if the conversion is the identity.
    pub fn is_none(&self) -> bool {
        self.0.is_none()
    }

    /// Converts colors in place.
    pub fn apply<'a>(&self, colors: impl IntoIterator<Item = &'a mut [f32; 3]>) {
        let Some(matrix) = self.0 else { return };
        for color in colors {
            *color = (matrix * glam::Vec3::from_array(*color)).to_array();
        }
    }
}

/// Returns the tristimulus values of a chromaticity up to a factor; primaries may have y = 0.
fn direction_of(c: DVec2) -> DVec3 {
    DVec3::new(c.x, c.y, 1.0 - c.x - c.y)
}

/// Returns the tristimulus values of a chromaticity with Y = 1.
fn xyz_of(c: DVec2) -> DVec3 {
    direction_of(c) / c.y
}

/// Returns the matrix that adapts XYZ colors from one white to another, by von Kries' method in the cone space of
/// Bradford (Lam 1985).
///
/// - `from`, `to`: the whites, in XYZ.
pub fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let cones = DMat3::from_cols(
        DVec3::new(0.8951, -0.7502, 0.0389),
        DVec3::new(0.2664, 1.7135, -0.0685),
        DVec3::new(-0.1614, 0.0367, 1.0296),
    );
    cones.inverse() * DMat3::from_diagonal((cones * to) / (cones * from)) * cones
}

#[cfg(test)]
mod tests {
    use super::*;

    const REC2020: [f64; 8] = [0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329];
    const ACES_CG: [f64; 8] = [0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767];

    fn converted(numbers: [f64; 8], white: WhitePoint, color: [f32; 3]) -> [f32; 3] {
        let mut colors = [color];
        Chromaticities::from_numbers(numbers).to_rec709(white).unwrap().apply(&mut colors);
        colors[0]
    }

    fn is_close(a: [f32; 3], b: [f32; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4)
    }

    #[test]
    fn colors_are_those_that_other_programs_find() {
        // Mitsuba 3.9.1, of files of these chromaticities.
        let rec2020 = converted(REC2020, WhitePoint::Absolute, [1.0, 0.1, 0.1]);
        assert!(is_close(rec2020, [1.594_442, -0.012_096, 0.083_664]), "{rec2020:?}");
        let aces = converted(ACES_CG, WhitePoint::Absolute, [0.2, 0.7, 0.4]);
        assert!(is_close(aces, [-0.108_622, 0.764_593, 0.333_316]), "{aces:?}");
        let white = converted(ACES_CG, WhitePoint::Absolute, [1.0; 3]);
        assert!(is_close(white, [1.047_103, 0.994_543, 0.915_319]), "{white:?}");
        // The matrix from ACEScg that the ACES project publishes, by Bradford's adaptation.
        let red = converted(ACES_CG, WhitePoint::Adapted, [1.0, 0.0, 0.0]);
        assert!(is_close(red, [1.705_05, -0.130_26, -0.024_00]), "{red:?}");
    }

    #[test]
    fn white_stays_white_where_it_is_adapted() {
        for numbers in [REC2020, ACES_CG, [0.64, 0.33, 0.29, 0.6, 0.15, 0.06, 0.3333, 0.3333]] {
            let white = converted(numbers, WhitePoint::Adapted, [2.0; 3]);
            assert!(is_close(white, [2.0; 3]), "{white:?}");
        }
    }

    #[test]
    fn tristimulus_values_are_not_adapted() {
        let xyz = [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0];
        let mut direct = [[0.5; 3]];
        Conversion::from_xyz().apply(&mut direct);
        assert!(is_close(direct[0], [0.6024, 0.4742, 0.4543]), "{direct:?}");
        for white in [WhitePoint::Adapted, WhitePoint::Absolute] {
            assert!(is_close(converted(xyz, white, [0.5; 3]), direct[0]));
        }
    }

    #[test]
    fn our_own_primaries_change_nothing_and_impossible_ones_are_refused() {
        let own = Chromaticities::from_numbers([0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329]);
        assert_eq!(own.to_rec709(WhitePoint::Adapted), Ok(Conversion::NONE));
        for numbers in [[0.0; 8], [f64::NAN; 8], [0.3; 8], [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3, 0.0], [1e30; 8]] {
            assert!(Chromaticities::from_numbers(numbers).to_rec709(WhitePoint::Adapted).is_err(), "{numbers:?}");
        }
    }
}
