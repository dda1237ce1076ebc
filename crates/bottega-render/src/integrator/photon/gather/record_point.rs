//! Points of irradiance records, and the light that arrives there.

use bottega_kernels::Ray;
use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    super::super::transport::SCATTERED_SPREAD,
    GatherPath, VERTICES,
    state::{ArrivalKind, GatherState, scatter},
};
use crate::{
    camera::{CameraRay, RayCone},
    interaction::Interaction,
    lights::Receiver,
    photon::cache,
    sampler::DimensionSet,
    shading::is_matte,
    vertex::{SurfaceVertex, bsdf_at_vertex},
};

/// A visible matte point where an irradiance record may be placed.
pub(in crate::integrator) struct RecordPoint {
    point: Interaction,
    /// Width of the ray cone there.
    width: f32,
}

impl RecordPoint {
    /// Creates a point with the width of its ray cone or of the surroundings that it represents.
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

impl GatherPath<'_> {
    /// Finds the first surface that is not specular, over mirrors and through glass. `None`: it is not matte, or there
    /// is none.
    pub(in crate::integrator) fn find_record_point(&mut self, ray: &CameraRay) -> Option<RecordPoint> {
        /// Greatest number of mirrors on the way.
        const MIRRORS_MAX: u32 = 8;
        let prepared = self.prepared;
        let mut state = GatherState::of_camera(ray);
        for _ in 0..=MIRRORS_MAX {
            let t_max = std::mem::replace(&mut state.reach, f32::INFINITY);
            let hit = self.rays(state.vertex).intersect(&Ray { t_max, ..Ray::new(state.origin, state.direction) });
            if hit.is_none() {
                return None;
            }
            // Evaluate the surface at the hit
            state.cone = state.cone.at(hit.t);
            let point = Interaction::new(prepared, &hit, state.origin, state.direction, state.cone);
            let mut storage = None;
            let bsdf = bsdf_at_vertex(prepared, &point, &self.sampler, state.vertex, &mut storage);
            if bsdf.has_non_delta() {
                // Stop at the first surface that is not specular
                return is_matte(bsdf).then_some(RecordPoint { width: state.cone.width, point });
            }
            let wo = point.to_local(point.wo);
            let receiver = Receiver { p: point.p_outside, n: Vec3::ZERO };
            let vertex = SurfaceVertex { point: &point, bsdf: &bsdf.at(wo), receiver, wo };
            // Follow the mirror or the glass
            let u = self.sampler.quad(DimensionSet::scattering(state.vertex));
            let sample = vertex.bsdf.sample(u[0], [u[1], u[2]])?;
            if !scatter(prepared, &mut state, &vertex, &sample, 1.0) {
                return None;
            }
        }
        None
    }

    /// Returns the indirect radiance that arrives at a point from a direction, without emission seen directly.
    ///
    /// - `index`: number of the ray, for its random numbers.
    pub(in crate::integrator) fn gather_from(
        &mut self,
        from: &RecordPoint,
        direction: Vec3,
        index: u32,
    ) -> cache::GatherSample {
        let point = &from.point;
        let nothing = cache::GatherSample { radiance: Spectrum::ZERO, distance: f32::INFINITY };
        if !point.is_reflection(direction) {
            return nothing;
        }
        // Trace the ray to the next surface
        let origin = point.ray_origin(direction);
        let hit = self.rays(0).intersect(&Ray::new(origin, direction));
        if hit.is_none() {
            return nothing;
        }
        // Follow the path from there to its end
        let cone = RayCone { width: from.width, spread: SCATTERED_SPREAD };
        let ray = CameraRay { origin, direction, cone, start: 0.0, reach: f32::INFINITY, weight: 1.0 };
        let mut state = GatherState {
            depth: 1,
            vertex: VERTICES * (2 + index),
            comes: ArrivalKind::Mirrored { sharply: false },
            ..GatherState::of_camera(&ray)
        };
        self.radiance = Spectrum::ZERO;
        let mut goes_on = self.arrive(&mut state, hit);
        while goes_on {
            goes_on = self.step(&mut state);
        }
        let radiance = if self.radiance.is_finite() { self.radiance } else { Spectrum::ZERO };
        cache::GatherSample { radiance, distance: hit.t }
    }
}
