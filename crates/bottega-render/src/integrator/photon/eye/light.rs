//! The light that a camera path finds directly: by sampling lights, and by hitting emitters.

use bottega_scene::Spectrum;

use super::{
    super::super::transport::{emitted_at, power_heuristic, shadow_ray},
    Eye,
    gathering::Aiming,
    walk::{ArrivalKind, LightShare, Place, Walk},
};
use crate::{
    interaction::Interaction,
    lights::{NO_LIGHT, Receiver},
    sampler::{DimensionSet, Quad},
};

impl Eye<'_> {
    /// Returns the MIS weight of light that the path hit; 0 where photons account for it.
    ///
    /// - `light_pdf`: returns the density with which light sampling finds it from the last BSDF that was not specular.
    fn found(&self, walk: &Walk, light_pdf: impl FnOnce(&Receiver) -> f32) -> f32 {
        match &walk.comes {
            ArrivalKind::Camera | ArrivalKind::Mirrored { sharply: true } => 1.0,
            ArrivalKind::Mirrored { sharply: false } => 0.0,
            ArrivalKind::Spread { receiver, pdf, .. } => {
                power_heuristic(*pdf, self.light_samples() as f32 * light_pdf(receiver))
            }
        }
    }

    /// Returns the number of light samples per vertex, at least 1.
    fn light_samples(&self) -> u32 {
        self.integrator.base.settings().light_samples.max(1)
    }

    /// Adds the environment's radiance along the ray, weighted by MIS.
    pub(super) fn add_environment(&mut self, walk: &Walk) {
        let from = match &walk.comes {
            ArrivalKind::Camera | ArrivalKind::Mirrored { .. } => walk.origin,
            ArrivalKind::Spread { receiver, .. } => receiver.p,
        };
        let lights = self.prepared.lights();
        let radiance = lights.environment_radiance(self.prepared.scene(), from, walk.direction);
        if radiance != Spectrum::ZERO {
            let weight = self.found(walk, |from| lights.environment_pdf(from, walk.direction));
            self.add(walk.throughput * radiance * weight, walk.depth);
        }
    }

    /// Adds the emission of a surface towards the path, weighted by MIS.
    pub(super) fn add_emission(&mut self, walk: &Walk, point: &Interaction) {
        let prepared = self.prepared;
        let radiance = emitted_at(prepared, point);
        if radiance != Spectrum::ZERO {
            let weight = self.found(walk, |from| prepared.lights().hit_pdf(prepared, &point.hit, from, point.p));
            self.add(walk.throughput * radiance * weight, walk.depth);
        }
    }

    /// Samples lights at a surface (next-event estimation).
    ///
    /// - `share`: all light, or the share by MIS.
    /// - `aiming`: distribution that gathering rays are drawn from in addition to the BSDF.
    pub(super) fn add_direct_light(
        &mut self,
        walk: &Walk,
        place: &Place<'_>,
        share: LightShare,
        aiming: Option<Aiming<'_>>,
    ) {
        let prepared = self.prepared;
        if prepared.lights().is_empty() {
            return;
        }
        let count = self.light_samples();
        for part in 0..count {
            // Sample a light
            let u: Quad = self.sampler.split_quad(DimensionSet::light(walk.vertex), part, count);
            let Some(light) = prepared.lights().sample(prepared, &place.receiver, u) else { continue };
            let wi = place.point.to_local(light.wi);
            if (wi.z > 0.0) != place.point.is_reflection(light.wi) {
                continue;
            }
            let (value, own_pdf) = place.bsdf.eval_pdf(wi);
            // Weight by MIS, against the density that gathering rays are drawn with
            let bsdf_pdf = aiming.map_or(own_pdf, |aiming| aiming.pdf(light.wi, own_pdf));
            let expected = count as f32 * light.pdf;
            let is_whole = light.is_delta || share == LightShare::All;
            let weight = if is_whole { 1.0 } else { power_heuristic(expected, bsdf_pdf) };
            let contribution = value * light.radiance * (wi.z.abs() * weight / expected);
            if contribution == Spectrum::ZERO {
                continue;
            }
            // Look up the visibility, or trace a shadow ray
            let known = self.known_visibility(place.point, light.light);
            self.hands.tally.shadow_spared += u64::from(known.is_some());
            self.hands.tally.shadow_traced += u64::from(known.is_none());
            let is_lit = match known {
                Some(is_lit) => is_lit,
                None => !self.is_occluded(&shadow_ray(place.point, &light), walk.vertex),
            };
            if is_lit {
                self.add(walk.throughput * contribution, walk.depth + 1);
            }
        }
    }

    /// Returns `true` or `false` where agents or shadow photons know the visibility of a light; `None`: trace a shadow
    /// ray.
    fn known_visibility(&mut self, point: &Interaction, light: u32) -> Option<bool> {
        // Unknown: semi-transparent surfaces cast partial shadows, and the environment has no light number
        let is_told = light != NO_LIGHT && !self.prepared.has_opacity();
        let normal = if point.front { point.ng } else { -point.ng };
        match self.agents {
            _ if !is_told => None,
            Some(agents) => agents.visibility_at(point.p, normal, light),
            None if self.integrator.photons.shadow_photons => {
                self.maps.visibility_at(point.p, normal, light, &mut self.hands.found)
            }
            None => None,
        }
    }
}
