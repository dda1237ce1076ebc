//! Agents that the camera casts: they stand where the picture shows a surface, and measure indirect light there to the
//! full accuracy. The others measure what gathering rays need. (§6 proposes to cast in the direction of importance.)

use bottega_kernels::mix64;

use super::agent::{Agent, CAMERA_CLONE};
use crate::{
    lights::NO_LIGHT,
    photon::{Nearest, Photon, PhotonMap, places_seen},
    prepare::PreparedScene,
    settings::{AgentSettings, View},
};

/// Greatest number of agents along a side of the picture, and the least distance between two of them, in pixels.
const SIDE_MAX: u32 = 128;
const PIXELS: u32 = 4;
/// Number of agents that there is memory for, per agent of the camera at most.
const PART: usize = 8;
/// Number of neighbours that an agent's neighbourhood is measured by, and its radius relative to their distance.
const NEIGHBORS: usize = 4;
const REACH: f32 = 2.0;

/// Returns the agents of a view, in an order in which every first part is spread all over the picture.
pub(super) fn agents_of_view(prepared: &PreparedScene, view: &View, settings: &AgentSettings) -> Vec<Agent> {
    let most = (settings.agents_max() / PART).isqrt() as u32;
    let side = (view.width.max(view.height) / PIXELS).min(SIDE_MAX).min(most);
    if !settings.has_scouts() || side == 0 {
        return Vec::new();
    }
    let seen = places_seen(prepared, view, side);
    let tree = PhotonMap::new(seen.iter().map(|it| Photon::tagged(it.p, it.normal, it.normal, 0)).collect());
    let mut found = Nearest::new(NEIGHBORS + 1);
    let mut agents: Vec<(u64, Agent)> = seen
        .iter()
        .zip(0..)
        .filter(|(it, _)| it.is_matte || it.is_glossy)
        .map(|(it, cast)| {
            tree.nearest(it.p, f32::INFINITY, &mut found);
            let reach = REACH * found.iter().map(|(_, squared)| squared).fold(0.0, f32::max).sqrt();
            let agent = Agent {
                p: it.p,
                normal: it.normal,
                to_light: it.wo,
                light: NO_LIGHT,
                distance: 0.0,
                gap: reach,
                cast,
                clone: CAMERA_CLONE,
                is_matte: it.is_matte,
                is_glossy: it.is_glossy,
            };
            (mix64(u64::from(cast)), agent)
        })
        .collect();
    agents.sort_unstable_by_key(|&(key, agent)| (key, agent.cast));
    agents.into_iter().map(|(_, agent)| agent).collect()
}
