//! The rays of a segment of a path: the closest hit, and the visibility of lights from its start.

use bottega_kernels::{Hit, Ray};
use bottega_scene::Visibility;

use crate::{
    interaction::{SurfaceQuery, is_there, shines},
    prepare::PreparedScene,
    sampler::PixelSampler,
    shading::DEPTH_SHIFT,
};

/// Traces the rays that leave a vertex of a path. Semi-transparent surfaces let a ray pass at random. The decision
/// depends only on the vertex, the kind of ray and the surface, so one ray may test its hits in any order and more than
/// once.
#[derive(Clone, Copy)]
pub(crate) struct SegmentRays<'a> {
    prepared: &'a PreparedScene,
    sampler: &'a PixelSampler,
    /// Key of the random decisions.
    key: u64,
    /// Kind of the rays that look for the next vertex.
    kind: SurfaceQuery,
    /// Time of the rays, from 0 to 1.
    time: f32,
}

impl<'a> SegmentRays<'a> {
    /// Returns the rays of a path that starts at the camera.
    ///
    /// - `vertex`: index of the vertex that the rays leave; 0: the camera.
    #[inline(always)]
    pub(crate) fn of_path(prepared: &'a PreparedScene, sampler: &'a PixelSampler, vertex: u32) -> Self {
        Self { kind: SurfaceQuery::Path.of_vertex(vertex), ..Self::of_photon(prepared, sampler, vertex) }
    }

    /// Returns the rays of a path that starts at a light.
    ///
    /// - `vertex`: index of the vertex that the rays leave; 0: the light.
    #[inline(always)]
    pub(crate) fn of_photon(prepared: &'a PreparedScene, sampler: &'a PixelSampler, vertex: u32) -> Self {
        let kind = if vertex == 0 { SurfaceQuery::Photon } else { SurfaceQuery::Path };
        Self { prepared, sampler, key: u64::from(vertex) << DEPTH_SHIFT, kind, time: 0.0 }
    }

    /// Returns these rays at a time of the shutter, from 0 to 1.
    #[inline(always)]
    pub(crate) fn at(self, time: f32) -> Self {
        Self { time, ..self }
    }

    /// Returns these rays for a path that left an event of this kind; the rays of the camera stay what they are.
    #[inline(always)]
    pub(crate) fn leaving(self, event: Visibility) -> Self {
        let kind = if self.kind == SurfaceQuery::Path { SurfaceQuery::Bounce(event) } else { self.kind };
        Self { kind, ..self }
    }

    /// Returns these rays for a path whose vertices have numbers above 255: also uses the bits of the number that the
    /// key loses.
    #[inline(always)]
    pub(crate) fn with_high_bits(self, vertex: u32) -> Self {
        Self { key: self.key ^ u64::from(vertex) >> (u64::BITS - DEPTH_SHIFT), ..self }
    }

    /// Returns `true` if a candidate hit of a ray that looks for the next vertex counts, by opacity and visibility.
    #[inline(always)]
    pub(crate) fn meets(&self, ray: &Ray, hit: &Hit) -> bool {
        self.is_there(ray, hit, self.kind)
    }

    /// Returns `true` if a candidate hit of a shadow ray counts, by opacity.
    #[inline(always)]
    pub(crate) fn blocks(&self, ray: &Ray, hit: &Hit) -> bool {
        self.is_there(ray, hit, SurfaceQuery::Shadow)
    }

    #[inline(always)]
    fn is_there(&self, ray: &Ray, hit: &Hit, query: SurfaceQuery) -> bool {
        is_there(self.prepared, ray, self.time, hit, query, |surface| self.sampler.hashed(surface ^ self.key))
    }

    /// Returns the closest hit of a ray.
    #[inline(always)]
    pub(crate) fn intersect(&self, ray: &Ray) -> Hit {
        if self.prepared.has_opacity() {
            self.prepared.accel().intersect_filtered(ray, |hit| self.meets(ray, hit))
        } else {
            self.prepared.accel().intersect(ray)
        }
    }

    /// Returns the closest hit of a camera ray that does not see emitters.
    #[inline(always)]
    pub(crate) fn intersect_unlit(&self, ray: &Ray) -> Hit {
        let is_seen = |hit: &Hit| !shines(self.prepared, hit) && self.meets(ray, hit);
        self.prepared.accel().intersect_filtered(ray, is_seen)
    }

    /// Returns `true` if a shadow ray hits something opaque.
    #[inline(always)]
    pub(crate) fn is_occluded(&self, ray: &Ray) -> bool {
        if self.prepared.has_opacity() {
            self.prepared.accel().occluded_filtered(ray, |hit| self.blocks(ray, hit))
        } else {
            self.prepared.accel().occluded(ray)
        }
    }
}
