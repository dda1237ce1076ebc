//! The light that a path through media finds: by sampling lights, and by hitting emitters.

use bottega_scene::{Spectrum, Surface, Visibility};
use glam::Vec3;

use super::{
    super::transport::{emitted_at, power_heuristic, weight_of_hit},
    state::{ArrivingLight, MediumPath, SegmentPoint},
};
use crate::{
    density::SolidAnglePdf,
    interaction::Interaction,
    lights::{FarLight, LightSample, NO_LIGHT, PathEnd, Receiver, Segment},
    media::{Homogeneous, Phase, channel_probabilities},
    sampler::DimensionSet,
    settings::DirectLight,
    vertex::SurfaceVertex,
};

impl MediumPath<'_> {
    /// Returns the radiance from infinity along the ray, weighted by MIS.
    pub(super) fn environment(&self) -> Spectrum {
        let mut sum = Spectrum::ZERO;
        self.each_far(|_, radiance| sum += radiance);
        sum
    }

    /// Calls `add` with the radiance of each light at infinity along the ray, weighted by MIS.
    fn each_far(&self, mut add: impl FnMut(FarLight, Spectrum)) {
        if self.depth == 0 && (self.hides_emitters || self.catchers.hides_far()) {
            return;
        }
        let lights = self.prepared.lights();
        let from = self.previous.receiver.p;
        lights.each_far(self.prepared.scene(), from, self.direction, self.event, |light, radiance| {
            let pdf = |from: &Receiver| (lights.far_pdf(from, None, light, self.direction), SolidAnglePdf::ZERO);
            add(light, radiance * self.found_by_direction(pdf));
        });
    }

    /// Adds the light from the end of a segment.
    ///
    /// - `share`: throughput of the path, with the transmittance of the segment.
    pub(super) fn add_arriving(&mut self, share: Spectrum, arriving: ArrivingLight<'_>) {
        self.add(share * arriving.radiance, self.depth);
        let Some(mut sums) = self.groups.take() else { return };
        let groups = sums.groups();
        let end = PathEnd { depth: self.depth, is_mirror: self.previous.pdf.is_none() };
        match arriving.point {
            Some(point) => sums.add(groups.of_hit(&point.hit, end), share * arriving.radiance),
            None => self.each_far(|light, radiance| sums.add(groups.of_far(light, end), share * radiance)),
        }
        self.groups = Some(sums);
    }

    /// Returns the emission of a surface towards the path, weighted by MIS.
    pub(super) fn emission(&self, point: &Interaction) -> Spectrum {
        let prepared = self.prepared;
        let scene = &**prepared.scene();
        let (material, known) = prepared.material(point.material);
        if let Surface::Unlit(color) = &material.surface {
            return point.unlit(scene, color);
        }
        if !known.shines || known.is_null || !material.emission_sides.has(point.front) {
            return Spectrum::ZERO;
        }
        let radiance = emitted_at(prepared, point, self.time);
        if radiance == Spectrum::ZERO {
            return radiance;
        }
        let lights = prepared.lights();
        // Weight against a light sample at the previous vertex, and against a distance drawn for this light
        radiance
            * self.found_by_direction(|from| {
                let Some(light) = lights.light_of(prepared, &point.hit) else {
                    return (SolidAnglePdf::ZERO, SolidAnglePdf::ZERO);
                };
                let place = lights.place_pdf_at(prepared, light, from.p, point.p, self.time);
                let along = self.previous.along.as_ref().map_or(0.0, |along| self.pdf_ratio(along, light));
                (lights.pmf(from, light) * place, along * place)
            })
    }

    /// Returns the density of drawing this distance for a light, times that light's probability, divided by the density
    /// of drawing it by extinction.
    fn pdf_ratio(&self, along: &SegmentPoint, light: u32) -> f32 {
        let lights = self.prepared.lights();
        let arc = lights.arc_at(self.prepared, &along.segment, light, self.time);
        lights.pmf_along(&along.segment, light) * arc.pdf(along.distance) / along.pdf
    }

    /// Returns the MIS weight of light that the path hit.
    ///
    /// - `pdfs`: returns the densities of both other ways to find it from the previous vertex: by a light sample there,
    ///   and by a distance drawn for the light.
    fn found_by_direction(&self, pdfs: impl FnOnce(&Receiver) -> (SolidAnglePdf, SolidAnglePdf)) -> f32 {
        weight_of_hit(self.settings.direct_light, self.previous.pdf, || {
            let (sampled, along) = pdfs(&self.previous.receiver);
            [self.light_samples() as f32 * sampled, along]
        })
    }

    /// Returns the number of light samples per vertex, at least 1.
    fn light_samples(&self) -> u32 {
        self.settings.light_samples.max(1)
    }

    /// Returns `true` if direct light is sampled at all.
    pub(super) fn samples_lights(&self) -> bool {
        self.settings.direct_light != DirectLight::BsdfSampling && !self.prepared.lights().is_empty()
    }

    /// Returns `pdf`, the density of a direction by scattering, if scattering can find the light sample, too; else 0.
    fn shared(&self, light: &LightSample, pdf: SolidAnglePdf) -> SolidAnglePdf {
        let is_alone = light.is_delta || self.settings.direct_light != DirectLight::Combined;
        if is_alone { SolidAnglePdf::ZERO } else { pdf }
    }

    /// Adds light scattered at a distance that is drawn for one light.
    pub(super) fn add_light_along(&mut self, medium: &Homogeneous, segment: &Segment) {
        if !self.samples_lights() {
            return;
        }
        let (prepared, lights) = (self.prepared, self.prepared.lights());
        let [u_light, u_distance, u, v] = self.sampler.quad(DimensionSet::along(self.segment));
        // Sample a light for the segment, and a distance uniform in its angle
        let Some((light, pmf)) = lights.sample_along(segment, u_light) else { return };
        let arc = lights.arc_at(prepared, segment, light, self.time);
        let distance = arc.sample(u_distance);
        let pdf = pmf * arc.pdf(distance);
        if !(distance < segment.length && pdf > 0.0) {
            return;
        }
        let p = segment.origin + segment.direction * distance;
        // Sample a point on the light
        let Some(sample) = lights.sample_place_at(prepared, light, p, [u, v], self.time) else { return };
        if !sample.visibility.has(Visibility::VOLUME) {
            return;
        }
        let phase = medium.phase.eval(segment.direction.dot(sample.wi));
        // Weight against both ways that draw the distance by extinction
        let by_extinction = medium.distance_pdf(channel_probabilities(self.throughput), distance) / pdf;
        let pmf_there = lights.pmf(&Receiver { p, n: Vec3::ZERO }, light);
        let others = [
            by_extinction * self.light_samples() as f32 * pmf_there * sample.pdf,
            by_extinction * self.shared(&sample, SolidAnglePdf::new(phase)),
        ];
        let weight = power_heuristic(sample.pdf, others) / (pdf * sample.pdf).per_sr();
        let scattered = medium.transmittance(distance) * medium.scattering * phase;
        let contribution = self.throughput * scattered * sample.radiance * weight;
        self.add_if_seen(contribution, p, p, &sample, self.medium);
    }

    /// Adds light scattered at a point in a medium, by sampling lights from there.
    ///
    /// - `along`: density of the point on its segment, if light there is found in several ways.
    pub(super) fn add_light_at(
        &mut self,
        phase: Phase,
        direction: Vec3,
        receiver: &Receiver,
        along: Option<&SegmentPoint>,
    ) {
        if !self.samples_lights() {
            return;
        }
        let count = self.light_samples();
        for part in 0..count {
            let u = self.sampler.split_quad(DimensionSet::light(self.depth), part, count);
            let Some(light) = self.prepared.lights().sample_at(self.prepared, receiver, u, self.time) else { continue };
            if !light.visibility.has(Visibility::VOLUME) {
                continue;
            }
            let value = phase.eval(direction.dot(light.wi));
            let expected = count as f32 * light.pdf;
            // Weight against the distance drawn for this light, and against the phase function
            let by_arc = match along {
                Some(along) if light.light != NO_LIGHT => self.pdf_ratio(along, light.light) * light.pdf_of_place(),
                _ => SolidAnglePdf::ZERO,
            };
            let weight = power_heuristic(expected, [by_arc, self.shared(&light, SolidAnglePdf::new(value))]);
            let contribution = self.throughput * light.radiance * (value * weight / expected.per_sr());
            self.add_if_seen(contribution, receiver.p, receiver.p, &light, self.medium);
        }
    }

    /// Samples lights at a surface (next-event estimation).
    ///
    /// - `has_interior`: `true`: light from behind comes by a random walk through the substance below alone.
    pub(super) fn add_direct_light(&mut self, vertex: &SurfaceVertex<'_>, has_interior: bool) {
        let (point, receiver) = (vertex.point, &vertex.receiver);
        let count = self.light_samples();
        for part in 0..count {
            // Sample a light
            let u = self.sampler.split_quad(DimensionSet::light(self.depth), part, count);
            let Some(light) = self.prepared.lights().sample_at(self.prepared, receiver, u, self.time) else { continue };
            if has_interior && !point.is_reflection(light.wi) {
                continue;
            }
            // Compute the contribution if it is visible
            let mis_weight = |expected: SolidAnglePdf, pdf| power_heuristic(expected, [self.shared(&light, pdf)]);
            let Some(weight) = vertex.light_weight(&light, count as f32, mis_weight) else { continue };
            let share = share_that_finds(vertex, &light);
            let contribution = self.throughput * weight.value * light.radiance * (weight.factor * share);
            // Add the light, attenuated by all that is in the way
            let medium = self.medium_towards(point, light.wi);
            self.add_if_seen(contribution, receiver.p, point.ray_origin(light.wi), &light, medium);
        }
    }
}

/// Returns the share of what a vertex scatters from a light sample that finds the light, by its visibility. A sample of the
/// BSDF in the same direction comes from a diffuse lobe with the probability that stands here for that lobe's share.
fn share_that_finds(vertex: &SurfaceVertex<'_>, light: &LightSample) -> f32 {
    let finds = |kind: Visibility| if light.visibility.has(kind) { 1.0 } else { 0.0 };
    if light.visibility.has(Visibility::BOUNCES) {
        return 1.0;
    }
    let wi = vertex.point.to_local(light.wi);
    if wi.z < 0.0 {
        return finds(Visibility::TRANSMISSION);
    }
    let diffuse = vertex.bsdf.diffuse_share(wi);
    diffuse * finds(Visibility::DIFFUSE) + (1.0 - diffuse) * finds(Visibility::GLOSSY)
}
