//! The choice among lights at a place: which matter and which are seen from there, learnt from shadow rays.
//!
//! The tree over lights knows distances, sizes and directions, and no walls. A choice knows, for some surfaces next to each
//! other, how much of the light that was asked for came, by parts of the tree: a cut through it that goes deep where much
//! comes from. Whoever draws a light follows the choice or the tree, and counts with the probability of both together: so
//! what a choice has never seen is found as well, and the mean is that of the tree alone.
//!
//! Sources: Vévoda, Kondapaneni and Křivánek 2018, *Bayesian online regression for adaptive direct illumination sampling*
//! (parts of the tree learnt by place; the root of the mean square as target); Pantaleoni 2019, *Importance sampling of
//! many lights with reinforcement lightcuts learning* (a cut that adapts).

use bottega_kernels::Hit;
use glam::Vec3;

use super::{LightSample, Lights, NO_LIGHT, Receiver, tree::LightTree};
use crate::{bsdf::warp::ONE_MINUS_EPSILON, sampler::Quad, surfaces::Surfaces};

/// Parts of the tree that a choice tells apart.
pub(crate) const PARTS: usize = 32;
/// The number of the part that is infinitely far away.
const FAR: usize = PARTS;
/// Shares of the choice that a place may choose between: what it has never seen shine is at most ten times as bright as by
/// the tree alone.
const SHARES: [f32; 4] = [0.0, 0.5, 0.75, 0.9];
/// By what factor the mean square must fall for a choice to be worth its while: drawing by both asks the tree twice.
const GAIN_MIN: f64 = 1.05;
/// Rays from which a choice is learnt, at least.
const ASKED_MIN: usize = 64;

/// Light that was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RequestedLight {
    /// The light of the tree; [`NO_LIGHT`]: one infinitely far away.
    pub(crate) light: u32,
    /// Luminance that it adds to what leaves the place, over its probability, if nothing is between.
    pub(crate) found: f32,
    /// Whether nothing is between; asked only where something is found.
    pub(crate) is_seen: bool,
}

/// See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Choice {
    /// With which probability it is followed, not the tree.
    share: f32,
    /// With which probability it then asks for light from infinitely far away.
    far: f32,
    /// Where the lights of each part of the tree end, and those of the next begin; beyond all from the last part on.
    ends: [u32; PARTS],
    /// The node of each part; [`NO_LIGHT`] for a single light.
    nodes: [u32; PARTS],
    /// The probability of each part and all before, where light is not far away; from the last part on 1.
    up_to: [f32; PARTS],
    /// The share of each part's light that is seen, as far as is known; the last is of light that is far away.
    seen: [f32; PARTS + 1],
}

/// Numbers that a [`Choice`] is written down as.
pub(crate) const NUMBERS: usize = 2 + 3 * PARTS + PARTS + 1;

/// A part of the tree while a cut is sought.
#[derive(Clone, Copy)]
struct CutPart {
    node: u32,
    first: u32,
    end: u32,
    tally: CutTally,
}

/// What was found of a part.
#[derive(Clone, Copy, Default)]
struct CutTally {
    /// How often it was asked.
    asked: u32,
    /// How often something would have been found, and how often it was seen.
    wanted: u32,
    seen: u32,
    /// Sum of squares of what came, of all rays and of every other one.
    square: f64,
    halves: [f64; 2],
}

impl CutTally {
    fn add(&mut self, asked: &RequestedLight, index: usize) {
        self.asked += 1;
        if asked.found > 0.0 {
            self.wanted += 1;
            if asked.is_seen {
                let square = f64::from(asked.found) * f64::from(asked.found);
                self.seen += 1;
                self.square += square;
                self.halves[index % 2] += square;
            }
        }
    }

    /// In proportion to the root of the mean square of this part's light, if no other were asked for.
    fn weight(&self, square: f64) -> f64 {
        (square * f64::from(self.asked)).sqrt()
    }

    /// The share of the light that is seen, by Jeffreys' estimate: all of few is less sure than all of many.
    fn share_seen(&self) -> f32 {
        (self.seen as f32 + 0.5) / (self.wanted as f32 + 1.0)
    }
}

impl Choice {
    /// Learns from rays of one place. `None`: they are too few.
    fn learn(tree: &LightTree, asked: &[RequestedLight]) -> Option<Self> {
        if asked.len() < ASKED_MIN {
            return None;
        }
        let tally = |is_of: &dyn Fn(u32) -> bool| {
            let mut tally = CutTally::default();
            for (index, asked) in asked.iter().enumerate().filter(|(_, asked)| is_of(asked.light)) {
                tally.add(asked, index);
            }
            tally
        };
        let parts = cut(tree, &|first, end| tally(&|light| (first..end).contains(&light)));
        Some(Self::from_parts(&parts, &tally(&|light| light == NO_LIGHT), asked.len()))
    }

    fn from_parts(parts: &[CutPart], far: &CutTally, count: usize) -> Self {
        let tallies = || parts.iter().map(|part| &part.tally).chain([far]);
        let by = |square: &dyn Fn(&CutTally) -> f64| -> Vec<f64> {
            let weights: Vec<f64> = tallies().map(|tally| tally.weight(square(tally))).collect();
            let sum: f64 = weights.iter().sum();
            weights.into_iter().map(|weight| if sum > 0.0 { weight / sum } else { 0.0 }).collect()
        };
        // What one half has learnt is tried on the other.
        let learnt = [by(&|tally| tally.halves[0]), by(&|tally| tally.halves[1])];
        let squares = |share: f32| {
            let of = |which: usize| {
                tallies().zip(&learnt[which]).filter(|(tally, _)| tally.asked > 0).map(move |(tally, &own)| {
                    let tree = f64::from(tally.asked) / count as f64;
                    let share = f64::from(share);
                    tally.halves[1 - which] * tree / ((1.0 - share) * tree + share * own)
                })
            };
            of(0).chain(of(1)).sum::<f64>()
        };
        let all = SHARES.map(squares);
        let best = (1..SHARES.len()).min_by(|&a, &b| all[a].total_cmp(&all[b])).unwrap_or(0);
        let share = if all[best] > 0.0 && all[0] >= all[best] * GAIN_MIN { SHARES[best] } else { 0.0 };
        let own = by(&|tally| tally.square);
        let far_share = own[parts.len()] as f32;
        let near: f64 = own[..parts.len()].iter().sum();
        let mut choice = Self {
            share,
            far: if near > 0.0 { far_share } else { 1.0 },
            ends: [NO_LIGHT; PARTS],
            nodes: [NO_LIGHT; PARTS],
            up_to: [1.0; PARTS],
            seen: [0.5; PARTS + 1],
        };
        let mut sum = 0.0;
        for (place, part) in parts.iter().enumerate() {
            sum += own[place];
            choice.nodes[place] = part.node;
            if place + 1 < parts.len() {
                choice.ends[place] = part.end;
                choice.up_to[place] = if near > 0.0 { (sum / near) as f32 } else { 1.0 };
            }
            choice.seen[place] = part.tally.share_seen();
        }
        choice.seen[FAR] = far.share_seen();
        choice
    }

    /// The part of the tree that a light belongs to.
    #[inline(always)]
    fn part(&self, light: u32) -> usize {
        self.ends.iter().map(|&end| usize::from(end <= light)).sum::<usize>().min(PARTS - 1)
    }

    /// The first light of a part.
    #[inline(always)]
    fn first(&self, part: usize) -> u32 {
        if part == 0 { 0 } else { self.ends[part - 1] }
    }

    /// The probability of a part among those of the tree.
    #[inline(always)]
    fn probability(&self, part: usize) -> f32 {
        self.up_to[part] - if part == 0 { 0.0 } else { self.up_to[part - 1] }
    }

    /// The share of a light that is seen, as far as is known; [`NO_LIGHT`]: of one infinitely far away.
    #[inline(always)]
    pub(crate) fn seen(&self, light: u32) -> f32 {
        self.seen[if light == NO_LIGHT { FAR } else { self.part(light) }]
    }

    /// As numbers, bits of those that are none.
    pub(crate) fn to_numbers(self) -> [u32; NUMBERS] {
        let bits = |numbers: &[f32]| numbers.iter().map(|number| number.to_bits()).collect::<Vec<_>>();
        let all = [
            bits(&[self.share, self.far]),
            self.ends.to_vec(),
            self.nodes.to_vec(),
            bits(&self.up_to),
            bits(&self.seen),
        ];
        let mut all = all.into_iter().flatten();
        std::array::from_fn(|_| all.next().unwrap_or_default())
    }

    /// The other way round. `None`: they are none.
    pub(crate) fn from_numbers(numbers: &[u32; NUMBERS]) -> Option<Self> {
        let mut rest = numbers.iter().copied();
        let mut next = || rest.next().unwrap_or_default();
        let [share, far] = [next(), next()].map(f32::from_bits);
        let ends: [u32; PARTS] = std::array::from_fn(|_| next());
        let nodes = std::array::from_fn(|_| next());
        let up_to: [f32; PARTS] = std::array::from_fn(|_| f32::from_bits(next()));
        let seen: [f32; PARTS + 1] = std::array::from_fn(|_| f32::from_bits(next()));
        let is_share = |number: &f32| (0.0..=1.0).contains(number);
        let is_sound = share <= SHARES[SHARES.len() - 1]
            && [share, far].iter().chain(&up_to).chain(&seen).all(is_share)
            && ends.is_sorted()
            && up_to.is_sorted()
            && up_to[PARTS - 1] == 1.0;
        is_sound.then_some(Self { share, far, ends, nodes, up_to, seen })
    }
}

/// A cut through the tree: parts in the order of their lights. What most comes from is opened, as long as there is room.
fn cut(tree: &LightTree, tally: &impl Fn(u32, u32) -> CutTally) -> Vec<CutPart> {
    let mut parts: Vec<CutPart> = tree
        .root()
        .into_iter()
        .map(|(node, first, end)| CutPart { node, first, end, tally: tally(first, end) })
        .collect();
    loop {
        let can_open = |part: &CutPart| {
            part.node != NO_LIGHT && tree.children(part.node, part.first).count() + parts.len() <= PARTS + 1
        };
        let weight = |place: usize| parts[place].tally.weight(parts[place].tally.square);
        let open = (0..parts.len()).filter(|&place| can_open(&parts[place]) && weight(place) > 0.0);
        let Some(place) = open.max_by(|&a, &b| weight(a).total_cmp(&weight(b)).then(b.cmp(&a))) else { return parts };
        let CutPart { node, first, .. } = parts[place];
        let children =
            tree.children(node, first).map(|(node, first, end)| CutPart { node, first, end, tally: tally(first, end) });
        parts.splice(place..=place, children.collect::<Vec<_>>());
    }
}

impl Lights {
    /// Learns from rays of one place. `None`: they are too few.
    pub(crate) fn learn(&self, asked: &[RequestedLight]) -> Option<Choice> {
        Choice::learn(&self.tree, asked)
    }

    /// The probability of asking for light from infinitely far away.
    #[inline(always)]
    fn far_share_by(&self, receiver: &Receiver, choice: &Choice) -> f32 {
        let tree = self.far_share(receiver);
        if !self.has_far() || self.lights.is_empty() { tree } else { tree + choice.share * (choice.far - tree) }
    }

    /// Draws one light and a place on it, as [`Lights::sample`] does, by what has been learnt.
    #[inline(always)]
    pub(crate) fn sample_by(
        &self,
        surfaces: &Surfaces,
        receiver: &Receiver,
        choice: &Choice,
        u: Quad,
    ) -> Option<LightSample> {
        if choice.share <= 0.0 {
            return self.sample(surfaces, receiver, u);
        }
        let far = self.far_share_by(receiver, choice);
        if u[0] < far {
            return self.sample_far(surfaces.scene(), receiver, u[0] / far, far, [u[1], u[2]]);
        }
        let rest = ((u[0] - far) / (1.0 - far)).min(ONE_MINUS_EPSILON);
        let by_choice = self.near_by_choice(choice) / (1.0 - far);
        let light = if rest < by_choice {
            let rest = (rest / by_choice).min(ONE_MINUS_EPSILON);
            let part = choice.up_to.iter().map(|&end| usize::from(end <= rest)).sum::<usize>().min(PARTS - 1);
            let (before, own) = (choice.up_to[part] - choice.probability(part), choice.probability(part));
            let rest = ((rest - before) / own).clamp(0.0, ONE_MINUS_EPSILON);
            self.tree.sample_below(receiver, choice.nodes[part], choice.first(part), rest)?
        } else {
            let rest = ((rest - by_choice) / (1.0 - by_choice)).clamp(0.0, ONE_MINUS_EPSILON);
            self.tree.sample(receiver, rest)?.0
        };
        let pmf = self.pmf_by(receiver, choice, light);
        // (A choice that somebody sent may know other lights.)
        if pmf <= 0.0 || light as usize >= self.lights.len() {
            return None;
        }
        let sample = self.sample_place(surfaces, light, receiver.p, [u[1], u[2]])?;
        Some(LightSample { pdf: sample.pdf * pmf, pmf, ..sample })
    }

    /// The probability of following the choice to a light of the tree.
    #[inline(always)]
    fn near_by_choice(&self, choice: &Choice) -> f32 {
        if self.has_far() { choice.share * (1.0 - choice.far) } else { choice.share }
    }

    /// The probability with which [`Self::sample_by`] draws a light of the tree.
    #[inline(always)]
    pub(crate) fn pmf_by(&self, receiver: &Receiver, choice: &Choice, light: u32) -> f32 {
        if choice.share <= 0.0 {
            return self.pmf(receiver, light);
        }
        let part = choice.part(light);
        let (whole, below) = self.tree.pmfs(receiver, light, choice.nodes[part]);
        let by_tree = (1.0 - choice.share) * (1.0 - self.far_share(receiver));
        by_tree * whole + self.near_by_choice(choice) * choice.probability(part) * below
    }

    /// Density per solid angle with which the place `p` that was hit on a surface that shines is drawn: by a choice that was
    /// learnt, or as nobody has learnt.
    #[inline(always)]
    pub(crate) fn hit_pdf_by(
        &self,
        surfaces: &Surfaces,
        hit: &Hit,
        receiver: &Receiver,
        p: Vec3,
        choice: Option<&Choice>,
    ) -> f32 {
        let Some(light) = self.light_of(surfaces, hit) else { return 0.0 };
        let pmf = match choice {
            None => self.pmf(receiver, light),
            Some(choice) => self.pmf_by(receiver, choice, light),
        };
        if pmf > 0.0 { pmf * self.place_pdf(surfaces.scene(), light, receiver.p, p) } else { 0.0 }
    }

    /// Density per solid angle with which [`Self::sample_by`] draws a direction that meets no surface.
    pub(crate) fn environment_pdf_by(&self, receiver: &Receiver, choice: &Choice, direction: Vec3) -> f32 {
        if choice.share <= 0.0 {
            return self.environment_pdf(receiver, direction);
        }
        let Some(light) = &self.environment else { return 0.0 };
        let (illuminance, total) = (light.illuminance(receiver.p), self.far_total(receiver));
        if illuminance <= 0.0 || total <= 0.0 {
            return 0.0;
        }
        light.pdf_at(receiver.p, direction) * self.far_share_by(receiver, choice) * illuminance / total
    }
}
