//! Comparison of lighting agents and photon mapping in scenes other than the paper's.

use std::io::Write;

use bottega_image::read_picture;
use bottega_render::Oracle;

use super::{
    options::{AlaOptions, AlaScene, part},
    ways::{LightMethod, MethodResult, PaintedScene},
};
use crate::{error::Error, files::shared_meshes, report::say};

/// Budgets of our agents, relative to the paper's.
const BUDGETS: [f64; 4] = [1.0, 0.3, 0.2, 0.1];

/// The results of photon mapping with irradiance cache and shadow photons, and of our agents, in one scene.
pub(super) struct ElsewhereResult {
    pub(super) scene: String,
    pub(super) photons: MethodResult,
    /// The results of our agents, one per budget.
    pub(super) agents: Vec<MethodResult>,
}

/// Renders a scene by photons and by agents.
///
/// # Errors
/// The scene cannot be rendered, or the reference cannot be read.
pub(super) fn compare(options: &AlaOptions, other: &AlaScene, log: &mut dyn Write) -> Result<ElsewhereResult, Error> {
    let reference = read_picture(&other.reference)?;
    let hints = bottega_scene::load(&other.scene, &shared_meshes())?.hints;
    let scene = PaintedScene {
        path: &other.scene,
        size: (reference.width, reference.height),
        max_depth: hints.max_depth.unwrap_or(12),
        threads: options.threads(),
    };
    let name = other.scene.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut paint = |way: LightMethod| {
        say(log, format_args!("painting {name}: {} …", way.name));
        scene.paint(way, options.spp, &reference)
    };
    let photons = paint(LightMethod::photons_as_in_the_paper(options.photons))?;
    let of = |share| LightMethod::agents(Oracle::Error, part(options.lighting_agents, share), true);
    let agents = BUDGETS.map(of).into_iter().map(&mut paint).collect::<Result<_, _>>()?;
    Ok(ElsewhereResult { scene: name, photons, agents })
}
