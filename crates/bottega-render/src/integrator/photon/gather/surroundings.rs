//! Directional light from agents, on surfaces that are not matte.

use super::{
    GatherPath, VERTICES,
    state::{ArrivalKind, GatherState},
};
use crate::{
    bsdf::{Bsdf, BsdfSample},
    photon::cache::Surroundings,
    sampler::DimensionSet,
    shading::{is_broad_sample, is_matte},
    vertex::SurfaceVertex,
};

/// Number of directions in which agents give the light to a surface that the camera sees. No rays are traced for them.
const LOOKS: u32 = 16;

impl<'a> GatherPath<'a> {
    /// Returns the directional light that agents know at a surface that is not matte; `None`: the surface is matte or
    /// transmits light, or agents know none.
    pub(super) fn surroundings(
        &mut self,
        state: &GatherState,
        vertex: &SurfaceVertex<'_>,
        bsdf: &Bsdf<'_>,
    ) -> Option<Surroundings<'a>> {
        let bounces = self.bounces_left(state);
        // Matte surfaces use irradiance; light through a surface is not recorded
        if is_matte(bsdf) || bsdf.is_transmissive() {
            return None;
        }
        let known = self.agents?.surroundings_at(vertex.point.p, vertex.point.frame[2], bounces, self.fade(state));
        self.buffers.tally.irradiance_interpolated += u64::from(known.is_some());
        known
    }

    /// Returns how near agents must be to count, in [0, 1). Random where the camera sees the surface, so that the
    /// agents' regions have no visible edges.
    pub(super) fn fade(&self, state: &GatherState) -> f32 {
        /// Key of this random number, distinct from all others.
        const KEY: u64 = 0x6661_6465;
        if matches!(state.comes, ArrivalKind::Camera) {
            self.sampler.hashed(KEY ^ u64::from(state.vertex) << 32)
        } else {
            0.0
        }
    }

    /// Adds the reflection of the surrounding light in the broad lobes of a surface.
    pub(super) fn add_surroundings(
        &mut self,
        state: &GatherState,
        vertex: &SurfaceVertex<'_>,
        known: &Surroundings<'_>,
    ) {
        for part in 0..LOOKS {
            // Draw a direction from a broad lobe, and look up its radiance
            let u = self.sampler.split_quad(DimensionSet::scattering(2 * VERTICES + state.vertex), part, LOOKS);
            if let Some(sample) = vertex.bsdf.sample(u[0], [u[1], u[2]]).filter(is_broad_sample) {
                self.add_from(state, vertex, known, &sample, 1.0 / LOOKS as f32);
            }
        }
    }

    /// Adds the reflection of the surrounding light from one direction.
    pub(super) fn add_from(
        &mut self,
        state: &GatherState,
        vertex: &SurfaceVertex<'_>,
        known: &Surroundings<'_>,
        sample: &BsdfSample,
        part: f32,
    ) {
        let wi = vertex.point.to_world(sample.wi);
        let is_reflection = sample.wi.z > 0.0 && vertex.point.is_reflection(wi);
        if is_reflection && self.bounces_left(state) >= 2 {
            let light = state.throughput * sample.weight() * known.radiance(wi) * part;
            let (p, normal) = (vertex.point.p, vertex.point.frame[2]);
            let bounces = self.bounces_left(state);
            self.add_shared(light, state.depth, |path| path.agents?.shares_at(p, normal, bounces));
        }
    }
}
