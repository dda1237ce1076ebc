//! Scenes by photons against reference pictures by other renderers' path tracers.
//!
//! The samples of one picture share their photons, so pixels are not independent: the z-test by pixel rejects more of
//! them than chance would, and the mean of the whole over several seeds is what counts.

use bottega_image::read_picture;
use bottega_render::PhotonSettings;

use crate::pictures::{
    compare::{Comparison, Estimate},
    paint, scenes_folder,
};

const SCENE: &str = "ala/ala.xml";
const REFERENCE: &str = "ala/reference/Mitsuba3.exr";
/// Number of reference pixels per pixel of the test, along each axis.
const SHRINK: u32 = 8;

fn check(name: &str, samples: u32, photons: PhotonSettings, mean_margin: f64, rejected_max: f64) {
    let Some(folder) = scenes_folder(SCENE) else { return };
    let full = read_picture(folder.join(REFERENCE)).expect("a reference picture");
    let reference = Estimate::of_blocks(&full, SHRINK);
    let size = (full.size().0 / SHRINK, full.size().1 / SHRINK);
    let films = paint::paint_by(&folder.join(SCENE), size, samples, |_| {}, Some(photons));
    Comparison::new(&Estimate::of_films(&films), &reference, |_, _| true).check(name, mean_margin, rejected_max);
}

#[test]
fn gathered_light_of_the_glass_ball() {
    check("ala by final gathering", 96, PhotonSettings { count: 400_000, ..PhotonSettings::default() }, 0.003, 0.05);
}

#[test]
fn progressive_light_of_the_glass_ball() {
    let photons = PhotonSettings { progressive: true, count: 20_000, radius: 0.05, ..PhotonSettings::default() };
    check("ala, progressive", 256, photons, 0.003, 0.05);
}

#[test]
fn cached_light_of_the_glass_ball() {
    let photons = PhotonSettings { count: 200_000, irradiance_cache: 0.15, ..PhotonSettings::default() };
    check("ala by kept irradiance", 64, photons, 0.005, 0.1);
}
