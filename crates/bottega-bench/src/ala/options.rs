//! Options of the comparison: scenes, and numbers of photons and agents.

use std::path::PathBuf;

use clap::Args;

use crate::{
    arguments::{self, SceneFolder, number},
    error::Error,
};

/// The scene of the comparison, relative to the folder of scenes.
const SCENE: &str = "ala/ala.xml";
/// A converged image of that scene.
const REFERENCE: &str = "ala/reference/Mitsuba3.exr";

/// Further scenes with converged images: an interior, and a scene of glass.
const ELSEWHERE: [[&str; 2]; 2] = [
    ["peers/d_interior.xml", "peers/reference/ref_d_interior.exr"],
    ["peers/c_goblets.xml", "peers/reference/ref_c_goblets.exr"],
];

/// The image size for scenes without a reference, relative to the paper's.
const SCALE: f64 = 0.25;

/// The tables and figures of the paper on Autonomous Lighting Agents: photon mapping, its agents, and ours.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Photon mapping, the agents of the paper and our own paint the same scene, with more and more \
    samples; errors are to a path-traced picture. For example:\n  bottega-bench ala --scenes ../scenes -o ala/")]
pub(crate) struct AlaOptions {
    /// The scene. Default: ala/ala.xml in the folder of scenes.
    scene: Option<PathBuf>,
    #[command(flatten)]
    folder: SceneFolder,
    /// A converged picture of the scene, of which the pictures take their size. Default: ala/reference/Mitsuba3.exr in the folder of
    /// scenes for its scene; else one is rendered first.
    #[arg(long, value_name = "FILE.exr")]
    reference: Option<PathBuf>,
    /// Sides of the picture, as a share of the paper's 1600 × 1200; a reference of that size is rendered first.
    #[arg(long, value_name = "S", value_parser = number(0.02, 2.0), conflicts_with = "reference")]
    scale: Option<f64>,
    /// Samples per pixel of a reference that is rendered.
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    pub(super) reference_spp: u32,
    /// Most samples per pixel; errors are measured at 1, 2, 4 and so on.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=1 << 12))]
    pub(super) spp: u32,
    /// Photons of the paper's comparison.
    #[arg(long, value_name = "N", default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    pub(super) photons: u32,
    /// Lighting agents of the paper's comparison.
    #[arg(long, value_name = "N", default_value_t = 50_000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    pub(super) lighting_agents: u32,
    /// Threads. Default: as many as there are processors.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Folder for ala.json, ala.svg, and the pictures.
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: Option<PathBuf>,
}

/// A scene with a converged image of it.
#[derive(Clone, Debug)]
pub(super) struct AlaScene {
    pub(super) scene: PathBuf,
    /// The reference; images compared with it have its size.
    pub(super) reference: PathBuf,
}

impl AlaOptions {
    /// Returns the paper's scene, or the requested one.
    pub(super) fn scene(&self) -> Result<PathBuf, Error> {
        self.folder.scene(self.scene.as_ref(), SCENE)
    }

    /// Returns a converged image of the scene; `None`: one must be rendered first.
    pub(super) fn reference(&self) -> Option<PathBuf> {
        self.reference.clone().or_else(|| self.folder.place(REFERENCE).filter(|_| self.is_as_in_the_paper()))
    }

    /// Returns further scenes in which agents are compared with photon mapping.
    pub(super) fn elsewhere(&self) -> Vec<AlaScene> {
        let scenes = ELSEWHERE.iter().filter(|_| self.is_as_in_the_paper());
        let place = |[scene, reference]: &[&str; 2]| {
            Some(AlaScene { scene: self.folder.place(scene)?, reference: self.folder.place(reference)? })
        };
        scenes.filter_map(place).collect()
    }

    /// Returns the size of a reference that is rendered, relative to the paper's 1600 × 1200.
    pub(super) fn scale(&self) -> f64 {
        self.scale.unwrap_or(SCALE)
    }

    pub(super) fn threads(&self) -> usize {
        arguments::threads(self.threads)
    }

    fn is_as_in_the_paper(&self) -> bool {
        self.scene.is_none() && self.scale.is_none()
    }
}

/// Returns a share of a number, at least 1.
pub(super) fn part(whole: u32, share: f64) -> u32 {
    ((f64::from(whole) * share) as u32).max(1)
}
