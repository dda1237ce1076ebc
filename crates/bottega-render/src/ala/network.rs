//! The proximity network: a graph that links each agent to its nearest neighbours (§4.3).

use rayon::prelude::*;

use super::swarm::{NEAREST, Swarm};
use crate::photon::Nearest;

/// Number of neighbours that an agent is linked to.
pub(super) const LINKS: usize = 6;

/// Links by agent index; the nearest neighbour first.
#[derive(Debug, Default)]
pub(crate) struct Network {
    links: Vec<[Option<u32>; LINKS]>,
    /// Radius of each agent's neighbourhood.
    reach: Vec<f32>,
}

impl Network {
    /// Links each agent to its nearest neighbours with the same light and a similar normal, on the current thread pool.
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

    /// Returns the neighbours of an agent.
    pub(super) fn neighbors(&self, index: u32) -> impl Iterator<Item = u32> + '_ {
        self.links[index as usize].iter().flatten().copied()
    }

    /// Returns the radius of an agent's neighbourhood.
    pub(super) fn reach(&self, index: u32) -> f32 {
        self.reach[index as usize]
    }

    /// Returns the number of links.
    pub(super) fn link_count(&self) -> u64 {
        self.links.iter().flatten().flatten().count() as u64
    }
}
