//! The swarm: all agents of a picture, before they deploy sensors.

use super::agent::Agent;
use crate::{
    extent::Extent,
    lights::NO_LIGHT,
    photon::{Nearest, Photon, PhotonMap, is_alike},
    settings::AgentSettings,
};

/// Number of agents that the local density is estimated from.
pub(super) const NEAREST: usize = 16;
/// An agent's neighbourhood reaches to this many agents of its kind.
const NEIGHBORHOOD: usize = 8;

/// Agents in a tree.
#[derive(Debug, Default)]
pub(crate) struct Swarm {
    /// Agents in the order of their identities: by cast, then by clone.
    pub(super) agents: Vec<Agent>,
    /// Positions of all but the camera's agents; the tag is the index.
    pub(super) tree: PhotonMap,
    /// Mean distance between objects: from the light to the first surface, and from surface to surface. Greater than 0.
    pub(super) object_distance: f32,
    /// Number of agents cast per light, without clones.
    pub(super) cast_by_light: f32,
}

impl Swarm {
    /// Builds the tree on the current thread pool.
    ///
    /// - `source_count`: number of sources that cast agents.
    /// - `extent`: extent of the visible part of the scene.
    /// - `of_view`: agents of the camera.
    /// - `agents`: in the order of their identities. Those beyond the memory limit are dropped.
    pub(crate) fn new(
        source_count: usize,
        extent: &Extent,
        of_view: Vec<Agent>,
        agents: Vec<Agent>,
        settings: &AgentSettings,
    ) -> Self {
        let mut agents = [of_view, agents].concat();
        agents.truncate(settings.agents_max());
        let object_distance = object_distance(extent, &agents);
        // The camera's agents must not crowd out the neighbours of others
        let tree = places(&agents, |agent| !agent.is_camera());
        let cast_by_light = settings.cast as f32 / source_count.max(1) as f32;
        Self { agents, tree, object_distance, cast_by_light }
    }

    /// Returns the number of agents, including clones.
    pub(crate) fn len(&self) -> usize {
        self.agents.len()
    }

    /// Returns the positions of some agents; the tag is the index.
    pub(super) fn places_of(&self, is_wanted: impl Fn(&Agent) -> bool) -> PhotonMap {
        places(&self.agents, is_wanted)
    }

    /// Returns index and data of an agent by its number in the tree.
    pub(super) fn by_number(&self, number: u32) -> (u32, &Agent) {
        let index = self.tree.mark(number).tag();
        (index, &self.agents[index as usize])
    }

    /// Returns distance and index of the nearest agents with the same light and a similar normal, in ascending order,
    /// without the agent itself.
    ///
    /// - `found`: buffer for at least [`NEAREST`] agents.
    pub(super) fn neighbors(&self, index: u32, found: &mut Nearest) -> Vec<(f32, u32)> {
        let agent = &self.agents[index as usize];
        self.tree.nearest(agent.p, f32::INFINITY, found);
        let is_neighbor = |other: &Agent| other.light == agent.light && is_alike(other.normal, agent.normal);
        let mut near: Vec<(f32, u32)> = found
            .iter()
            .map(|(number, distance)| (distance, self.by_number(number)))
            .filter(|&(_, (other_index, other))| other_index != index && is_neighbor(other))
            .map(|(distance, (other_index, _))| (distance.sqrt(), other_index))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near
    }

    /// Returns the radius of an agent's neighbourhood, given its neighbours.
    pub(super) fn reach(&self, near: &[(f32, u32)]) -> f32 {
        /// Radius without neighbours, as a share of the mean distance between objects.
        const ALONE: f32 = 0.05;
        let farthest = near.get(NEIGHBORHOOD - 1).or(near.last()).map(|&(distance, _)| distance);
        farthest.filter(|&distance| distance > 0.0).unwrap_or(ALONE * self.object_distance)
    }
}

/// Builds the tree of some agents; the tag is the index.
fn places(agents: &[Agent], is_wanted: impl Fn(&Agent) -> bool) -> PhotonMap {
    let wanted = agents.iter().zip(0..).filter(|(agent, _)| is_wanted(agent));
    let place = |(agent, index): (&Agent, u32)| Photon::tagged(agent.p, agent.to_light, agent.normal, index);
    PhotonMap::new(wanted.map(place).collect())
}

/// Returns the mean distance between objects, from agents on the visible part of the scene: distant ones make it far
/// too large.
fn object_distance(extent: &Extent, agents: &[Agent]) -> f32 {
    let is_near =
        |agent: &&Agent| !agent.is_camera() && (extent.is_whole() || agent.p.distance(extent.center) <= extent.radius);
    // Light from infinity starts at the edge of the scene
    let most = if extent.is_whole() { f32::INFINITY } else { 2.0 * extent.radius };
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for agent in agents.iter().filter(is_near) {
        sum += f64::from(agent.gap.min(most));
        count += 1.0;
    }
    let mean = (sum / count.max(1.0)) as f32;
    if mean > 0.0 && mean.is_finite() { mean } else { f32::MIN_POSITIVE }
}

/// Returns `true` if a light has its own number, so agents can answer for it.
pub(super) fn has_number(light: u32) -> bool {
    light != NO_LIGHT
}
