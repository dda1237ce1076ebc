//! A learnt distribution over lights for a place: learns from shadow rays which lights matter and are visible there.
//!
//! The light tree accounts for distances, sizes and directions, but not for visibility. A choice stores, for some
//! neighbouring surfaces, how much sampled light arrived, by parts of the tree: a cut that is finest where most light
//! comes from. Light sampling draws from a mixture of choice and tree and uses the probability of the mixture. It
//! therefore also finds lights that the choice considers dark, and the mean is that of the tree alone.
//!
//! Sources: Vévoda, Kondapaneni and Křivánek 2018, *Bayesian online regression for adaptive direct illumination sampling*
//! (parts of the tree learnt by place; root mean square as target); Pantaleoni 2019, *Importance sampling of many lights
//! with reinforcement lightcuts learning* (an adaptive cut).

use bottega_kernels::Hit;
use glam::Vec3;

use super::{LightSample, Lights, NO_LIGHT, Receiver, tree::LightTree};
use crate::{bsdf::warp::ONE_MINUS_EPSILON, density::SolidAnglePdf, sampler::Quad, surfaces::Surfaces};

/// Largest number of parts of the tree that a choice distinguishes.
pub(crate) const PARTS: usize = 32;
/// Index of the part for lights at infinity.
const FAR: usize = PARTS;
/// Mixture weights of the choice that a place may select. With the largest one, 0.9, a sample of light that the choice
/// considers dark weighs at most ten times as much as by the tree alone.
const SHARES: [f32; 4] = [0.0, 0.5, 0.75, 0.9];
/// Factor by which the mean square must fall for a choice to be used: the mixture evaluates the tree twice.
const GAIN_MIN: f64 = 1.05;
/// Smallest number of shadow rays from which a choice is learnt.
const SAMPLES_MIN: usize = 64;

/// A light sample and its visibility, from which choices learn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RequestedLight {
    /// Number of the light in the tree; [`NO_LIGHT`] for a light at infinity.
    pub(crate) light: u32,
    /// Unoccluded contribution to the outgoing luminance, over its probability.
    pub(crate) found: f32,
    /// `true`: the light is visible; tested only if `found` is above 0.
    pub(crate) is_seen: bool,
}

/// A learnt distribution over lights, see the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Choice {
    /// Mixture weight of the choice; the remainder is the tree's.
    share: f32,
    /// Probability with which the choice samples lights at infinity.
    far: f32,
    /// End of each part's range of lights, which is the start of the next; [`NO_LIGHT`] from the last part on.
    ends: [u32; PARTS],
    /// Tree node of each part; [`NO_LIGHT`] for a single light.
    nodes: [u32; PARTS],
    /// Cumulative probabilities of the parts, given that the light is not at infinity; 1 from the last part on.
    up_to: [f32; PARTS],
    /// Estimated visible share of each part's light; the last entry is for lights at infinity.
    seen: [f32; PARTS + 1],
}

/// Number of words of a serialized [`Choice`].
pub(crate) const NUMBERS: usize = 2 + 3 * PARTS + PARTS + 1;

/// A part of the tree during the search for a cut.
#[derive(Clone, Copy)]
struct CutPart {
    node: u32,
    first: u32,
    end: u32,
    tally: CutTally,
}

/// Statistics of the samples of a part.
#[derive(Clone, Copy, Default)]
struct CutTally {
    /// Number of samples.
    samples: u32,
    /// Number of samples with an unoccluded contribution; `seen`: number of those that are visible.
    wanted: u32,
    seen: u32,
    /// Sum of squared contributions; `halves`: the same for samples of even and odd index.
    square: f64,
    halves: [f64; 2],
}

impl CutTally {
    fn add(&mut self, sample: &RequestedLight, index: usize) {
        self.samples += 1;
        if sample.found > 0.0 {
            self.wanted += 1;
            if sample.is_seen {
                let square = f64::from(sample.found) * f64::from(sample.found);
                self.seen += 1;
                self.square += square;
                self.halves[index % 2] += square;
            }
        }
    }

    /// Returns a weight proportional to the root mean square of the part's light when it is the only one sampled.
    fn weight(&self, square: f64) -> f64 {
        (square * f64::from(self.samples)).sqrt()
    }

    /// Returns the visible share of the light by Jeffreys' estimate, which is cautious for few samples.
    fn share_seen(&self) -> f32 {
        (self.seen as f32 + 0.5) / (self.wanted as f32 + 1.0)
    }
}

impl Choice {
    /// Learns from the samples of one place. `None`: they are too few.
    fn learn(tree: &LightTree, samples: &[RequestedLight]) -> Option<Self> {
        if samples.len() < SAMPLES_MIN {
            return None;
        }
        let tally = |is_of: &dyn Fn(u32) -> bool| {
            let mut tally = CutTally::default();
            for (index, sample) in samples.iter().enumerate().filter(|(_, sample)| is_of(sample.light)) {
                tally.add(sample, index);
            }
            tally
        };
        let parts = cut(tree, &|first, end| tally(&|light| (first..end).contains(&light)));
        Some(Self::from_parts(&parts, &tally(&|light| light == NO_LIGHT), samples.len()))
    }

    fn from_parts(parts: &[CutPart], far: &CutTally, count: usize) -> Self {
        let tallies = || parts.iter().map(|part| &part.tally).chain([far]);
        let by = |square: &dyn Fn(&CutTally) -> f64| -> Vec<f64> {
            let weights: Vec<f64> = tallies().map(|tally| tally.weight(square(tally))).collect();
            let sum: f64 = weights.iter().sum();
            weights.into_iter().map(|weight| if sum > 0.0 { weight / sum } else { 0.0 }).collect()
        };
        // Cross-validate: test the distribution learnt from one half on the other
        let learnt = [by(&|tally| tally.halves[0]), by(&|tally| tally.halves[1])];
        let squares = |share: f32| {
            let of = |which: usize| {
                tallies().zip(&learnt[which]).filter(|(tally, _)| tally.samples > 0).map(move |(tally, &own)| {
                    let tree = f64::from(tally.samples) / count as f64;
                    let share = f64::from(share);
                    tally.halves[1 - which] * tree / ((1.0 - share) * tree + share * own)
                })
            };
            of(0).chain(of(1)).sum::<f64>()
        };
        // Select the mixture weight with the least mean square, if it is a clear gain
        let all = SHARES.map(squares);
        let best = (1..SHARES.len()).min_by(|&a, &b| all[a].total_cmp(&all[b])).unwrap_or(0);
        let share = if all[best] > 0.0 && all[0] >= all[best] * GAIN_MIN { SHARES[best] } else { 0.0 };
        // Learn the final distribution from all samples
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

    /// Returns true if some samples are drawn by it.
    pub(super) fn has_share(&self) -> bool {
        self.share > 0.0
    }

    /// Returns the part of the tree that a light belongs to.
    #[inline(always)]
    fn part(&self, light: u32) -> usize {
        self.ends.iter().map(|&end| usize::from(end <= light)).sum::<usize>().min(PARTS - 1)
    }

    /// Returns the first light of a part.
    #[inline(always)]
    fn first(&self, part: usize) -> u32 {
        if part == 0 { 0 } else { self.ends[part - 1] }
    }

    /// Returns the probability of a part, given that the light is not at infinity.
    #[inline(always)]
    fn probability(&self, part: usize) -> f32 {
        self.up_to[part] - if part == 0 { 0.0 } else { self.up_to[part - 1] }
    }

    /// Returns the estimated visible share of a light; [`NO_LIGHT`]: of lights at infinity.
    #[inline(always)]
    pub(crate) fn seen(&self, light: u32) -> f32 {
        self.seen[if light == NO_LIGHT { FAR } else { self.part(light) }]
    }

    /// Serializes the choice to words; floats by their bits.
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

    /// Deserializes a choice. `None`: the words are invalid.
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

/// Returns a cut through the tree, with parts in the order of their lights. Repeatedly splits the part with the greatest
/// weight, while there is room.
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
    /// Learns from the samples of one place. `None`: they are too few.
    pub(crate) fn learn(&self, samples: &[RequestedLight]) -> Option<Choice> {
        Choice::learn(&self.tree, samples)
    }

    /// Returns the probability of sampling lights at infinity by the mixture.
    #[inline(always)]
    pub(super) fn far_share_by(&self, receiver: &Receiver, choice: &Choice) -> f32 {
        let tree = self.far_share(receiver);
        if !self.has_far() || self.lights.is_empty() { tree } else { tree + choice.share * (choice.far - tree) }
    }

    /// Samples one light and a point on it, like [`Lights::sample`], by the mixture of choice and tree. `None`: no
    /// light for these random numbers.
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
        // Sample a light at infinity
        if u[0] < far {
            return self.sample_far(surfaces.scene(), receiver, u[0] / far, far, [u[1], u[2]]);
        }
        let rest = ((u[0] - far) / (1.0 - far)).min(ONE_MINUS_EPSILON);
        let by_choice = self.near_by_choice(choice) / (1.0 - far);
        // Sample the tree below a part, or the whole tree
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
        // A choice received over the network may refer to other lights
        if pmf <= 0.0 || light as usize >= self.lights.len() {
            return None;
        }
        let sample = self.sample_place(surfaces, light, receiver.p, [u[1], u[2]])?;
        Some(LightSample { pdf: sample.pdf * pmf, pmf, ..sample })
    }

    /// Returns the probability of following the choice to a light of the tree.
    #[inline(always)]
    fn near_by_choice(&self, choice: &Choice) -> f32 {
        if self.has_far() { choice.share * (1.0 - choice.far) } else { choice.share }
    }

    /// Returns the probability with which [`Self::sample_by`] chooses a light of the tree.
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

    /// Returns the density with which the direction to the point `p` of a hit on an emitting surface is drawn: by the
    /// mixture, or by the tree alone without a choice.
    #[inline(always)]
    pub(crate) fn hit_pdf_by(
        &self,
        surfaces: &Surfaces,
        hit: &Hit,
        receiver: &Receiver,
        p: Vec3,
        choice: Option<&Choice>,
    ) -> SolidAnglePdf {
        let Some(light) = self.light_of(surfaces, hit) else { return SolidAnglePdf::ZERO };
        let pmf = match choice {
            None => self.pmf(receiver, light),
            Some(choice) => self.pmf_by(receiver, choice, light),
        };
        if pmf > 0.0 { pmf * self.place_pdf(surfaces.scene(), light, receiver.p, p) } else { SolidAnglePdf::ZERO }
    }
}
