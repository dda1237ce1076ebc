//! Points of irradiance records, and the light that arrives there.

use bottega_kernels::Ray;
use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    super::super::transport::SCATTERED_SPREAD,
    Eye, VERTICES,
    walk::{ArrivalKind, Place, Walk, scatter},
};
use crate::{
    camera::{CameraRay, RayCone},
    interaction::Interaction,
    lights::Receiver,
    photon::cache,
    sampler::DimensionSet,
    shading::{BLEND, bsdf_at, is_matte},
};

/// A visible matte point where an irradiance record may be placed.
pub(in crate::integrator) struct Spot {
    point: Interaction,
    /// Width of the ray cone there.
    width: f32,
}

impl Spot {
    /// Creates a spot with the width of its ray cone or of the surroundings that it represents.
    pub(in crate::integrator) fn new(point: Interaction, width: f32) -> Self {
        Self { point, width }
    }

    /// Returns the position.
    pub(in crate::integrator) fn p(&self) -> Vec3 {
        self.point.p
    }

    /// Returns the shading normal.
    pub(in crate::integrator) fn n(&self) -> Vec3 {
        self.point.frame[2]
    }

    /// Returns the width of the ray cone.
    pub(in crate::integrator) fn width(&self) -> f32 {
        self.width
    }
}

impl Eye<'_> {
    /// Finds the first matte surface that the camera sees, over mirrors and through glass.
    pub(in crate::integrator) fn spot(&mut self, ray: &CameraRay) -> Option<Spot> {
        /// Greatest number of mirrors on the way.
        const MIRRORS_MAX: u32 = 8;
        let prepared = self.prepared;
        let mut walk = Walk::of_camera(ray);
        for _ in 0..=MIRRORS_MAX {
            let t_max = std::mem::replace(&mut walk.reach, f32::INFINITY);
            let hit = self.intersect(&Ray { t_max, ..Ray::new(walk.origin, walk.direction) }, walk.vertex);
            if hit.is_none() {
                return None;
            }
            // Evaluate the surface at the hit
            walk.cone = walk.cone.at(hit.t);
            let point = Interaction::new(prepared, &hit, walk.origin, walk.direction, walk.cone);
            let mut kept = None;
            let chance = || self.sampler.hashed(BLEND ^ u64::from(walk.vertex) << 56 ^ u64::from(point.material));
            let bsdf = bsdf_at(prepared, &point, chance, &mut kept);
            if bsdf.has_non_delta() {
                // Stop at the first surface that is not specular
                return is_matte(bsdf).then_some(Spot { width: walk.cone.width, point });
            }
            let wo = point.to_local(point.wo);
            let receiver = Receiver { p: point.p_outside, n: Vec3::ZERO };
            let place = Place { point: &point, bsdf: &bsdf.at(wo), receiver, wo };
            // Follow the mirror or the glass
            let u = self.sampler.quad(DimensionSet::scattering(walk.vertex));
            let sample = place.bsdf.sample(u[0], [u[1], u[2]])?;
            if !scatter(prepared, &mut walk, &place, &sample, 1.0) {
                return None;
            }
        }
        None
    }

    /// Returns the indirect radiance that arrives at a spot from a direction, without emission seen directly.
    ///
    /// - `index`: number of the ray, for its random numbers.
    pub(in crate::integrator) fn look_from(&mut self, spot: &Spot, direction: Vec3, index: u32) -> cache::GatherSample {
        let point = &spot.point;
        let nothing = cache::GatherSample { radiance: Spectrum::ZERO, distance: f32::INFINITY };
        if !point.is_reflection(direction) {
            return nothing;
        }
        let origin = point.ray_origin(direction);
        let hit = self.intersect(&Ray::new(origin, direction), 0);
        if hit.is_none() {
            return nothing;
        }
        let cone = RayCone { width: spot.width, spread: SCATTERED_SPREAD };
        let ray = CameraRay { origin, direction, cone, start: 0.0, reach: f32::INFINITY };
        let mut walk = Walk {
            depth: 1,
            vertex: VERTICES * (2 + index),
            comes: ArrivalKind::Mirrored { sharply: false },
            ..Walk::of_camera(&ray)
        };
        self.radiance = Spectrum::ZERO;
        let mut goes_on = self.arrive(&mut walk, hit);
        while goes_on {
            goes_on = self.step(&mut walk);
        }
        let radiance = if self.radiance.is_finite() { self.radiance } else { Spectrum::ZERO };
        cache::GatherSample { radiance, distance: hit.t }
    }
}
