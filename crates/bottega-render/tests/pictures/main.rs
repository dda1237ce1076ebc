//! Real scenes, as their formats have them, against the converged pictures that independent renderers made of them: pixel by pixel
//! by a z-test with the variance of both sides, and by the mean of the whole. Scenes and references lie in the folder
//! that `BOTTEGA_SCENES` names; without it nothing is tested, and the tests say so.
//!
//! A test that fails leaves what was painted, the reference and the difference in `target/pictures`.

mod compare;
mod paint;

use std::path::PathBuf;

use compare::Comparison;
use paint::SEEDS;

/// One scene and its reference.
struct Case {
    /// In the folder of scenes.
    scene: &'static str,
    /// In the folder of scenes.
    reference: &'static str,
    /// Pixels of the reference that make one of ours, along each axis.
    shrink: u32,
    /// Samples of each of ours, all seeds together.
    samples: u32,
    /// Where the file and the picture do not mean the same: why, how far the mean of the whole may then be off, and which
    /// share of pixels may differ.
    differs: Option<(&'static str, f64, f64)>,
}

/// How far the mean of the whole may be off.
const MEAN_MARGIN: f64 = 0.005;

/// Share of pixels that the z-test may reject: what the tests of Mitsuba accept.
const REJECTED_MAX: f64 = 0.0025;

impl Case {
    /// What scenes are held to where nothing speaks against it.
    const fn new(scene: &'static str, reference: &'static str, shrink: u32, samples: u32) -> Self {
        Self { scene, reference, shrink, samples, differs: None }
    }

    const fn but(self, why: &'static str, mean_margin: f64, rejected_max: f64) -> Self {
        Self { differs: Some((why, mean_margin, rejected_max)), ..self }
    }

    fn check(&self) {
        let Some(folder) = std::env::var_os("BOTTEGA_SCENES").map(PathBuf::from) else {
            eprintln!("skipped {}: set BOTTEGA_SCENES to the folder of the scenes", self.scene);
            return;
        };
        let reference = bottega_image::read_picture(folder.join(self.reference)).expect("a reference picture");
        let samples = self.samples.div_ceil(SEEDS);
        let painted = paint::paint(&folder.join(self.scene), reference.size(), self.shrink, samples);
        let comparison = Comparison::new(&painted, &reference, self.shrink);
        eprintln!("{}: {comparison}", self.scene);
        let (why, mean_margin, rejected_max) = self.differs.unwrap_or(("", MEAN_MARGIN, REJECTED_MAX));
        if !why.is_empty() {
            eprintln!("{}: held to {mean_margin} and {rejected_max} only, for {why}", self.scene);
        }
        if let Err(problem) = comparison.judge(mean_margin, rejected_max) {
            let kept = comparison.keep(&self.scene.replace(['/', '.'], "-"));
            panic!("{}: {problem}; {comparison}; see {kept}", self.scene);
        }
    }
}

#[test]
fn a_cornell_box_of_mitsuba() {
    Case::new("cornell-box/mitsuba/scene_v3.xml", "cornell-box/reference/Mitsuba3.exr", 8, 64).check();
}

#[test]
fn a_cornell_box_of_pbrt() {
    Case::new("cornell-box/pbrt/scene-v4.pbrt", "cornell-box/reference/TungstenRender.exr", 8, 64).check();
}

#[test]
fn glass_and_a_spherical_light_of_mitsuba() {
    Case::new("ala/ala.xml", "ala/reference/Mitsuba3.exr", 4, 64).check();
}

#[test]
fn glass_and_a_spherical_light_of_pbrt() {
    Case::new("ala/ala.pbrt", "ala/reference/Mitsuba3.exr", 4, 64).check();
}

#[test]
fn glasses_silver_and_plastic_of_mitsuba() {
    let case = Case::new("magarro/magarro.xml", "magarro/reference/Mitsuba3.exr", 4, 64);
    case.but("light through glass, whose noise is skewed", 0.005, 0.01).check();
}

#[test]
fn glasses_silver_and_a_coat_of_pbrt() {
    let case = Case::new("magarro/magarro.pbrt", "magarro/reference/Mitsuba3.exr", 4, 64);
    case.but("pbrt's coat is darker than Mitsuba's plastic", 0.05, 0.2).check();
}

#[test]
fn rough_metals_and_spherical_lights_of_mitsuba() {
    let case = Case::new("veach-mis/mitsuba/scene_v3.xml", "veach-mis/reference/TungstenRender.exr", 8, 512);
    case.but("the edges of bright lamps, which the reference's filter blurs", 0.01, 0.03).check();
}

#[test]
fn a_bright_small_lamp_of_mitsuba() {
    let case = Case::new("veach-bidir/mitsuba/scene_v3.xml", "veach-bidir/reference/TungstenRender.exr", 8, 256);
    case.but("caustics that paths find rarely, and Mitsuba's own mean, which is 0.9 % off", 0.04, 0.03).check();
}

#[test]
fn coats_and_textures_of_pbrt() {
    let case = Case::new("staircase2/pbrt/scene-v4.pbrt", "staircase2/reference/TungstenRender.exr", 8, 64);
    case.but("pbrt's coat is not quite Tungsten's plastic", 0.03, 0.15).check();
}

#[test]
fn a_coffee_maker_of_pbrt() {
    let case = Case::new("coffee/pbrt/scene-v4.pbrt", "coffee/reference/TungstenRender.exr", 8, 64);
    case.but("pbrt's coat is not quite Tungsten's plastic", 0.08, 1.0).check();
}
