//! Directional light from agents, on surfaces that are not matte.

use super::{
    Eye, VERTICES,
    walk::{ArrivalKind, Place, Walk},
};
use crate::{
    bsdf::{Bsdf, BsdfSample},
    photon::cache::Surroundings,
    sampler::DimensionSet,
    shading::{is_broad_sample, is_matte},
};

/// Number of directions in which agents give the light to a surface that the camera sees. No rays are traced for them.
const LOOKS: u32 = 16;

impl<'a> Eye<'a> {
    /// Returns the directional light that agents know at a surface that is not matte.
    pub(super) fn surroundings(&mut self, walk: &Walk, place: &Place<'_>, bsdf: &Bsdf) -> Option<Surroundings<'a>> {
        let bounces = self.bounces_left(walk);
        if is_matte(bsdf) || bsdf.is_transmissive() {
            return None;
        }
        let known = self.agents?.surroundings_at(place.point.p, place.point.frame[2], bounces, self.fade(walk));
        self.hands.tally.irradiance_interpolated += u64::from(known.is_some());
        known
    }

    /// Returns how near agents must be to count, in [0, 1). Random where the camera sees the surface, so that the
    /// agents' regions have no visible edges.
    pub(super) fn fade(&self, walk: &Walk) -> f32 {
        /// Key of this random number, distinct from all others.
        const KEY: u64 = 0x6661_6465;
        if matches!(walk.comes, ArrivalKind::Camera) {
            self.sampler.hashed(KEY ^ u64::from(walk.vertex) << 32)
        } else {
            0.0
        }
    }

    /// Adds the reflection of the surrounding light in the broad lobes of a surface.
    pub(super) fn add_surroundings(&mut self, walk: &Walk, place: &Place<'_>, known: &Surroundings<'_>) {
        for part in 0..LOOKS {
            let u = self.sampler.split_quad(DimensionSet::scattering(2 * VERTICES + walk.vertex), part, LOOKS);
            if let Some(sample) = place.bsdf.sample(u[0], [u[1], u[2]]).filter(is_broad_sample) {
                self.add_from(walk, place, known, &sample, 1.0 / LOOKS as f32);
            }
        }
    }

    /// Adds the reflection of the surrounding light from one direction.
    pub(super) fn add_from(
        &mut self,
        walk: &Walk,
        place: &Place<'_>,
        known: &Surroundings<'_>,
        sample: &BsdfSample,
        part: f32,
    ) {
        let wi = place.point.to_world(sample.wi);
        let is_reflection = sample.wi.z > 0.0 && place.point.is_reflection(wi);
        if is_reflection && self.bounces_left(walk) >= 2 {
            let light = walk.throughput * sample.weight() * known.radiance(wi) * part;
            let (p, normal) = (place.point.p, place.point.frame[2]);
            let bounces = self.bounces_left(walk);
            self.add_shared(light, walk.depth, |eye| eye.agents?.shares_at(p, normal, bounces));
        }
    }
}
