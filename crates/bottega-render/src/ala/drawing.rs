//! A drawing of the proximity network over a view.

use rayon::prelude::*;

use super::ludd::{Dot, first_place};
use crate::{
    error::RenderError,
    integrator::{PathIntegrator, PhotonIntegrator},
    prepare::PreparedScene,
    prepass::Prepass,
    settings::{AgentSettings, PathSettings, PhotonSettings, View},
};

/// Half the width of a link, as a share of the visible radius.
const WIDTH: f32 = 0.0015;

/// Draws the agents of a picture and their links, at what the camera sees in the middle of each pixel. Returns one dot
/// per pixel, row-major; the value of a dot is 1 where the network answers "lit", 0.25 "shaded", 0.6 "trace a shadow
/// ray".
///
/// - `prepass`: belongs to `scene`; the agents are cast into it if it has none.
/// - `settings`: with the settings of photons and agents; defaults take the place of missing ones.
///
/// # Errors
/// [`RenderError::EmptyPicture`], [`RenderError::PhotonsInMedia`].
pub fn network_dots(
    scene: &PreparedScene,
    prepass: &Prepass,
    view: &View,
    settings: &PathSettings,
) -> Result<Vec<Dot>, RenderError> {
    let photons = settings.photons.unwrap_or_default();
    let agents = AgentSettings { asks_network: true, ..photons.agents.unwrap_or_default() };
    let photons = PhotonSettings { agents: Some(agents), ..photons };
    let settings = PathSettings { photons: Some(photons), ..*settings };
    PhotonIntegrator::new(scene, prepass, view, &settings, photons)?.cast(0..1);
    let passes = prepass.passes(scene, view, photons, settings.seed, 1);
    let width = WIDTH * prepass.photon_plan(scene, view).extent().radius;
    let camera = PathIntegrator::unguided(scene, view, &settings)?;
    let dot = |index: u32| {
        let place = first_place(scene, &camera, index % view.width, index / view.width);
        place.map_or(Dot::Nothing, |p| {
            passes.known_agents().and_then(|agents| agents.network_at(p, width)).map_or(Dot::Free, Dot::Sample)
        })
    };
    let all = 0..view.width * view.height;
    Ok(scene.on_threads(|| all.into_par_iter().map(dot).collect()))
}
