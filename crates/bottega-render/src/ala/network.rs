//! The proximity network: a graph in which each agent is linked to those nearest to it (§4.3).

use rayon::prelude::*;

use super::swarm::{NEAREST, Swarm};
use crate::photon::Nearest;

/// Neighbors that an agent is linked to.
pub(super) const LINKS: usize = 6;

/// Who is next to whom, by index of the agent; the nearest first.
#[derive(Debug, Default)]
pub(crate) struct Network {
    links: Vec<[Option<u32>; LINKS]>,
    /// How far each looks around.
    reach: Vec<f32>,
}

impl Network {
    /// Links each agent to its nearest neighbors of the same light whose surfaces face the same way, on the threads of the
    /// present pool.
    pub(super) fn new(swarm: &Swarm) -> Self {
        let links = |found: &mut Nearest, index: u32| {
            let near = swarm.neighbors(index, found);
            let links = std::array::from_fn(|place| near.get(place).map(|&(_, other)| other));
            (links, swarm.reach(&near))
        };
        let all = 0..swarm.len() as u32;
        let (links, reach) = all.into_par_iter().map_init(|| Nearest::new(2 * NEAREST), links).unzip();
        Self { links, reach }
    }

    /// Those next to an agent.
    pub(super) fn neighbors(&self, index: u32) -> impl Iterator<Item = u32> + '_ {
        self.links[index as usize].iter().flatten().copied()
    }

    /// How far an agent looks around.
    pub(super) fn reach(&self, index: u32) -> f32 {
        self.reach[index as usize]
    }

    /// Links in all.
    pub(super) fn link_count(&self) -> u64 {
        self.links.iter().flatten().flatten().count() as u64
    }
}
