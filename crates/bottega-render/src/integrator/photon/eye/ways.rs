//! The two ways that light takes at glass: a path from the camera goes both.

use super::{
    Eye,
    walk::{Place, Walk, scatter, survives},
};
use crate::{bsdf::BsdfSample, sampler::DimensionSet};

/// What the weaker way must carry of what the pixel shows, or one of the two is drawn by chance.
const CARRIED_MIN: f32 = 0.01;
/// Surfaces after which one of the two is drawn all the same: ways lie on the stack.
const DEPTH_MAX: u32 = 16;

impl Eye<'_> {
    /// What is reflected and what goes through, the stronger one first, where both are worth a path of their own.
    pub(super) fn ways_worth_going(&self, walk: &Walk, place: &Place<'_>) -> Option<[BsdfSample; 2]> {
        let carried = walk.throughput.max_element() * walk.squeezed;
        let is_early = walk.depth < DEPTH_MAX && carried >= CARRIED_MIN;
        let ways = if is_early { place.bsdf.both_ways() } else { None };
        ways.filter(|[_, weaker]| carried * weaker.pdf >= CARRIED_MIN)
    }

    /// Goes the stronger way to its end, and then on along the weaker one, with numbers of its own. False where that leads nowhere.
    ///
    /// Drawn by chance, a lamp that a ball of glass reflects by a twentieth would be a speck in one sample of twenty.
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

    /// Goes one of both ways, which carries its part.
    fn go(&self, walk: &mut Walk, place: &Place<'_>, way: &BsdfSample) -> bool {
        let u = self.sampler.quad(DimensionSet::scattering(walk.vertex))[3];
        scatter(self.prepared, walk, place, way, way.pdf) && survives(walk, 1.0, u)
    }
}
