//! The visibility of lights, as agents answer it: the shadow half of the oracle (§4.4).

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    network::{LINKS, Network},
    swarm::Swarm,
};
use crate::photon::{
    Photon, PhotonMap,
    bytes::{Reader, Writer},
    is_alike,
};

/// An agent's answer to "should I trace a shadow ray?".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ShadowVerdict {
    /// Yes: the agent does not know.
    Trace,
    /// No: the light is visible.
    Lit,
    /// No: the light is hidden.
    Shaded,
}

/// Bit mask of the answer in a tag; the bits above are the light.
const ANSWER: u32 = 3;

/// Agents with their answers.
#[derive(Clone, Debug, Default)]
pub(super) struct Visibility {
    /// Positions; the tag holds light and answer.
    places: PhotonMap,
    /// Radius in which each agent's answer counts, by number in the map.
    reach: Vec<f32>,
    /// Lights for which some agent answers other than "trace", in ascending order, with the greatest radius of such an
    /// answer. For other lights no agent is looked up.
    answered: Vec<(u32, f32)>,
    /// Proximity network, if it is used: neighbours by number in the map; [`NO_AGENT`] where there are fewer.
    links: Vec<[u32; LINKS]>,
}

/// Stands for no agent.
const NO_AGENT: u32 = u32::MAX;

impl Visibility {
    /// Makes the lookup of visibility from the agents' answers.
    ///
    /// - `answers`: by agent index.
    /// - `keeps_network`: `true`: the answer at a point is the median of the nearest agent and its neighbours.
    pub(super) fn new(swarm: &Swarm, network: &Network, answers: &[ShadowVerdict], keeps_network: bool) -> Self {
        // Scouts and the camera's agents know no light
        let places = swarm.places_of(|agent| !agent.is_scout());
        let indices: Vec<u32> = places.iter().map(|photon| photon.mark().tag()).collect();
        let reach: Vec<f32> = indices.iter().map(|&index| network.reach(index)).collect();
        let tag = |index: u32| swarm.agents[index as usize].light << 2 | answers[index as usize] as u32;
        let mut numbers = vec![NO_AGENT; swarm.len()];
        indices.iter().zip(0..).for_each(|(&index, number)| numbers[index as usize] = number);
        let links = |&index: &u32| {
            let mut near =
                network.neighbors(index).map(|other| numbers[other as usize]).filter(|&number| number != NO_AGENT);
            std::array::from_fn(|_| near.next().unwrap_or(NO_AGENT))
        };
        let links = if keeps_network { indices.iter().map(links).collect() } else { Vec::new() };
        Self::of(places.retagged(tag), reach, links)
    }

    /// Builds the list of answered lights from the agents' tags.
    fn of(places: PhotonMap, reach: Vec<f32>, links: Vec<[u32; LINKS]>) -> Self {
        let mut farthest: BTreeMap<u32, f32> = BTreeMap::new();
        for (photon, &reach) in places.iter().zip(&reach) {
            let tag = photon.mark().tag();
            if tag & ANSWER != ShadowVerdict::Trace as u32 {
                let most = farthest.entry(tag >> 2).or_default();
                *most = most.max(reach);
            }
        }
        Self { places, reach, answered: farthest.into_iter().collect(), links }
    }

    /// Returns `true` or `false` if the agent near a point knows the visibility of a light; `None`: unknown.
    ///
    /// - `normal`: geometric normal, on the side that faces the light.
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
        match self.links.get(number as usize) {
            Some(links) => self.median(number, links),
            None => self.answer(number),
        }
    }

    /// Returns the answer of one agent; `None`: "trace".
    #[inline(always)]
    fn answer(&self, number: u32) -> Option<bool> {
        match self.places.mark(number).tag() & ANSWER {
            tag if tag == ShadowVerdict::Lit as u32 => Some(true),
            tag if tag == ShadowVerdict::Shaded as u32 => Some(false),
            _ => None,
        }
    }

    /// Returns the median answer of an agent and its neighbours, with "trace" between lit and shaded.
    #[inline(always)]
    fn median(&self, number: u32, links: &[u32; LINKS]) -> Option<bool> {
        let (mut lit, mut shaded, mut count) = (0, 0, 0);
        for &index in links.iter().filter(|&&index| index != NO_AGENT).chain([&number]) {
            let answer = self.answer(index);
            lit += u32::from(answer == Some(true));
            shaded += u32::from(answer == Some(false));
            count += 1;
        }
        match count / 2 {
            half if lit > half => Some(true),
            half if shaded > half => Some(false),
            _ => None,
        }
    }

    /// Returns the median answer of the nearest agent, if it or one of its links passes within `width` of the point: 1
    /// lit, 0.25 shaded, 0.6 "trace". `None`: neither does, or the network is not kept.
    pub(super) fn network_at(&self, p: Vec3, width: f32) -> Option<f32> {
        let number = self.places.nearest_where(p, f32::INFINITY, |_| true)?;
        let links = self.links.get(number as usize)?;
        let place = |index: u32| self.places.photon(index).p;
        let own = place(number);
        let is_on_link = |index: u32| {
            let along = place(index) - own;
            let share = ((p - own).dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            (own + along * share).distance(p) <= width
        };
        let is_near =
            own.distance(p) <= 2.0 * width || links.iter().any(|&index| index != NO_AGENT && is_on_link(index));
        is_near.then(|| match self.median(number, links) {
            Some(true) => 1.0,
            Some(false) => 0.25,
            None => 0.6,
        })
    }

    /// Writes positions, radii and links.
    pub(super) fn write(&self, to: &mut Writer) {
        to.map(&self.places);
        self.reach.iter().for_each(|&reach| to.value(reach));
        to.numbers(self.links.as_flattened());
    }

    /// Reads positions, radii and links; `None`: not valid.
    pub(super) fn read(from: &mut Reader<'_>) -> Option<Self> {
        let places = from.map()?;
        let reach = (0..places.len()).map(|_| from.value()).collect::<Option<Vec<_>>>()?;
        let links = from.numbers()?;
        let (links, rest) = links.as_chunks::<LINKS>();
        let is_sound = rest.is_empty()
            && (links.is_empty() || links.len() == places.len())
            && links.as_flattened().iter().all(|&index| index == NO_AGENT || (index as usize) < places.len());
        is_sound.then(|| Self::of(places, reach, links.to_vec()))
    }

    /// Returns the positions of the agents.
    pub(super) fn places(&self) -> &PhotonMap {
        &self.places
    }

    /// Returns the memory, in bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        self.places.memory_bytes()
            + size_of_val(&*self.reach)
            + size_of_val(&*self.answered)
            + size_of_val(&*self.links)
    }

    /// Returns the share of the agent's light that arrives at an agent of [`places`](Self::places), by its answer: 1 lit, 0
    /// shaded, 0.5 in between.
    pub(super) fn lit_share(agent: &Photon) -> f32 {
        match agent.mark().tag() & ANSWER {
            tag if tag == ShadowVerdict::Lit as u32 => 1.0,
            tag if tag == ShadowVerdict::Shaded as u32 => 0.0,
            _ => 0.5,
        }
    }
}
