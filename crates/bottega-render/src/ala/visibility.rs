//! Whether lights are seen, as agents answer it: the shadow half of the oracle (§4.4).

use glam::Vec3;

use super::{network::Network, swarm::Swarm};
use crate::photon::{
    Photon, PhotonMap,
    bytes::{Reader, Writer},
    is_alike,
};

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

/// The bits of an answer below those of a light.
const ANSWER: u32 = 3;

/// Agents with their answers.
#[derive(Clone, Debug, Default)]
pub(super) struct Visibility {
    /// Where they are; in place of a power light and answer.
    places: PhotonMap,
    /// How far each one's word goes, by number in the map; and the farthest of all.
    reach: Vec<f32>,
    reach_max: f32,
}

impl Visibility {
    /// - `answers`: by index of the agent.
    pub(super) fn new(swarm: &Swarm, network: &Network, answers: &[Answer]) -> Self {
        let numbers = 0..swarm.len() as u32;
        let reach: Vec<f32> = numbers.map(|number| network.reach(swarm.by_number(number).0)).collect();
        let reach_max = reach.iter().fold(0.0, |most: f32, &reach| most.max(reach));
        let tag = |index: u32| swarm.agents[index as usize].light << 2 | answers[index as usize] as u32;
        Self { places: swarm.tree.clone().retagged(tag), reach, reach_max }
    }

    /// Whether a light is seen; `None`: nobody knows.
    ///
    /// - `normal`: of the surface, on the side that is asked for.
    #[inline(always)]
    pub(super) fn at(&self, p: Vec3, normal: Vec3, light: u32) -> Option<bool> {
        let accept = |number: u32| {
            let mark = self.places.mark(number);
            mark.tag() >> 2 == light && is_alike(mark.normal(), normal)
        };
        let number = self.places.nearest_where(p, self.reach_max * self.reach_max, accept)?;
        let reach = self.reach[number as usize];
        if self.places.photon(number).p.distance_squared(p) > reach * reach {
            return None;
        }
        match self.places.mark(number).tag() & ANSWER {
            tag if tag == Answer::Lit as u32 => Some(true),
            tag if tag == Answer::Shaded as u32 => Some(false),
            _ => None,
        }
    }

    pub(super) fn write(&self, to: &mut Writer) {
        to.map(&self.places);
        self.reach.iter().for_each(|&reach| to.value(reach));
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Option<Self> {
        let places = from.map()?;
        let reach = (0..places.len()).map(|_| from.value()).collect::<Option<Vec<_>>>()?;
        let reach_max = reach.iter().fold(0.0, |most: f32, &reach| most.max(reach));
        Some(Self { places, reach, reach_max })
    }

    /// Where the agents are.
    pub(super) fn places(&self) -> &PhotonMap {
        &self.places
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.places.memory_bytes() + size_of_val(&*self.reach)
    }

    /// How much of its light arrives at one of [`places`](Self::places), as it answers: 1 where it is lit, 0 where it is shaded,
    /// and a half in between.
    pub(super) fn lit_share(agent: &Photon) -> f32 {
        match agent.mark().tag() & ANSWER {
            tag if tag == Answer::Lit as u32 => 1.0,
            tag if tag == Answer::Shaded as u32 => 0.0,
            _ => 0.5,
        }
    }
}
