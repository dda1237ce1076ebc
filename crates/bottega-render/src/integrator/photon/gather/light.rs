//! The light that a camera path finds directly: by sampling lights, and by hitting emitters.

use bottega_scene::{Spectrum, Visibility};

use super::{
    super::super::transport::{emitted_at, power_heuristic, shadow_ray},
    GatherPath,
    directions::IncidentSampling,
    state::{ArrivalKind, GatherState, LightShare},
};
use crate::{
    density::SolidAnglePdf,
    interaction::Interaction,
    lights::{NO_LIGHT, Receiver},
    sampler::{DimensionSet, Quad},
    vertex::SurfaceVertex,
};

impl GatherPath<'_> {
    /// Returns the MIS weight of light that the path hit; 0 where photons account for it.
    ///
    /// - `light_pdf`: returns the density with which light sampling finds it from the last BSDF that was not specular.
    fn found(&self, state: &GatherState, light_pdf: impl FnOnce(&Receiver) -> SolidAnglePdf) -> f32 {
        match &state.comes {
            ArrivalKind::Camera | ArrivalKind::Mirrored { sharply: true } => 1.0,
            ArrivalKind::Mirrored { sharply: false } => 0.0,
            ArrivalKind::Spread { receiver, pdf, .. } => {
                power_heuristic(*pdf, [self.light_samples() as f32 * light_pdf(receiver)])
            }
        }
    }

    /// Returns the number of light samples per vertex, at least 1.
    fn light_samples(&self) -> u32 {
        self.integrator.base.settings().light_samples.max(1)
    }

    /// Adds the radiance from infinity along the ray, weighted by MIS.
    pub(super) fn add_environment(&mut self, state: &GatherState) {
        // Take the point of the last light sampling, for the MIS weight
        let from = match &state.comes {
            ArrivalKind::Camera | ArrivalKind::Mirrored { .. } => state.origin,
            ArrivalKind::Spread { receiver, .. } => receiver.p,
        };
        let lights = self.prepared.lights();
        let ray = if matches!(state.comes, ArrivalKind::Camera) { Visibility::CAMERA } else { Visibility::DIFFUSE };
        lights.each_far(self.prepared.scene(), from, state.direction, ray, |light, radiance| {
            let weight = self.found(state, |from| lights.far_pdf(from, None, light, state.direction));
            self.add(state.throughput * radiance * weight, state.depth);
        });
    }

    /// Adds the emission of a surface towards the path, weighted by MIS.
    pub(super) fn add_emission(&mut self, state: &GatherState, point: &Interaction) {
        let prepared = self.prepared;
        let radiance = emitted_at(prepared, point, 0.0);
        if radiance != Spectrum::ZERO {
            let weight = self.found(state, |from| prepared.lights().hit_pdf(prepared, &point.hit, from, point.p));
            self.add(state.throughput * radiance * weight, state.depth);
        }
    }

    /// Samples lights at a surface (next-event estimation).
    ///
    /// - `share`: all light, or the share by MIS.
    /// - `aiming`: distribution that gathering rays are drawn from in addition to the BSDF.
    pub(super) fn add_direct_light(
        &mut self,
        state: &GatherState,
        vertex: &SurfaceVertex<'_>,
        share: LightShare,
        aiming: Option<IncidentSampling<'_>>,
    ) {
        let prepared = self.prepared;
        if prepared.lights().is_empty() {
            return;
        }
        let count = self.light_samples();
        for part in 0..count {
            // Sample a light
            let u: Quad = self.sampler.split_quad(DimensionSet::light(state.vertex), part, count);
            let Some(light) = prepared.lights().sample(prepared, &vertex.receiver, u) else { continue };
            // Weight by MIS, against the density that gathering rays are drawn with
            let mis_weight = |expected: SolidAnglePdf, bsdf_pdf: SolidAnglePdf| {
                if light.is_delta || share == LightShare::All {
                    return 1.0;
                }
                power_heuristic(expected, [aiming.map_or(bsdf_pdf, |aiming| aiming.pdf(light.wi, bsdf_pdf))])
            };
            let Some(weight) = vertex.light_weight(&light, count as f32, mis_weight) else { continue };
            let contribution = weight.value * light.radiance * weight.factor;
            if contribution == Spectrum::ZERO {
                continue;
            }
            // Look up the visibility, or trace a shadow ray
            let known = self.known_visibility(vertex.point, light.light);
            self.buffers.tally.shadow_spared += u64::from(known.is_some());
            self.buffers.tally.shadow_traced += u64::from(known.is_none());
            let is_lit = match known {
                Some(is_lit) => is_lit,
                None => !self.is_occluded(&shadow_ray(vertex.point, &light), state.vertex),
            };
            if is_lit {
                self.add(state.throughput * contribution, state.depth + 1);
            }
        }
    }

    /// Returns `true` or `false` where agents or shadow photons know the visibility of a light; `None`: trace a shadow
    /// ray.
    fn known_visibility(&mut self, point: &Interaction, light: u32) -> Option<bool> {
        // Unknown: semi-transparent surfaces cast partial shadows, and the environment has no light number
        let is_known = light != NO_LIGHT && !self.prepared.has_opacity();
        let normal = point.facing_ng();
        match self.agents {
            _ if !is_known => None,
            Some(agents) => agents.visibility_at(point.p, normal, light),
            None if self.integrator.photons.shadow_photons => {
                self.maps.visibility_at(point.p, normal, light, &mut self.buffers.found)
            }
            None => None,
        }
    }
}
