//! Spectra by name: metals, glasses, illuminants.

use glam::DVec3;

use super::sampled::{SampledSpectrum, rgb};
use crate::color::Spectrum;

/// Returns index of refraction and absorption of a metal, per colour, as in Mitsuba 3's variants `*_rgb`. `None`: the
/// name is unknown.
///
/// - `name`: as in Mitsuba's `material` ("Au"), or the part between "metal-" and "-eta" in pbrt-v4.
pub(crate) fn metal(name: &str) -> Option<(Spectrum, Spectrum)> {
    // Mitsuba's name for a perfect mirror.
    if name == "none" {
        return Some((Spectrum::ZERO, Spectrum::ONE));
    }
    let (eta, k) = metal_spectra(name)?;
    Some((eta.mitsuba_radiance(), k.mitsuba_radiance()))
}

/// Returns the measured n and k of a metal; `None`: the name is unknown.
pub(crate) fn metal_spectra(name: &str) -> Option<(SampledSpectrum, SampledSpectrum)> {
    let (mut eta, mut k) = (Vec::new(), Vec::new());
    let mut is_found = false;
    for line in include_str!("metals.txt").lines().filter(|line| !line.starts_with('#')) {
        if line.starts_with(|first: char| first.is_ascii_alphabetic()) {
            if is_found {
                break;
            }
            is_found = line.split(' ').any(|known| known == name);
        } else if is_found {
            let mut numbers = line.split(' ').map(str::parse::<f64>);
            let (Some(Ok(nm)), Some(Ok(n)), Some(Ok(absorption))) = (numbers.next(), numbers.next(), numbers.next())
            else {
                return None;
            };
            eta.push((nm, n));
            k.push((nm, absorption));
        }
    }
    Some((SampledSpectrum::new(eta).ok()?, SampledSpectrum::new(k).ok()?))
}

/// Returns the index of refraction at 587.6 nm (the yellow helium line, n_d) of pbrt-v4's glasses, from
/// refractiveindex.info. `None`: the name is unknown.
///
/// - `name`: with or without "glass-".
pub(crate) fn glass(name: &str) -> Option<f32> {
    Some(match name.strip_prefix("glass-").unwrap_or(name) {
        "BK7" => 1.5168,
        "BAF10" => 1.67003,
        "FK51A" => 1.48656,
        "LASF9" => 1.85025,
        "F5" | "SF5" => 1.67271,
        "F10" | "SF10" => 1.72828,
        "F11" | "SF11" => 1.78472,
        _ => return None,
    })
}

/// Returns the index of refraction that a name stands for in Mitsuba 3's `int_ior` and `ext_ior`; `None`: the name is
/// unknown.
pub(crate) fn mitsuba_ior(name: &str) -> Option<f32> {
    Some(match name.to_ascii_lowercase().as_str() {
        "vacuum" => 1.0,
        "helium" => 1.000_036,
        "hydrogen" => 1.000_132,
        "air" => 1.000_277,
        "carbon dioxide" => 1.000_45,
        "water" => 1.333,
        "acetone" => 1.36,
        "ethanol" => 1.361,
        "carbon tetrachloride" => 1.461,
        "glycerol" => 1.4729,
        "benzene" => 1.501,
        "silicone oil" => 1.520_45,
        "bromine" => 1.661,
        "water ice" => 1.31,
        "fused quartz" => 1.458,
        "pyrex" => 1.470,
        "acrylic glass" => 1.49,
        "polypropylene" => 1.49,
        "bk7" => 1.5046,
        "sodium chloride" => 1.544,
        "amber" => 1.55,
        "pet" => 1.575,
        "diamond" => 2.419,
        _ => return None,
    })
}

/// Returns the colour, with luminance 1, of a CIE illuminant that pbrt-v4 names. `None`: the name is unknown.
///
/// - `name`: with or without "stdillum-" or, for acesD60, "illum-".
pub(crate) fn illuminant(name: &str) -> Option<Spectrum> {
    // Chromaticities for the 2° observer (CIE 015:2018, tables 5 and 10.1 to 10.3; D60 of ACES: SMPTE ST 2065-1).
    let (x, y) = match name.strip_prefix("stdillum-").or_else(|| name.strip_prefix("illum-")).unwrap_or(name) {
        "A" => (0.447_58, 0.407_45),
        "D50" => (0.345_67, 0.358_51),
        "D55" => (0.332_43, 0.347_44),
        "D65" => (0.312_72, 0.329_03),
        "D75" => (0.299_03, 0.314_88),
        "acesD60" => (0.321_68, 0.337_67),
        "F1" => (0.313_10, 0.337_27),
        "F2" => (0.372_08, 0.375_29),
        "F3" => (0.409_10, 0.394_30),
        "F4" => (0.440_18, 0.403_29),
        "F5" => (0.313_79, 0.345_31),
        "F6" => (0.377_90, 0.388_35),
        "F7" => (0.312_92, 0.329_33),
        "F8" => (0.345_88, 0.358_75),
        "F9" => (0.374_17, 0.372_81),
        "F10" => (0.346_09, 0.359_86),
        "F11" => (0.380_52, 0.377_13),
        "F12" => (0.436_95, 0.404_41),
        _ => return None,
    };
    Some(rgb(DVec3::new(x / y, 1.0, (1.0 - x - y) / y)))
}
