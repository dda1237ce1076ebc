//! The visibility of lights as agents answer it: the shadow half of the oracle (§4.4).

use std::collections::BTreeMap;

use glam::Vec3;

use super::{network::Network, swarm::Swarm};
use crate::photon::{
    Photon, PhotonMap,
    bytes::{Reader, Writer},
    is_alike,
};

/// What an agent answers who is asked whether a shadow ray is to be traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ShadowVerdict {
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
    /// How far each one's word goes, by number in the map.
    reach: Vec<f32>,
    /// The lights of which somebody answers something else than "trace", in the order of their numbers, and how far such words go
    /// at most. Where a light is not among them nobody needs to be looked for.
    answered: Vec<(u32, f32)>,
}

impl Visibility {
    /// - `answers`: by index of the agent.
    pub(super) fn new(swarm: &Swarm, network: &Network, answers: &[ShadowVerdict]) -> Self {
        let numbers = 0..swarm.len() as u32;
        let reach: Vec<f32> = numbers.map(|number| network.reach(swarm.by_number(number).0)).collect();
        let tag = |index: u32| swarm.agents[index as usize].light << 2 | answers[index as usize] as u32;
        Self::of(swarm.tree.clone().retagged(tag), reach)
    }

    fn of(places: PhotonMap, reach: Vec<f32>) -> Self {
        let mut farthest: BTreeMap<u32, f32> = BTreeMap::new();
        for (photon, &reach) in places.iter().zip(&reach) {
            let tag = photon.mark().tag();
            if tag & ANSWER != ShadowVerdict::Trace as u32 {
                let most = farthest.entry(tag >> 2).or_default();
                *most = most.max(reach);
            }
        }
        Self { places, reach, answered: farthest.into_iter().collect() }
    }

    /// Whether a light is seen; `None`: nobody knows.
    ///
    /// - `normal`: of the surface, on the side that is asked for.
    #[inline(always)]
    pub(super) fn at(&self, p: Vec3, normal: Vec3, light: u32) -> Option<bool> {
        let place = self.answered.binary_search_by_key(&light, |&(light, _)| light).ok()?;
        let farthest = self.answered[place].1;
        let accept = |number: u32| {
            let mark = self.places.mark(number);
            mark.tag() >> 2 == light && is_alike(mark.normal(), normal)
        };
        let number = self.places.nearest_where(p, farthest * farthest, accept)?;
        let reach = self.reach[number as usize];
        if self.places.photon(number).p.distance_squared(p) > reach * reach {
            return None;
        }
        match self.places.mark(number).tag() & ANSWER {
            tag if tag == ShadowVerdict::Lit as u32 => Some(true),
            tag if tag == ShadowVerdict::Shaded as u32 => Some(false),
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
        Some(Self::of(places, reach))
    }

    /// Where the agents are.
    pub(super) fn places(&self) -> &PhotonMap {
        &self.places
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.places.memory_bytes() + size_of_val(&*self.reach) + size_of_val(&*self.answered)
    }

    /// How much of its light arrives at one of [`places`](Self::places), as it answers: 1 where it is lit, 0 where it is shaded,
    /// and a half in between.
    pub(super) fn lit_share(agent: &Photon) -> f32 {
        match agent.mark().tag() & ANSWER {
            tag if tag == ShadowVerdict::Lit as u32 => 1.0,
            tag if tag == ShadowVerdict::Shaded as u32 => 0.0,
            _ => 0.5,
        }
    }
}
