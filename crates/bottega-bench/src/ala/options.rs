//! The options of the comparison: scenes, and numbers of photons and agents.

use std::path::PathBuf;

/// A scene with a converged picture of it.
#[derive(Clone, Debug)]
pub struct AlaScene {
    /// The scene.
    pub scene: PathBuf,
    /// The picture; those that are painted take their size of it.
    pub reference: PathBuf,
}

/// The scene of the measurement, and its numbers of photons and agents.
#[derive(Clone, Debug)]
pub struct AlaOptions {
    /// The scene.
    pub scene: PathBuf,
    /// A converged picture of the scene, of which the pictures take their size; `None`: one is painted first.
    pub reference: Option<PathBuf>,
    /// Other scenes in which agents are compared with photon mapping.
    pub elsewhere: Vec<AlaScene>,
    /// Sides of a reference that is painted, as a share of the paper's 1600 × 1200.
    pub scale: f64,
    /// Samples a pixel of a reference that is painted.
    pub reference_spp: u32,
    /// Most samples a pixel; errors are measured at 1, 2, 4 and so on.
    pub spp: u32,
    /// Photons of the paper's comparison.
    pub photons: u32,
    /// Lighting agents of the paper's comparison.
    pub lighting_agents: u32,
    /// Threads that paint.
    pub threads: usize,
    /// Folder for `ala.json`, `ala.svg`, and the pictures.
    pub output: Option<PathBuf>,
}

/// A part of so many.
pub(super) fn part(whole: u32, share: f64) -> u32 {
    ((f64::from(whole) * share) as u32).max(1)
}
