//! Colour spaces of the RGB values in scene files.

use bottega_image::adaptation;
use glam::{DMat3, DVec3};

use super::role::ColorRole;
use super::sampled::SampledSpectrum;
use crate::color::Spectrum;

/// The colour space of `rgb` values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ColorSpace {
    /// Rec. 709 primaries, as in our scenes.
    #[default]
    Srgb,
    /// DCI-P3 with the white D65.
    DciP3,
    /// ITU-R BT.2020 with the white D65.
    Rec2020,
    /// ACES2065-1, whose white is D60.
    Aces,
}

impl ColorSpace {
    /// Returns the colour space with a name in pbrt files; `None`: the name is unknown.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "srgb" => Self::Srgb,
            "dci-p3" => Self::DciP3,
            "rec2020" => Self::Rec2020,
            "aces2065-1" => Self::Aces,
            _ => return None,
        })
    }

    /// Converts linear values in this space to linear Rec. 709; values out of gamut become 0.
    pub(crate) fn to_rec709(self, rgb: DVec3, role: ColorRole) -> Spectrum {
        if self == Self::Srgb {
            return rgb.as_vec3();
        }
        let mut xyz = self.xyz_from_rgb() * rgb;
        if role != ColorRole::Emission {
            xyz = adaptation(self.white(), Self::Srgb.white()) * xyz;
        }
        (Self::Srgb.xyz_from_rgb().inverse() * xyz).max(DVec3::ZERO).as_vec3()
    }

    /// Returns the chromaticities of red, green, blue and white.
    fn chromaticities(self) -> [(f64, f64); 4] {
        const D65: (f64, f64) = (0.3127, 0.329);
        match self {
            Self::Srgb => [(0.64, 0.33), (0.3, 0.6), (0.15, 0.06), D65],
            Self::DciP3 => [(0.68, 0.32), (0.265, 0.69), (0.15, 0.06), D65],
            Self::Rec2020 => [(0.708, 0.292), (0.17, 0.797), (0.131, 0.046), D65],
            Self::Aces => [(0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.077), (0.321_68, 0.337_67)],
        }
    }

    fn white(self) -> DVec3 {
        xyz_of(self.chromaticities()[3])
    }

    fn xyz_from_rgb(self) -> DMat3 {
        let [red, green, blue, white] = self.chromaticities().map(xyz_of);
        let primaries = DMat3::from_cols(red, green, blue);
        primaries * DMat3::from_diagonal(primaries.inverse() * white)
    }
}

/// Returns the tristimulus values of a chromaticity with Y = 1, also for a virtual primary with negative y.
fn xyz_of((x, y): (f64, f64)) -> DVec3 {
    if y == 0.0 { DVec3::new(x, 0.0, 1.0 - x) } else { DVec3::new(x / y, 1.0, (1.0 - x - y) / y) }
}

/// Returns the white balance, in Rec. 709, that makes a colour temperature of 1000 K or more white: daylight, or a
/// black body below 4000 K.
pub(crate) fn white_balance(kelvin: f64) -> DMat3 {
    let rgb_from_xyz = ColorSpace::Srgb.xyz_from_rgb().inverse();
    rgb_from_xyz * adaptation(xyz_of(illuminant(kelvin)), ColorSpace::Srgb.white()) * rgb_from_xyz.inverse()
}

/// Returns the chromaticity of daylight (CIE 015:2018, equations 4.1 and 4.2) or of a black body, with the correction
/// of 1968 for c₂.
fn illuminant(kelvin: f64) -> (f64, f64) {
    let t = kelvin * 1.4388 / 1.4380;
    if t < 4000.0 {
        return SampledSpectrum::blackbody(t).chromaticity();
    }
    let x = if t <= 7000.0 {
        -4.607e9 / (t * t * t) + 2.9678e6 / (t * t) + 0.09911e3 / t + 0.244_063
    } else {
        -2.0064e9 / (t * t * t) + 1.9018e6 / (t * t) + 0.24748e3 / t + 0.237_040
    };
    (x, -3.0 * x * x + 2.87 * x - 0.275)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_stays_white_where_it_reflects() {
        for space in [ColorSpace::Srgb, ColorSpace::DciP3, ColorSpace::Rec2020, ColorSpace::Aces] {
            let white = space.to_rec709(DVec3::ONE, ColorRole::Reflectance);
            assert!((white - Spectrum::ONE).abs().max_element() < 1e-3, "{space:?}: {white}");
        }
        // D60 is warmer than D65.
        let light = ColorSpace::Aces.to_rec709(DVec3::ONE, ColorRole::Emission);
        assert!(light.x > 1.02 && light.z < 0.96, "{light}");
    }

    #[test]
    fn the_green_of_rec_2020_is_out_of_our_gamut_and_its_gray_is_not() {
        let green = ColorSpace::Rec2020.to_rec709(DVec3::Y, ColorRole::Reflectance);
        assert_eq!((green.x, green.z), (0.0, 0.0));
        assert!((green.y - 1.1329).abs() < 1e-3, "{green}");
        let gray = ColorSpace::Rec2020.to_rec709(DVec3::splat(0.3), ColorRole::Emission);
        assert!((gray - Spectrum::splat(0.3)).abs().max_element() < 1e-3);
    }

    #[test]
    fn white_balance_turns_its_illuminant_white() {
        // CIE 015:2018: D50, D65 and, a black body, A.
        for (kelvin, x, y) in [(5000.0, 0.3457, 0.3585), (6500.0, 0.3127, 0.3290), (2854.0, 0.4476, 0.4074)] {
            let (dx, dy) = illuminant(kelvin);
            assert!((dx - x).abs() < 3e-4 && (dy - y).abs() < 3e-4, "{kelvin}: {dx} {dy}");
            let light = ColorSpace::Srgb.xyz_from_rgb().inverse() * xyz_of((dx, dy));
            let balanced = white_balance(kelvin) * light;
            assert!((balanced - DVec3::ONE).abs().max_element() < 1e-9, "{kelvin}: {balanced}");
        }
    }
}
