//! Real scenes, as their formats have them, against the converged pictures that independent renderers made of them: pixel by pixel
//! by a z-test with the variance of both sides, and by the mean of the whole. Scenes and references lie in the folder
//! that `BOTTEGA_SCENES` names; without it nothing is tested, and the tests say so.
//!
//! A test that fails leaves what was painted, the reference and the difference in `target/pictures`.

mod compare;
mod paint;

use std::path::PathBuf;

use compare::Comparison;

/// One scene and its reference.
struct Case {
    /// In the folder of scenes.
    scene: &'static str,
    /// In the folder of scenes.
    reference: &'static str,
    /// Pixels of the reference that make one of ours, along each axis.
    shrink: u32,
    /// Samples of each of ours.
    samples: u32,
    /// How far the mean of the whole may be off.
    mean_margin: f64,
    /// Share of pixels that the z-test may reject. The tests of Mitsuba accept 0.0025.
    rejected_max: f64,
}

impl Case {
    /// What scenes are held to where nothing speaks against it.
    const fn new(scene: &'static str, reference: &'static str, shrink: u32, samples: u32) -> Self {
        Self { scene, reference, shrink, samples, mean_margin: 0.005, rejected_max: 0.0025 }
    }

    fn check(&self) {
        let Some(folder) = std::env::var_os("BOTTEGA_SCENES").map(PathBuf::from) else {
            eprintln!("skipped {}: set BOTTEGA_SCENES to the folder of the scenes", self.scene);
            return;
        };
        let reference = bottega_image::read_picture(folder.join(self.reference)).expect("a reference picture");
        let painted = paint::paint(&folder.join(self.scene), reference.size(), self.shrink, self.samples);
        let comparison = Comparison::new(&painted, &reference, self.shrink);
        println!("{}: {comparison}", self.scene);
        if let Err(problem) = comparison.judge(self.mean_margin, self.rejected_max) {
            let kept = comparison.keep(&self.scene.replace(['/', '.'], "-"));
            panic!("{}: {problem}; {comparison}; see {kept}", self.scene);
        }
    }
}

#[test]
fn a_cornell_box_of_mitsuba_as_mitsuba_paints_it() {
    Case::new("cornell-box/mitsuba/scene_v3.xml", "cornell-box/reference/Mitsuba3.exr", 8, 128).check();
}

#[test]
fn a_cornell_box_of_pbrt_as_tungsten_paints_it() {
    Case::new("cornell-box/pbrt/scene-v4.pbrt", "cornell-box/reference/TungstenRender.exr", 8, 128).check();
}
