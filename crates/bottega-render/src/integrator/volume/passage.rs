//! The passage of light between two points: through boundaries of media, panes, and media.

use bottega_kernels::{Hit, Ray};
use bottega_scene::{MediumId, Spectrum};
use glam::Vec3;

use super::{super::transport::SHADOW_MARGIN, state::MediumPath};
use crate::{
    camera::RayCone,
    interaction::{Interaction, material_of},
    lights::LightSample,
    media::{PreparedMedium, varying::Line},
    sampler::PixelSampler,
    segment::SegmentRays,
    shading::bsdf_at,
    surfaces::PreparedMaterial,
};

/// Greatest number of boundaries that a path or a shadow ray crosses without scattering.
pub(super) const BOUNDARIES_MAX: u32 = 256;
/// Cost of a vertex, and of a shadow ray's segment, in traversal steps.
pub(super) const STEPS: f32 = 8.0;
/// Key of the random numbers of tracking, distinct from all other decisions.
const TRACKING: u64 = 0x7472_6163_6b69_6e67;

impl MediumPath<'_> {
    /// Returns `true` if a candidate hit of a ray that looks for the next vertex counts. Boundaries between two media
    /// always count.
    pub(super) fn meets(&self, ray: &Ray, hit: &Hit) -> bool {
        let known = self.prepared.material(material_of(self.prepared, hit)).1;
        let is_hidden = known.shines && self.depth == 0 && self.hides_emitters;
        !is_hidden && self.catchers.has(self.prepared, hit) && (is_boundary(known) || self.rays().meets(ray, hit))
    }

    /// Returns `true` if a candidate hit of a shadow ray counts. Boundaries between two media always count.
    fn blocks(&self, ray: &Ray, hit: &Hit) -> bool {
        let known = self.prepared.material(material_of(self.prepared, hit)).1;
        self.catchers.has(self.prepared, hit) && (is_boundary(known) || self.rays().blocks(ray, hit))
    }

    /// Returns the rays that leave the path's current vertex.
    fn rays(&self) -> SegmentRays<'_> {
        SegmentRays::of_path(self.prepared, &self.sampler, self.depth).leaving(self.event).at(self.time)
    }

    /// Returns the medium on the side of `wi`; `None`: vacuum.
    pub(super) fn medium_towards(&self, point: &Interaction, wi: Vec3) -> Option<MediumId> {
        self.medium_behind(point, wi, self.medium)
    }

    /// Returns the medium on the side of `wi` for light that arrived through `medium`.
    fn medium_behind(&self, point: &Interaction, wi: Vec3, medium: Option<MediumId>) -> Option<MediumId> {
        let known = self.prepared.material(point.material).1;
        if point.is_reflection(wi) || !known.parts_media { medium } else { known.media[usize::from(point.front)] }
    }

    /// Adds a light sample, attenuated by the media and surfaces on the way.
    ///
    /// - `contribution`: radiance that an unoccluded light adds.
    /// - `p`: the point that the light was sampled for.
    /// - `origin`: the start of the shadow ray.
    /// - `medium`: the medium at `origin`.
    pub(super) fn add_if_seen(
        &mut self,
        contribution: Spectrum,
        p: Vec3,
        mut origin: Vec3,
        light: &LightSample,
        mut medium: Option<MediumId>,
    ) {
        if contribution == Spectrum::ZERO {
            return;
        }
        let prepared = self.prepared;
        let is_far = light.distance.is_infinite();
        // Aim at the sampled point itself: its direction from another origin differs slightly
        let target = p + light.wi * light.distance;
        let mut transmittance = Spectrum::ONE;
        self.record.counts.shadow_rays += 1;
        for _ in 0..BOUNDARIES_MAX {
            self.record.values.cost += STEPS;
            // Aim the next segment of the shadow ray at the light
            let (direction, length) = if is_far {
                (light.wi, f32::INFINITY)
            } else {
                let to_light = target - origin;
                let length = to_light.length();
                (to_light / length, length)
            };
            let ray = Ray { origin, t_min: 0.0, direction, t_max: length * (1.0 - SHADOW_MARGIN) };
            // Find the next surface, or only test for occlusion
            let hit = if prepared.has_boundaries() {
                prepared.accel().intersect_filtered_at(&ray, self.time, |hit| self.blocks(&ray, hit))
            } else if prepared.accel().occluded_filtered_at(&ray, self.time, |hit| self.blocks(&ray, hit)) {
                return;
            } else {
                Hit::NONE
            };
            // Attenuate by the medium of this segment
            let length = hit.t.min(length);
            match medium.map(|medium| prepared.medium(medium)) {
                None => {}
                Some(PreparedMedium::Homogeneous(medium)) => transmittance *= medium.transmittance(length),
                Some(PreparedMedium::Varying(medium)) => {
                    let line = Line { origin, direction, length };
                    transmittance *= medium.transmittance(&line, numbers(self.sampler, &mut self.numbers_drawn));
                }
            }
            if hit.is_none() {
                let found = contribution * transmittance;
                self.add(found, self.depth + 1);
                if let Some(sums) = &mut self.groups {
                    sums.add(sums.groups().of_sample(light, self.depth), found);
                }
                return;
            }
            // Pass through a boundary or a pane, and continue behind it
            let point = Interaction::at(prepared, &hit, origin, direction, RayCone::default(), self.time);
            transmittance *= self.let_through(&point);
            if transmittance == Spectrum::ZERO {
                return;
            }
            medium = self.medium_behind(&point, direction, medium);
            origin = point.ray_origin(direction);
        }
    }

    /// Returns the share of light that a surface lets straight through: 1 at boundaries without a surface, 0 if opaque.
    fn let_through(&mut self, point: &Interaction) -> Spectrum {
        let known = self.prepared.material(point.material).1;
        if known.is_null || !known.is_pane {
            return if known.is_null { Spectrum::ONE } else { Spectrum::ZERO };
        }
        self.numbers_drawn += 1;
        let mut storage = None;
        let chance = || self.sampler.hashed(TRACKING ^ self.numbers_drawn);
        let bsdf = bsdf_at(self.prepared, point, chance, &mut storage);
        bsdf.straight(point.to_local(point.wo))
    }
}

/// Returns the sequence of random numbers of tracking; `drawn`: count of those already taken.
pub(super) fn numbers(sampler: PixelSampler, drawn: &mut u64) -> impl FnMut() -> f32 {
    move || {
        *drawn += 1;
        sampler.hashed(TRACKING ^ *drawn)
    }
}

/// Returns `true` if a surface is a boundary between two media without a surface of its own.
fn is_boundary(known: &PreparedMaterial) -> bool {
    known.is_null && known.media[0] != known.media[1]
}
