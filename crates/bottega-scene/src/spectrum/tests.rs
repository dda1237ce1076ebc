//! Against the numbers that Mitsuba 3.9 (variant `scalar_rgb`) prints for the same input, and against definitions.

use std::path::Path;

use glam::Vec3;

use super::file::read_spd;
use super::named::{glass, illuminant, metal, mitsuba_ior};
use super::sampled::{SampledSpectrum, planck, reflectance_weights};
use crate::budget::MemoryBudget;
use crate::color::Spectrum;

fn sampled(samples: &[(f64, f64)]) -> SampledSpectrum {
    SampledSpectrum::new(samples.to_vec()).unwrap()
}

#[track_caller]
fn assert_close(color: Spectrum, expected: [f32; 3], tolerance: f32) {
    assert!((color - Vec3::from_array(expected)).abs().max_element() < tolerance, "{color}, expected {expected:?}");
}

#[test]
fn spectra_of_mitsuba_have_the_colours_it_computes() {
    let flat = sampled(&[(360.0, 1.0), (830.0, 1.0)]);
    assert_close(flat.mitsuba_reflectance(), [0.998985, 0.998874, 0.998802], 2e-5);
    assert_close(flat.mitsuba_radiance(), [1.20488, 0.948228, 0.909267], 2e-5);
    let ramp = sampled(&[(400.0, 0.1), (500.0, 0.2), (600.0, 0.6), (700.0, 0.9)]);
    assert_close(ramp.mitsuba_reflectance(), [0.753468, 0.361815, 0.119093], 2e-5);
    assert_close(ramp.mitsuba_radiance(), [0.872774, 0.34597, 0.102482], 2e-5);
    // Out of gamut.
    let green = sampled(&[(500.0, 0.0), (501.0, 1.0), (549.0, 1.0), (550.0, 0.0)]);
    assert_close(green.mitsuba_reflectance(), [0.0, 0.614518, 0.0], 2e-5);
    assert_close(green.scaled(4.0).mitsuba_unbounded(), [0.0, 4.0 * 0.614518, 0.0], 1e-4);
    assert_close(SampledSpectrum::constant(2.5).mitsuba_radiance(), [3.01198, 2.37073, 2.27229], 1e-3);
}

#[test]
fn metals_are_those_of_mitsuba() {
    let expected = [
        ("Au", [0.143036, 0.375307, 1.44205], [3.983, 2.38556, 1.60336]),
        ("Ag", [0.155276, 0.116728, 0.138388], [4.82835, 3.12222, 2.1469]),
        ("Cu", [0.201005, 0.92375, 1.10222], [3.91326, 2.45305, 2.14209]),
        ("Al", [1.6575, 0.880405, 0.521244], [9.22381, 6.2695, 4.837]),
        ("Cr", [4.36967, 2.91651, 1.6549], [5.20655, 4.23131, 3.7547]),
        ("W", [4.37082, 3.30025, 2.99841], [3.50064, 2.60487, 2.27323]),
        ("Ir", [3.0863, 2.08219, 1.61791], [5.59215, 4.06709, 3.26731]),
        ("a-C", [2.94405, 2.22714, 1.96816], [0.887465, 0.799299, 0.81529]),
        ("VN", [2.8656, 2.11919, 1.94009], [3.03224, 2.05612, 1.61631]),
        ("TiO2", [3.45661, 2.80174, 2.90517], [0.000105265, 0.0, 0.000652887]),
        ("MgO", [2.08958, 1.65072, 1.59488], [0.0, 0.0, 0.0]),
        ("Na_palik", [0.0602694, 0.0561409, 0.0619884], [3.17927, 2.11249, 1.57904]),
        ("none", [0.0; 3], [1.0; 3]),
    ];
    for (name, eta, k) in expected {
        let found = metal(name).unwrap();
        assert_close(found.0, eta, 1e-4);
        assert_close(found.1, k, 1e-4);
    }
    assert!(metal("unobtainium").is_none() && metal("").is_none());
}

#[test]
fn every_named_metal_can_be_read() {
    let names = include_str!("metals.txt").lines().filter(|line| line.starts_with(|c: char| c.is_ascii_alphabetic()));
    let names: Vec<&str> = names.flat_map(|line| line.split(' ')).collect();
    assert!(names.len() > 60);
    for name in names {
        let (eta, k) = metal(name).unwrap();
        assert!(eta.is_finite() && k.is_finite() && eta.max_element() > 0.01, "{name}");
    }
}

#[test]
fn lights_of_pbrt_have_luminance_one() {
    let luminance = |color: Spectrum| color.dot(Vec3::new(0.212_671, 0.715_160, 0.072_169));
    for kelvin in [2000.0, 2856.0, 6500.0, 10_000.0] {
        assert!(
            (luminance(SampledSpectrum::blackbody(kelvin).pbrt_illuminant()) - 1.0).abs() < 1e-4
                || SampledSpectrum::blackbody(kelvin).pbrt_illuminant().min_element() == 0.0
        );
    }
    // The CIE defines A as a black body of 2856 K (with an older constant of Planck's law: 2855.5).
    assert_close(
        SampledSpectrum::blackbody(2855.5).pbrt_illuminant(),
        illuminant("stdillum-A").unwrap().to_array(),
        2e-3,
    );
    assert_close(illuminant("D65").unwrap(), [1.0; 3], 2e-3);
    assert!(illuminant("stdillum-F11").is_some() && illuminant("F13").is_none());
    assert_close(sampled(&[(400.0, 7.0), (700.0, 7.0)]).pbrt_illuminant(), [1.2048, 0.9483, 0.9089], 2e-3);
    assert_eq!(SampledSpectrum::blackbody(0.0).pbrt_illuminant(), Spectrum::ZERO);
    assert_eq!(SampledSpectrum::blackbody(f64::NAN).pbrt_illuminant(), Spectrum::ZERO);
}

#[test]
fn a_reflectance_of_one_is_white_in_pbrt() {
    assert_close(SampledSpectrum::constant(1.0).pbrt_reflectance(), [1.0; 3], 2e-3);
    assert_close(sampled(&[(500.0, 0.25)]).pbrt_reflectance(), [0.25; 3], 1e-3);
}

#[test]
fn plancks_law_has_its_maximum_where_wien_says() {
    let nearby: Vec<f64> = [499.0, 500.0, 501.0].map(|nm| planck(nm, 2.897_771_955e6 / 500.0)).to_vec();
    assert!(nearby[1] > nearby[0] && nearby[1] > nearby[2]);
    // σ T⁴ / π, of which some 45 % lie between 360 and 830 nm for 5800 K.
    let sum: f64 = (100..200_000).map(|nm| planck(f64::from(nm), 5800.0)).sum();
    let expected = 5.670_374_419e-8 * 5800f64.powi(4) / std::f64::consts::PI;
    assert!((sum / expected - 1.0).abs() < 1e-4, "{sum} {expected}");
}

#[test]
fn names_of_glasses_and_media() {
    assert_eq!((glass("glass-BK7"), glass("SF11"), glass("glass-X")), (Some(1.5168), Some(1.78472), None));
    assert_eq!((mitsuba_ior("bk7"), mitsuba_ior("Diamond"), mitsuba_ior("x")), (Some(1.5046), Some(2.419), None));
}

#[test]
fn files_of_spectra_are_checked() {
    let read = |text: &str| read_spd(Path::new("a.spd"), text.as_bytes(), &MemoryBudget::new(1 << 20));
    let spectrum = read("# gold\n400 0.5\n\n500, 1.5 # half\r\n600\t2\n").unwrap();
    assert_eq!((spectrum.at(450.0), spectrum.at(100.0), spectrum.at(900.0)), (1.0, 0.5, 2.0));
    for (text, place) in [
        ("400 1\n 300 1", "line 2, column 2: "),
        ("400 1\n400 1", "line 2, column 1: "),
        ("\n400 nan", "line 2, column 5: "),
        ("400 -1", "line 1, column 5: "),
        ("-400 1", "line 1, column 1: "),
        ("400", "line 1, column 1: "),
        ("400 1 2", "line 1, column 1: "),
        ("a b", "line 1, column 1: "),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.contains(place) && error.contains("a.spd"), "{text}: {error}");
    }
    assert!(read("# nothing").is_err());
}

#[test]
fn weights_of_wavelengths_sum_to_the_color_of_a_reflectance() {
    let values = [0.5, 0.45, 0.3, 0.4, 0.6];
    // Some wavelengths lie outside of the visible range
    for wavelengths in [[400.0, 450.0, 510.0, 610.0, 700.0], [200.0, 440.0, 441.5, 900.0, 1000.0]] {
        let weights = reflectance_weights(&wavelengths).unwrap();
        let sum: glam::DVec3 = weights.iter().zip(values).map(|(weight, value)| *weight * value).sum();
        let samples: Vec<(f64, f64)> = wavelengths.into_iter().zip(values).collect();
        assert_close(sampled(&samples).pbrt_reflectance(), sum.as_vec3().to_array(), 1e-5);
    }
    assert!(reflectance_weights(&[]).is_err() && reflectance_weights(&[500.0, 400.0]).is_err());
}
