//! The proximity network: a graph in which each agent is linked to those nearest to it (§4.3).

use rayon::prelude::*;

use super::{
    sensing::{Discovery, Response},
    swarm::{NEAREST, Swarm},
};
use crate::photon::Nearest;

/// Neighbors that an agent is linked to.
const LINKS: usize = 6;

/// Who is next to whom, by index of the agent; the nearest first.
#[derive(Debug)]
pub(super) struct Network(Vec<[Option<u32>; LINKS]>);

/// What an agent answers who is asked whether a shadow ray is to be traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// Yes.
    Trace,
    /// No: its light is seen.
    Lit,
    /// No: its light is hidden.
    Shaded,
}

impl Network {
    /// Links each agent to its nearest neighbors of the same light whose surfaces face the same way, on the threads of the
    /// present pool.
    pub(super) fn new(swarm: &Swarm) -> Self {
        let links = |found: &mut Nearest, index: u32| {
            let near = swarm.neighbors(index, found);
            std::array::from_fn(|place| near.get(place).map(|&(_, other)| other))
        };
        let all = 0..swarm.len() as u32;
        Self(all.into_par_iter().map_init(|| Nearest::new(2 * NEAREST), links).collect())
    }

    /// Links in all.
    pub(super) fn link_count(&self) -> u64 {
        self.0.iter().flatten().flatten().count() as u64
    }

    /// What each agent answers: what its own sensors and the median of its neighbors' agree on.
    pub(super) fn answers(&self, discoveries: &[Discovery]) -> Vec<Answer> {
        let answer = |(links, own): (&[Option<u32>; LINKS], &Discovery)| {
            let mut shares: Vec<f32> =
                links.iter().flatten().filter_map(|&other| discoveries[other as usize].shaded_share()).collect();
            shares.sort_by(f32::total_cmp);
            let median = match shares.len() {
                0 => own.shaded_share(),
                count => Some(0.5 * (shares[(count - 1) / 2] + shares[count / 2])),
            };
            match (own.response(), median) {
                (Response::Lit, Some(0.0)) => Answer::Lit,
                (Response::Shaded, Some(1.0)) => Answer::Shaded,
                _ => Answer::Trace,
            }
        };
        self.0.iter().zip(discoveries).map(answer).collect()
    }
}
