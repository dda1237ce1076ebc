//! All agents of a picture, before they look around.

use super::agent::Agent;
use crate::{
    AgentSettings,
    extent::Extent,
    lights::NO_LIGHT,
    photon::{Nearest, Photon, PhotonMap, is_alike},
};

/// Agents from which the density around a place is estimated.
pub(super) const NEAREST: usize = 16;
/// Of so many agents of its own kind next to it an agent looks after the space between.
const NEIGHBORHOOD: usize = 8;

/// The agents, found by place.
#[derive(Debug, Default)]
pub(crate) struct Swarm {
    /// In the order of their identities: by cast, then by clone.
    pub(super) agents: Vec<Agent>,
    /// Where they are; in place of a power the index.
    pub(super) tree: PhotonMap,
    /// Mean distance between objects: from the light to the first surface, and from one surface to the next. Greater than 0.
    pub(super) object_distance: f32,
    /// Agents cast by each light, without clones.
    pub(super) cast_by_light: f32,
}

impl Swarm {
    /// Builds the tree on the threads of the present pool.
    ///
    /// - `source_count`: how many sources cast them.
    /// - `extent`: of what is seen.
    /// - `agents`: in the order of their identities.
    ///   Those for whom there is no memory are left out.
    pub(crate) fn new(source_count: usize, extent: &Extent, mut agents: Vec<Agent>, settings: &AgentSettings) -> Self {
        agents.truncate(settings.agents_max());
        let object_distance = object_distance(extent, &agents);
        let place = |(agent, index): (&Agent, u32)| Photon::tagged(agent.p, agent.to_light, agent.normal, index);
        let tree = PhotonMap::new(agents.iter().zip(0..).map(place).collect());
        let cast_by_light = settings.cast as f32 / source_count.max(1) as f32;
        Self { agents, tree, object_distance, cast_by_light }
    }

    /// How many there are, clones among them.
    pub(crate) fn len(&self) -> usize {
        self.agents.len()
    }

    /// An agent by its number in the tree.
    pub(super) fn by_number(&self, number: u32) -> (u32, &Agent) {
        let index = self.tree.mark(number).tag();
        (index, &self.agents[index as usize])
    }

    /// The agents nearest to one, of the same light on a surface that faces the same way, the nearest first; it is not
    /// among them.
    ///
    /// - `found`: holds [`NEAREST`] agents or more.
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

    /// How far an agent looks around for shadows: to its neighbors.
    pub(super) fn reach(&self, near: &[(f32, u32)]) -> f32 {
        /// Without neighbors, as a share of the mean distance between objects.
        const ALONE: f32 = 0.05;
        let farthest = near.get(NEIGHBORHOOD - 1).or(near.last()).map(|&(distance, _)| distance);
        farthest.filter(|&distance| distance > 0.0).unwrap_or(ALONE * self.object_distance)
    }
}

/// Mean distance between objects, as agents on what is seen tell it: what lies far off would make it far too great.
fn object_distance(extent: &Extent, agents: &[Agent]) -> f32 {
    let is_near = |agent: &&Agent| extent.is_whole() || agent.p.distance(extent.center) <= extent.radius;
    // Light from infinitely far away begins at the edge of the scene.
    let most = if extent.is_whole() { f32::INFINITY } else { 2.0 * extent.radius };
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for agent in agents.iter().filter(is_near) {
        sum += f64::from(agent.gap.min(most));
        count += 1.0;
    }
    let mean = (sum / count.max(1.0)) as f32;
    if mean > 0.0 && mean.is_finite() { mean } else { f32::MIN_POSITIVE }
}

/// Whether a light is one that agents can tell from others.
pub(super) fn is_told(light: u32) -> bool {
    light != NO_LIGHT
}
