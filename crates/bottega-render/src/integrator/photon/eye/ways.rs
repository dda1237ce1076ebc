//! Reflection and refraction at glass: a camera path follows both.

use super::{
    Eye,
    walk::{Place, Walk, scatter, survives},
};
use crate::{bsdf::BsdfSample, sampler::DimensionSet};

/// Least throughput of the weaker path; below it, one of the two is drawn at random.
const CARRIED_MIN: f32 = 0.01;
/// Depth from which one of the two is always drawn at random: the recursion uses the stack.
const DEPTH_MAX: u32 = 16;

impl Eye<'_> {
    /// Returns reflection and refraction, the stronger one first, where both carry enough to be traced.
    pub(super) fn ways_worth_going(&self, walk: &Walk, place: &Place<'_>) -> Option<[BsdfSample; 2]> {
        let carried = walk.throughput.max_element() * walk.squeezed;
        let is_early = walk.depth < DEPTH_MAX && carried >= CARRIED_MIN;
        let ways = if is_early { place.bsdf.both_ways() } else { None };
        ways.filter(|[_, weaker]| carried * weaker.pdf >= CARRIED_MIN)
    }

    /// Traces the stronger path to its end, and continues along the weaker one with its own random numbers. Returns
    /// `false` when the path ends.
    ///
    /// Drawn at random, a lamp that a glass ball reflects by a twentieth is a speck in one sample of twenty.
    pub(super) fn go_both_ways(&mut self, walk: &mut Walk, place: &Place<'_>, ways: [BsdfSample; 2]) -> bool {
        let [stronger, weaker] = ways;
        let sampler = self.sampler;
        let mut other = *walk;
        let mut goes_on = self.go(&mut other, place, &stronger);
        while goes_on {
            goes_on = self.step(&mut other);
        }
        self.sampler = sampler.branch(walk.vertex, 1);
        self.go(walk, place, &weaker)
    }

    /// Scatters along one of both directions, weighted by its share.
    fn go(&self, walk: &mut Walk, place: &Place<'_>, way: &BsdfSample) -> bool {
        let u = self.sampler.quad(DimensionSet::scattering(walk.vertex))[3];
        scatter(self.prepared, walk, place, way, way.pdf) && survives(walk, 1.0, u)
    }
}
