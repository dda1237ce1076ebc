//! Scattering: the next direction of a path.

use super::{
    super::transport::{survives, widen},
    guidance::NO_LEAF,
    state::{Path, Previous},
    vertex::PathVertex,
};
use crate::{
    density::SolidAnglePdf,
    sampler::Quad,
    vertex::{LeavingDirection, SurfaceVertex, absorption_behind, leaving_direction},
};

impl Path<'_> {
    /// Samples the next direction, moves the path on, and applies Russian roulette. Returns `false` when the path ends.
    #[inline(always)]
    pub(super) fn scatter<const AGENTS: bool>(&mut self, vertex: &PathVertex<'_>, u: Quad) -> bool {
        let PathVertex { surface: SurfaceVertex { point, bsdf, receiver, .. }, guidance, .. } = *vertex;
        // Sample the guide or the BSDF
        let Some((sample, bsdf_pdf)) = guidance.sample(point, bsdf, u) else { return false };
        // Reject directions on which shading normal and surface disagree
        let Some(LeavingDirection { wi, is_reflection }) = leaving_direction(point, &sample) else { return false };
        // Record the direction for learning
        let is_delta = sample.is_delta();
        if let Some(trail) = &mut self.trail
            && !is_delta
        {
            trail.record_direction(wi, bsdf_pdf, sample.pdf, self.radiance);
        }
        // Update throughput, absorption and roulette scale
        self.throughput *= sample.weight();
        if !is_reflection {
            let known = self.integrator.prepared.material(point.material).1;
            self.absorption = absorption_behind(point, known, self.absorption);
            self.roulette_scale *= sample.eta * sample.eta;
        }
        // Widen the ray cone by the spread of the sampled lobe
        if !is_delta {
            widen(&mut self.cone, sample.pdf);
            if guidance.is_guided() {
                self.roulette_scale *= sample.pdf / bsdf_pdf.max(1e-6);
            }
        }
        // Remember this vertex for multiple importance sampling, and move on
        let leaf = if AGENTS && self.integrator.settings.agents.lights { guidance.leaf() } else { NO_LEAF };
        let pdf = (!is_delta).then_some(SolidAnglePdf::new(sample.pdf));
        self.previous = Previous { receiver, pdf, leaf };
        self.origin = point.ray_origin(wi);
        self.direction = wi;
        self.depth += 1;
        // Leave Russian roulette to the agents where they decide: at the next vertex
        if AGENTS && self.integrator.splits {
            return self.throughput.max_element() > 0.0;
        }
        // Terminate with Russian roulette
        self.survives(u[3])
    }

    /// Applies Russian roulette. Returns `true` if the path survives.
    #[inline(always)]
    fn survives(&mut self, u: f32) -> bool {
        let is_sure = self.depth <= self.integrator.settings.roulette_depth;
        survives(&mut self.throughput, self.roulette_scale, is_sure, u)
    }
}
