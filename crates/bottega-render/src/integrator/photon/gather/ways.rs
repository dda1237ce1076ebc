//! Reflection and refraction at glass: a camera path follows both.

use super::{
    GatherPath,
    state::{GatherState, scatter, survives},
};
use crate::{bsdf::BsdfSample, sampler::DimensionSet, vertex::SurfaceVertex};

/// Least throughput of the weaker path; below it, one of the two is drawn at random.
const CARRIED_MIN: f32 = 0.01;
/// Depth from which one of the two is always drawn at random: the recursion uses the stack.
const DEPTH_MAX: u32 = 16;

impl GatherPath<'_> {
    /// Returns reflection and refraction, the stronger one first, if both carry enough to be traced; else `None`.
    pub(super) fn ways_worth_going(&self, state: &GatherState, vertex: &SurfaceVertex<'_>) -> Option<[BsdfSample; 2]> {
        let carried = state.throughput.max_element() * state.squeezed;
        let is_early = state.depth < DEPTH_MAX && carried >= CARRIED_MIN;
        let ways = if is_early { vertex.bsdf.both_ways() } else { None };
        ways.filter(|[_, weaker]| carried * weaker.pdf >= CARRIED_MIN)
    }

    /// Traces the stronger path to its end, and continues along the weaker one with its own random numbers. Returns
    /// `false` when the path ends.
    ///
    /// Drawn at random, a light that a glass ball reflects by a twentieth is a speck in one sample of twenty.
    pub(super) fn go_both_ways(
        &mut self,
        state: &mut GatherState,
        vertex: &SurfaceVertex<'_>,
        ways: [BsdfSample; 2],
    ) -> bool {
        let [stronger, weaker] = ways;
        let sampler = self.sampler;
        // Trace the stronger way to its end
        let mut other = *state;
        let mut goes_on = self.go(&mut other, vertex, &stronger);
        while goes_on {
            goes_on = self.step(&mut other);
        }
        // Continue along the weaker one
        self.sampler = sampler.branch(state.vertex, 1);
        self.go(state, vertex, &weaker)
    }

    /// Scatters along one of both directions, weighted by its share.
    fn go(&self, state: &mut GatherState, vertex: &SurfaceVertex<'_>, way: &BsdfSample) -> bool {
        let u = self.sampler.quad(DimensionSet::scattering(state.vertex))[3];
        scatter(self.prepared, state, vertex, way, way.pdf) && survives(state, u)
    }
}
