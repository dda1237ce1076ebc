//! The light that a path finds: by sampling lights, and by hitting emitters.

use bottega_kernels::{Hit, Ray};
use bottega_scene::{Spectrum, Visibility};

use super::{
    super::transport::{emitted_at, power_heuristic, shadow_ray, weight_of_hit},
    state::Path,
    suspended::DeferredLight,
    vertex::PathVertex,
};
use crate::{
    color::luminance,
    density::SolidAnglePdf,
    interaction::Interaction,
    lights::{LightSample, PathEnd, Receiver, RequestedLight},
    sampler::{DimensionSet, Quad},
    settings::DirectLight,
};

/// Factor of the probability of a shadow ray, next to the importance of the light sample to the pixel and √(visible
/// share): √(cost of a vertex ∕ cost of a shadow ray), rounded up for caution.
const LOOKS: f32 = 3.0;
/// Least probability of a shadow ray: visible light is weighted by at most four. A lower limit saves no measurable time.
const LOOKS_MIN: f32 = 0.25;

impl Path<'_> {
    /// Adds the light from infinity in the path's direction, weighted by MIS.
    #[inline(always)]
    pub(super) fn add_environment<const AGENTS: bool>(&mut self) {
        if self.depth == 0 && self.integrator.hides_emitters {
            return;
        }
        let prepared = self.integrator.prepared;
        let from = self.previous.receiver.p;
        let (lights, direction) = (prepared.lights(), self.direction);
        let ray = if self.depth == 0 { Visibility::CAMERA } else { Visibility::DIFFUSE };
        lights.each_far(prepared.scene(), from, direction, ray, |light, radiance| {
            let weight = self.found_by_bsdf(|from| {
                let choice = if AGENTS { self.previous_choice() } else { None };
                lights.far_pdf(from, choice, light, direction)
            });
            let found = self.throughput * radiance * weight;
            self.radiance += found;
            let end = self.end();
            if let Some(sums) = &mut self.groups {
                sums.add(sums.groups().of_far(light, end), found);
            }
        });
    }

    /// Adds the emission of a surface towards the path, weighted by MIS.
    #[inline(always)]
    pub(super) fn add_emission<const AGENTS: bool>(&mut self, point: &Interaction) {
        let prepared = self.integrator.prepared;
        let radiance = emitted_at(prepared, point, 0.0);
        if radiance == Spectrum::ZERO {
            return;
        }
        let (hit, p) = (point.hit, point.p);
        let weight = self.found_by_bsdf(|from| {
            let choice = if AGENTS { self.previous_choice() } else { None };
            prepared.lights().hit_pdf_by(prepared, &hit, from, p, choice)
        });
        self.add_of_hit(&hit, self.throughput * radiance * weight);
    }

    /// Adds light of a surface that was hit.
    #[inline(always)]
    pub(super) fn add_of_hit(&mut self, hit: &Hit, light: Spectrum) {
        self.radiance += light;
        let end = self.end();
        if let Some(sums) = &mut self.groups {
            sums.add(sums.groups().of_hit(hit, end), light);
        }
    }

    /// Returns the end of the path at its next ray.
    #[inline(always)]
    fn end(&self) -> PathEnd {
        PathEnd { depth: self.depth, is_mirror: self.previous.pdf.is_none() }
    }

    /// Returns the MIS weight of light that the path hit.
    ///
    /// - `light_pdf`: returns the density with which light sampling finds it from the previous vertex.
    #[inline(always)]
    fn found_by_bsdf(&self, light_pdf: impl FnOnce(&Receiver) -> SolidAnglePdf) -> f32 {
        let settings = self.integrator.settings;
        weight_of_hit(settings.direct_light, self.previous.pdf, || {
            [settings.light_samples.max(1) as f32 * light_pdf(&self.previous.receiver)]
        })
    }

    /// Samples lights at a vertex (next-event estimation).
    ///
    /// - `first`: the random numbers of the light sample if there is only one.
    /// - `deferred`: receives the light samples with their shadow rays; see [`Self::meet`].
    #[inline(always)]
    pub(super) fn add_direct_light<const AGENTS: bool>(
        &mut self,
        vertex: &PathVertex<'_>,
        first: Quad,
        deferred: &mut Vec<DeferredLight>,
    ) {
        let settings = self.integrator.settings;
        let prepared = self.integrator.prepared;
        if settings.direct_light == DirectLight::BsdfSampling || prepared.lights().is_empty() {
            return;
        }
        let count = settings.light_samples.max(1);
        for part in 0..count {
            // Sample a light, by the agent's choice or by the light tree
            let set = DimensionSet::light(self.depth);
            let u = if count == 1 { first } else { self.sampler.split_quad(set, part, count) };
            let choice = if AGENTS { vertex.guidance.lights() } else { None };
            let looks_rarely = AGENTS && self.integrator.looks_rarely;
            let drawn = match choice.filter(|_| settings.agents.lights) {
                Some(choice) => prepared.lights().sample_by(prepared, &vertex.surface.receiver, choice, u),
                None => prepared.lights().sample(prepared, &vertex.surface.receiver, u),
            };
            let Some(light) = drawn else { continue };
            // Compute the contribution if it is visible
            let contribution = self.light_contribution(vertex, &light, count as f32);
            if self.trail.is_some() {
                self.add_and_record(&shadow_ray(vertex.surface.point, &light), light.light, contribution);
                continue;
            }
            if contribution == Spectrum::ZERO {
                continue;
            }
            // Choose whether to trace a shadow ray, by the importance of the contribution
            let seen = choice.filter(|_| looks_rarely).map_or(1.0, |choice| choice.seen(light.light));
            let share = if looks_rarely { self.share_of_looks(contribution, seen) } else { 1.0 };
            if !self.is_due(share, u[3]) {
                continue;
            }
            // Defer the test of visibility, unless it depends on this vertex, as where surfaces let rays pass
            self.record.counts.shadow_rays += 1;
            let ray = shadow_ray(vertex.surface.point, &light);
            let groups = self.groups.as_ref().map_or(0, |sums| sums.groups().of_sample(&light, self.depth));
            let light = DeferredLight { ray, light: self.throughput * contribution / share, groups };
            if prepared.has_opacity() {
                self.add_if_visible(&light);
            } else {
                deferred.push(light);
            }
        }
    }

    /// Traces the shadow ray of a light sample, and adds its light if the ray hits nothing.
    #[inline(always)]
    pub(in crate::integrator) fn add_if_visible(&mut self, sample: &DeferredLight) {
        if !self.is_occluded(&sample.ray) {
            self.radiance += sample.light;
            if let Some(sums) = &mut self.groups {
                sums.add(sample.groups, sample.light);
            }
        }
    }

    /// Returns the probability of tracing a shadow ray for a contribution.
    ///
    /// - `seen`: share of that light that is visible, as far as is known, in [0, 1].
    #[inline(always)]
    fn share_of_looks(&self, contribution: Spectrum, seen: f32) -> f32 {
        if self.worth <= 0.0 {
            return 1.0;
        }
        // Trace important light always, and faint or hardly visible light more rarely
        let worth = (self.throughput * contribution).max_element() * self.worth;
        (LOOKS * worth * seen.sqrt()).clamp(LOOKS_MIN, 1.0)
    }

    /// Decides by systematic Russian roulette whether to trace a shadow ray: one is due each time the running sum of
    /// the path's probabilities crosses an integer. So paths of many faint lights find nearly the same number of them
    /// each time, and no light is ever subtracted. Unbiased only while the probabilities do not depend on the results
    /// of shadow rays.
    ///
    /// - `share`: probability of this shadow ray, in [0, 1].
    /// - `u`: uniform random number, the start of the sum.
    #[inline(always)]
    fn is_due(&mut self, share: f32, u: f32) -> bool {
        // NaN: trace it; the sample's radiance is dropped in the end.
        if share >= 1.0 || share.is_nan() {
            return true;
        }
        // Start the running sum at a random number, and trace a ray when it crosses 1
        let sum = self.due.unwrap_or(u) + share;
        let is_due = sum >= 1.0;
        self.due = Some(if is_due { sum - 1.0 } else { sum });
        is_due
    }

    /// Adds a light sample if it is visible, and records the result for learning.
    fn add_and_record(&mut self, ray: &Ray, light: u32, contribution: Spectrum) {
        let mut is_seen = false;
        if contribution != Spectrum::ZERO {
            self.record.counts.shadow_rays += 1;
            is_seen = !self.is_occluded(ray);
        }
        if is_seen {
            self.radiance += self.throughput * contribution;
        }
        if let Some(trail) = &mut self.trail {
            trail.record_light(RequestedLight { light, found: luminance(contribution), is_seen });
        }
    }

    /// Returns what one of `count` light samples adds if it is visible, weighted by MIS, without the throughput.
    #[inline(always)]
    fn light_contribution(&self, vertex: &PathVertex<'_>, light: &LightSample, count: f32) -> Spectrum {
        // Weight by MIS if a direction drawn by the BSDF or the guide can find the same light
        let is_shared = !light.is_delta && self.integrator.settings.direct_light == DirectLight::Combined;
        let mis_weight = |expected: SolidAnglePdf, bsdf_pdf: SolidAnglePdf| {
            if is_shared { power_heuristic(expected, [vertex.guidance.pdf(light.wi, bsdf_pdf)]) } else { 1.0 }
        };
        match vertex.surface.light_weight(light, count, mis_weight) {
            Some(weight) => weight.value * light.radiance * weight.factor,
            None => Spectrum::ZERO,
        }
    }
}
