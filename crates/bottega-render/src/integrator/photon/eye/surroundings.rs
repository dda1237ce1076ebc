//! Light that agents know by direction, on surfaces that are not matte.

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

/// Directions in which a surface that the camera sees is told what comes from there: no ray is traced for them.
const LOOKS: u32 = 16;

impl<'a> Eye<'a> {
    /// What agents know of the light that comes from all sides to a surface that is not matte.
    pub(super) fn surroundings(&mut self, walk: &Walk, place: &Place<'_>, bsdf: &Bsdf) -> Option<Surroundings<'a>> {
        let bounces = self.bounces_left(walk);
        if is_matte(bsdf) || bsdf.is_transmissive() {
            return None;
        }
        let known = self.agents?.surroundings_at(place.point.p, place.point.frame[2], bounces, self.fade(walk));
        self.hands.tally.irradiance_interpolated += u64::from(known.is_some());
        known
    }

    /// How near agents must be at a place to be asked of its light, in [0, 1): a number by chance where the camera sees it, so that what they
    /// say has no edges.
    pub(super) fn fade(&self, walk: &Walk) -> f32 {
        /// No other number of a sample is drawn by it.
        const KEY: u64 = 0x6661_6465;
        if matches!(walk.comes, ArrivalKind::Camera) {
            self.sampler.hashed(KEY ^ u64::from(walk.vertex) << 32)
        } else {
            0.0
        }
    }

    /// Adds what a surface sends back of the light around it, in all directions that it scatters to broadly.
    pub(super) fn add_surroundings(&mut self, walk: &Walk, place: &Place<'_>, known: &Surroundings<'_>) {
        for part in 0..LOOKS {
            let u = self.sampler.split_quad(DimensionSet::scattering(2 * VERTICES + walk.vertex), part, LOOKS);
            if let Some(sample) = place.bsdf.sample(u[0], [u[1], u[2]]).filter(is_broad_sample) {
                self.add_from(walk, place, known, &sample, 1.0 / LOOKS as f32);
            }
        }
    }

    /// Adds what a surface sends back of the light from one direction.
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
