//! Path tracing through participating media.
//!
//! Light that is scattered on a segment of a path through a homogeneous medium is found in three ways, which are combined by the power heuristic: at a
//! distance drawn by extinction, by sampling a light from there (1) or by the phase function (2); and at a distance drawn
//! for a light, uniform by the angle as it sees the segment (3). What shines at the end of a segment is always counted,
//! weakened by the medium, wherever the path goes on. Through a medium that varies in space a path is tracked, and only the
//! first two ways are there.
//!
//! Sources: Kulla and Fajardo 2012, *Importance Sampling Techniques for Path Tracing in Participating Media*; Veach 1997,
//! *Robust Monte Carlo Methods for Light Transport Simulation*, chapter 9.

use bottega_kernels::{Hit, Ray};
use bottega_scene::{MediumId, Spectrum, Surface};
use glam::Vec3;

use super::{
    path::PathIntegrator,
    record::PathRecord,
    transport::{SCATTERED_SPREAD, SHADOW_MARGIN, emitted_at, survives},
};
use crate::{
    PathSettings, PreparedScene,
    bsdf::BsdfAt,
    camera::{CameraRay, RayCone},
    interaction::{Asks, Interaction, is_there, material_of},
    lights::{LightSample, NO_LIGHT, Receiver, Segment},
    media::{
        Filling, Homogeneous, Phase, channel_probabilities,
        varying::{Carried, Line, Varying},
    },
    sampler::{DimensionSet, PixelSampler},
    settings::DirectLight,
    shading::{BLEND, DEPTH_SHIFT, bsdf_at},
};

/// Boundaries of media that a path or a shadow ray may cross without being scattered.
const BOUNDARIES_MAX: u32 = 256;
/// Cost of a vertex, and of a shadow ray, in traversal steps.
const STEPS: f32 = 8.0;
/// Cost of a number that tracking takes, with the look at the grid that it is for, in traversal steps.
const TRACKING_STEPS: f32 = 2.0;
/// Sets the numbers that panes take apart from those that other decisions take.
const PANE: u64 = 0x7061_6e65_7061_6e65;
/// Sets the numbers of tracking apart from those that other decisions take.
const TRACKING: u64 = 0x7472_6163_6b69_6e67;

impl PathIntegrator<'_> {
    /// One sample in which media take part.
    pub(super) fn trace_volume(&self, x: u32, y: u32, sample_index: u32) -> PathRecord {
        let sampler = PixelSampler::new(self.settings().seed, x, y, sample_index);
        let (ray, factor) = self.camera_ray(&sampler, x, y);
        trace(self, sampler, &ray).scaled(factor)
    }
}

/// Follows one path. The integrator gives the camera and the settings.
fn trace(integrator: &PathIntegrator<'_>, sampler: PixelSampler, ray: &CameraRay) -> PathRecord {
    let (prepared, settings) = (integrator.prepared(), integrator.settings());
    let mut path = Path {
        prepared,
        settings,
        sampler,
        throughput: Spectrum::ONE,
        radiance: Spectrum::ZERO,
        medium: integrator.camera_medium(),
        eta_scale: 1.0,
        depth: 0,
        segment: 0,
        boundaries: 0,
        travelled: ray.start,
        reach: ray.reach,
        numbers_drawn: 0,
        origin: ray.origin,
        direction: ray.direction,
        cone: ray.cone,
        hides_emitters: integrator.hides_emitters(),
        previous: Previous { receiver: Receiver { p: ray.origin, n: Vec3::ZERO }, pdf: None, along: None },
        wants_albedo: integrator.wanted().albedo,
        wants_cost: integrator.wanted().cost,
        record: PathRecord::default(),
    };
    while path.advance() {}
    path.finish()
}

/// Where the path comes from, as far as multiple importance sampling must know.
#[derive(Clone, Copy)]
struct Previous {
    /// The point for which lights were sampled.
    receiver: Receiver,
    /// Density per solid angle of the direction taken; `None`: light sampling could not have found what comes.
    pdf: Option<f32>,
    /// Where that point is on a segment through a medium, if it is in one.
    along: Option<Along>,
}

/// A point of a segment through a medium.
#[derive(Clone, Copy)]
struct Along {
    segment: Segment,
    distance: f32,
    /// Density of the distance as drawn by extinction.
    pdf: f32,
}

/// A path under way.
struct Path<'a> {
    prepared: &'a PreparedScene,
    settings: &'a PathSettings,
    sampler: PixelSampler,
    throughput: Spectrum,
    radiance: Spectrum,
    /// What the path is in; `None`: vacuum.
    medium: Option<MediumId>,
    /// What the throughput owes to radiance that was squeezed into a denser solid, not to losses.
    eta_scale: f32,
    depth: u32,
    /// Segments so far; more than `depth` where boundaries of media were crossed.
    segment: u32,
    boundaries: u32,
    /// How far the path came since it was scattered last.
    travelled: f32,
    /// How far the next ray sees surfaces.
    reach: f32,
    /// Numbers that tracking took so far.
    numbers_drawn: u64,
    origin: Vec3,
    direction: Vec3,
    cone: RayCone,
    previous: Previous,
    hides_emitters: bool,
    wants_albedo: bool,
    wants_cost: bool,
    record: PathRecord,
}

impl Path<'_> {
    /// Goes to where the path is scattered next, or to the next boundary. False when it is at its end.
    fn advance(&mut self) -> bool {
        let prepared = self.prepared;
        let reach = std::mem::replace(&mut self.reach, f32::INFINITY);
        let ray = Ray { t_max: reach, ..Ray::new(self.origin, self.direction) };
        let hit = prepared.accel().intersect_filtered(&ray, |hit| self.is_there(&ray, hit, Asks::Path));
        self.record.values.cost += STEPS;
        self.segment += 1;
        let cone = self.cone.at(hit.t);
        let point = hit.is_some().then(|| Interaction::new(prepared, &hit, self.origin, self.direction, cone));
        let arriving = match &point {
            Some(point) => self.emission(point),
            None => self.environment(),
        };
        let segment = Segment { origin: self.origin, direction: self.direction, length: hit.t.min(reach) };
        match self.medium.map(|medium| prepared.medium(medium)) {
            None => self.radiance += self.throughput * arriving,
            Some(Filling::Homogeneous(medium)) => {
                if let Some(goes_on) = self.pass(&medium, segment, arriving) {
                    return goes_on;
                }
            }
            Some(Filling::Varying(medium)) => {
                if let Some(goes_on) = self.pass_varying(&medium, segment, arriving) {
                    return goes_on;
                }
            }
        }
        if self.depth == 1 && self.wants_cost {
            self.record.mark_direct(self.radiance);
        }
        let Some(point) = point else { return false };
        self.cone = cone;
        if self.throughput.max_element() <= 0.0 {
            return false;
        }
        let (material, known) = prepared.material(point.material);
        if known.is_null {
            return self.pass_boundary(&point);
        }
        self.record.vertex_count += 1;
        if let Surface::Unlit(color) = &material.surface {
            self.record_first(hit.t, point.frame[2]);
            self.record.record_albedo(&mut self.wants_albedo, point.unlit(prepared.scene(), color));
            return false;
        }
        self.meet(&point)
    }

    /// Goes through a homogeneous medium. Returns whether the path goes on if it was scattered, and `None` if not.
    ///
    /// - `arriving`: what comes from the end of the segment.
    fn pass(&mut self, medium: &Homogeneous, segment: Segment, arriving: Spectrum) -> Option<bool> {
        self.radiance += self.throughput * medium.emitted(segment.length);
        let transmittance = medium.transmittance(segment.length);
        self.radiance += self.throughput * transmittance * arriving;
        if !(medium.scatters() && self.depth < self.settings.max_depth) {
            self.throughput *= transmittance;
            return None;
        }
        self.add_light_along(medium, &segment);
        let [u_channel, u, ..] = self.sampler.quad(DimensionSet::distance(self.segment));
        let channels = channel_probabilities(self.throughput);
        let distance = medium.sample_distance(channels, u_channel, u);
        if distance < segment.length {
            let pdf = medium.distance_pdf(channels, distance);
            self.throughput *= medium.transmittance(distance) * medium.scattering / pdf;
            let along = Along { segment, distance, pdf };
            return Some(self.scatter_within(medium.phase, medium.albedo(), &segment, distance, Some(along)));
        }
        self.throughput *= transmittance / medium.survival(channels, segment.length);
        None
    }

    /// Goes through a medium that varies in space; see [`Self::pass`].
    fn pass_varying(&mut self, medium: &Varying<'_>, segment: Segment, arriving: Spectrum) -> Option<bool> {
        let [u_kind, u, ..] = self.sampler.quad(DimensionSet::distance(self.segment));
        let line = Line { origin: segment.origin, direction: segment.direction, length: segment.length };
        let mut carried = Carried { throughput: self.throughput, radiance: self.radiance };
        let collision = medium.track(&line, &mut carried, [u_kind, u], numbers(self.sampler, &mut self.numbers_drawn));
        Carried { throughput: self.throughput, radiance: self.radiance } = carried;
        let Some(collision) = collision else {
            self.radiance += self.throughput * arriving;
            return None;
        };
        if self.depth >= self.settings.max_depth {
            return Some(false);
        }
        Some(self.scatter_within(medium.phase, collision.albedo, &segment, collision.distance, None))
    }

    /// Whether a candidate hit is to be taken: see [`is_there`]. Boundaries that part media are.
    fn is_there(&self, ray: &Ray, hit: &Hit, asks: Asks) -> bool {
        let known = self.prepared.material(material_of(self.prepared, hit)).1;
        if known.shines && asks == Asks::Path && self.depth == 0 && self.hides_emitters {
            return false;
        }
        let asks = asks.of_vertex(self.depth);
        known.is_null && known.media[0] != known.media[1]
            || is_there(self.prepared, ray, hit, asks, |surface| {
                self.sampler.hashed(surface ^ u64::from(self.depth) << DEPTH_SHIFT)
            })
    }

    /// What comes from where there is no surface, with its weight.
    fn environment(&self) -> Spectrum {
        if self.depth == 0 && self.hides_emitters {
            return Spectrum::ZERO;
        }
        let lights = self.prepared.lights();
        let from = self.previous.receiver.p;
        let radiance = lights.environment_radiance(self.prepared.scene(), from, self.direction);
        if radiance == Spectrum::ZERO {
            return radiance;
        }
        radiance * self.found_by_direction(|from| (lights.environment_pdf(from, self.direction), 0.0))
    }

    /// What a surface emits towards the path, with its weight.
    fn emission(&self, point: &Interaction) -> Spectrum {
        let prepared = self.prepared;
        let scene = &**prepared.scene();
        let (material, known) = prepared.material(point.material);
        if let Surface::Unlit(color) = &material.surface {
            return point.unlit(scene, color);
        }
        if !known.shines || known.is_null || !material.emission_sides.has(point.front) {
            return Spectrum::ZERO;
        }
        let radiance = emitted_at(prepared, point);
        if radiance == Spectrum::ZERO {
            return radiance;
        }
        let lights = prepared.lights();
        radiance
            * self.found_by_direction(|from| {
                let Some(light) = lights.light_of(prepared, &point.hit) else { return (0.0, 0.0) };
                let place = lights.place_pdf(scene, light, from.p, point.p);
                let along = self.previous.along.as_ref().map_or(0.0, |along| self.pdf_ratio(along, light));
                (lights.pmf(from, light) * place, along * place)
            })
    }

    /// The density with which a distance is drawn for a light, times the probability of that light, over the density with
    /// which the distance is drawn by extinction.
    fn pdf_ratio(&self, along: &Along, light: u32) -> f32 {
        let lights = self.prepared.lights();
        let arc = lights.arc(self.prepared.scene(), &along.segment, light);
        lights.pmf_along(&along.segment, light) * arc.pdf(along.distance) / along.pdf
    }

    /// The weight of light that the path ran into; `pdfs` tells the densities of both other ways to find it from the
    /// point before.
    fn found_by_direction(&self, pdfs: impl FnOnce(&Receiver) -> (f32, f32)) -> f32 {
        let Some(pdf) = self.previous.pdf else { return 1.0 };
        match self.settings.direct_light {
            DirectLight::LightSampling => 0.0,
            DirectLight::BsdfSampling => 1.0,
            DirectLight::Combined => {
                let (sampled, along) = pdfs(&self.previous.receiver);
                power_heuristic(pdf, [self.light_samples() as f32 * sampled, along])
            }
        }
    }

    fn light_samples(&self) -> u32 {
        self.settings.light_samples.max(1)
    }

    fn samples_lights(&self) -> bool {
        self.settings.direct_light != DirectLight::BsdfSampling && !self.prepared.lights().is_empty()
    }

    /// The density of a direction as far as it is another way to find a light sample.
    fn shared(&self, light: &LightSample, pdf: f32) -> f32 {
        if light.is_delta || self.settings.direct_light != DirectLight::Combined { 0.0 } else { pdf }
    }

    /// Light that is scattered at a distance drawn for one light.
    fn add_light_along(&mut self, medium: &Homogeneous, segment: &Segment) {
        if !self.samples_lights() {
            return;
        }
        let (prepared, lights) = (self.prepared, self.prepared.lights());
        let [u_light, u_distance, u, v] = self.sampler.quad(DimensionSet::along(self.segment));
        let Some((light, pmf)) = lights.sample_along(segment, u_light) else { return };
        let arc = lights.arc(prepared.scene(), segment, light);
        let distance = arc.sample(u_distance);
        let pdf = pmf * arc.pdf(distance);
        if !(distance < segment.length && pdf > 0.0) {
            return;
        }
        let p = segment.origin + segment.direction * distance;
        let Some(sample) = lights.sample_place(prepared, light, p, [u, v]) else { return };
        let phase = medium.phase.eval(segment.direction.dot(sample.wi));
        let by_extinction = medium.distance_pdf(channel_probabilities(self.throughput), distance) / pdf;
        let pmf_there = lights.pmf(&Receiver { p, n: Vec3::ZERO }, light);
        let others = [
            by_extinction * self.light_samples() as f32 * pmf_there * sample.pdf,
            by_extinction * self.shared(&sample, phase),
        ];
        let weight = power_heuristic(sample.pdf, others) / (pdf * sample.pdf);
        let scattered = medium.transmittance(distance) * medium.scattering * phase;
        let contribution = self.throughput * scattered * sample.radiance * weight;
        self.add_if_seen(contribution, p, p, &sample, self.medium);
    }

    /// Scatters at a distance in a medium. False when the path is at its end.
    ///
    /// - `along`: how the distance was drawn, where there are several ways to find light there.
    fn scatter_within(
        &mut self,
        phase: Phase,
        albedo: Spectrum,
        segment: &Segment,
        distance: f32,
        along: Option<Along>,
    ) -> bool {
        self.cone = self.cone.at(distance);
        let p = segment.origin + segment.direction * distance;
        let receiver = Receiver { p, n: Vec3::ZERO };
        self.record.vertex_count += 1;
        self.record_first(distance, Vec3::ZERO);
        self.record.record_albedo(&mut self.wants_albedo, albedo);
        if self.samples_lights() {
            let count = self.light_samples();
            for part in 0..count {
                let u = self.sampler.split_quad(DimensionSet::light(self.depth), part, count);
                let Some(light) = self.prepared.lights().sample(self.prepared, &receiver, u) else { continue };
                let value = phase.eval(segment.direction.dot(light.wi));
                let expected = count as f32 * light.pdf;
                let by_arc = match &along {
                    Some(along) if light.light != NO_LIGHT => {
                        self.pdf_ratio(along, light.light) * (light.pdf / light.pmf)
                    }
                    _ => 0.0,
                };
                let weight = power_heuristic(expected, [by_arc, self.shared(&light, value)]);
                let contribution = self.throughput * light.radiance * (value * weight / expected);
                self.add_if_seen(contribution, p, p, &light, self.medium);
            }
        }
        let u = self.sampler.quad(DimensionSet::scattering(self.depth));
        let (wi, pdf) = phase.sample(segment.direction, [u[1], u[2]]);
        self.previous = Previous { receiver, pdf: Some(pdf), along };
        self.go_on(p, wi, pdf, u[3])
    }

    /// Meets a surface that is more than a boundary. False when the path is at its end.
    fn meet(&mut self, point: &Interaction) -> bool {
        let prepared = self.prepared;
        let is_last = self.depth >= self.settings.max_depth;
        let known = prepared.material(point.material).1;
        if !known.is_pane {
            self.record_first(point.hit.t, point.frame[2]);
            if is_last && !self.wants_albedo {
                return false;
            }
        }
        let mut place = None;
        let chance = || self.sampler.hashed(BLEND ^ u64::from(self.depth) << DEPTH_SHIFT ^ u64::from(point.material));
        let bsdf = bsdf_at(prepared, point, chance, &mut place);
        if self.wants_cost {
            self.record.counts.meet(bsdf, prepared.material(point.material).1);
        }
        let wo = point.to_local(point.wo);
        if known.is_pane && bsdf.straight(wo) != Spectrum::ZERO {
            return self.meet_pane(point, &bsdf.at_carrying(wo, self.throughput), is_last);
        }
        self.record_first(point.hit.t, point.frame[2]);
        let is_delta_only = bsdf.is_delta_only();
        if self.wants_albedo && (is_last || !is_delta_only) {
            self.record.record_albedo(&mut self.wants_albedo, bsdf.albedo(wo));
        }
        if is_last {
            return false;
        }
        let bsdf = bsdf.at_carrying(wo, self.throughput);
        let n = if known.transmits { Vec3::ZERO } else { point.frame[2] };
        let receiver = Receiver { p: point.p_outside, n };
        if !is_delta_only && self.samples_lights() {
            self.add_direct_light(point, &bsdf, &receiver);
        }
        let u = self.sampler.quad(DimensionSet::scattering(self.depth));
        let Some(sample) = bsdf.sample(u[0], [u[1], u[2]]) else { return false };
        let wi = point.to_world(sample.wi);
        let is_reflection = point.is_reflection(wi);
        if (sample.wi.z > 0.0) != is_reflection {
            return false;
        }
        self.throughput *= sample.weight();
        self.medium = self.medium_towards(point, wi);
        if !is_reflection {
            self.eta_scale *= sample.eta * sample.eta;
        }
        let pdf = (!sample.is_delta()).then_some(sample.pdf);
        self.previous = Previous { receiver, pdf, along: None };
        self.go_on(point.ray_origin(wi), wi, pdf.unwrap_or(f32::INFINITY), u[3])
    }

    /// Meets a pane, which mirrors, or lets the path go on as if nothing was there. False when the path is at its end.
    fn meet_pane(&mut self, point: &Interaction, bsdf: &BsdfAt<'_>, is_last: bool) -> bool {
        let [u_lobe, u_roulette] =
            [0, 1].map(|number| self.sampler.hashed(PANE ^ u64::from(self.segment) << 1 ^ number));
        let Some(sample) = bsdf.sample(u_lobe, [0.5; 2]) else { return false };
        let wi = point.to_world(sample.wi);
        let is_reflection = point.is_reflection(wi);
        if (sample.wi.z > 0.0) != is_reflection {
            return false;
        }
        self.throughput *= sample.weight();
        if !is_reflection {
            return self.pass_boundary(point);
        }
        self.record_first(point.hit.t, point.frame[2]);
        if is_last {
            return false;
        }
        let receiver = Receiver { p: point.p_outside, n: Vec3::ZERO };
        self.previous = Previous { receiver, pdf: None, along: None };
        self.go_on(point.ray_origin(wi), wi, f32::INFINITY, u_roulette)
    }

    /// Goes straight on behind a surface. False when there are too many of them.
    fn pass_boundary(&mut self, point: &Interaction) -> bool {
        self.medium = self.medium_towards(point, self.direction);
        self.origin = point.ray_origin(self.direction);
        self.travelled += point.hit.t;
        self.boundaries += 1;
        self.boundaries < BOUNDARIES_MAX
    }

    /// What fills the space on the side of `wi`.
    fn medium_towards(&self, point: &Interaction, wi: Vec3) -> Option<MediumId> {
        self.medium_behind(point, wi, self.medium)
    }

    /// The same for light that came through `medium`.
    fn medium_behind(&self, point: &Interaction, wi: Vec3, medium: Option<MediumId>) -> Option<MediumId> {
        let known = self.prepared.material(point.material).1;
        if point.is_reflection(wi) || !known.parts_media { medium } else { known.media[usize::from(point.front)] }
    }

    /// Next-event estimation at a surface.
    fn add_direct_light(&mut self, point: &Interaction, bsdf: &BsdfAt<'_>, receiver: &Receiver) {
        let count = self.light_samples();
        for part in 0..count {
            let u = self.sampler.split_quad(DimensionSet::light(self.depth), part, count);
            let Some(light) = self.prepared.lights().sample(self.prepared, receiver, u) else { continue };
            let wi = point.to_local(light.wi);
            // A shading normal must not let light through the real surface.
            if (wi.z > 0.0) != point.is_reflection(light.wi) {
                continue;
            }
            let (value, pdf) = bsdf.eval_pdf(wi);
            let expected = count as f32 * light.pdf;
            let weight = power_heuristic(expected, [self.shared(&light, pdf), 0.0]);
            let contribution = self.throughput * value * light.radiance * (wi.z.abs() * weight / expected);
            let medium = self.medium_towards(point, light.wi);
            self.add_if_seen(contribution, receiver.p, point.ray_origin(light.wi), &light, medium);
        }
    }

    /// Adds what a light sample gives, as far as media and surfaces let it through.
    ///
    /// - `p`: where the light was sampled for; `origin`: where the ray to it starts.
    fn add_if_seen(
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
        // Aim at the light's point itself: from another origin it lies in a slightly different direction.
        let target = p + light.wi * light.distance;
        let mut transmittance = Spectrum::ONE;
        self.record.counts.shadow_rays += 1;
        for _ in 0..BOUNDARIES_MAX {
            self.record.values.cost += STEPS;
            let (direction, length) = if is_far {
                (light.wi, f32::INFINITY)
            } else {
                let to_light = target - origin;
                let length = to_light.length();
                (to_light / length, length)
            };
            let ray = Ray { origin, t_min: 0.0, direction, t_max: length * (1.0 - SHADOW_MARGIN) };
            let hit = if prepared.has_boundaries() {
                prepared.accel().intersect_filtered(&ray, |hit| self.is_there(&ray, hit, Asks::Shadow))
            } else if prepared.accel().occluded_filtered(&ray, |hit| self.is_there(&ray, hit, Asks::Shadow)) {
                return;
            } else {
                Hit::NONE
            };
            let length = hit.t.min(length);
            match medium.map(|medium| prepared.medium(medium)) {
                None => {}
                Some(Filling::Homogeneous(medium)) => transmittance *= medium.transmittance(length),
                Some(Filling::Varying(medium)) => {
                    let line = Line { origin, direction, length };
                    transmittance *= medium.transmittance(&line, numbers(self.sampler, &mut self.numbers_drawn));
                }
            }
            if hit.is_none() {
                self.radiance += contribution * transmittance;
                return;
            }
            let point = Interaction::new(prepared, &hit, origin, direction, RayCone::default());
            transmittance *= self.let_through(&point);
            if transmittance == Spectrum::ZERO {
                return;
            }
            medium = self.medium_behind(&point, direction, medium);
            origin = point.ray_origin(direction);
        }
    }

    /// The share of the light of a lamp that a surface lets straight through.
    fn let_through(&mut self, point: &Interaction) -> Spectrum {
        let known = self.prepared.material(point.material).1;
        if known.is_null || !known.is_pane {
            return if known.is_null { Spectrum::ONE } else { Spectrum::ZERO };
        }
        self.numbers_drawn += 1;
        let mut place = None;
        let chance = || self.sampler.hashed(TRACKING ^ self.numbers_drawn);
        let bsdf = bsdf_at(self.prepared, point, chance, &mut place);
        bsdf.straight(point.to_local(point.wo))
    }

    /// Goes on along `wi`. False when the path ends here, by Russian roulette.
    fn go_on(&mut self, origin: Vec3, wi: Vec3, pdf: f32, u: f32) -> bool {
        self.cone.spread = self.cone.spread.max(SCATTERED_SPREAD / pdf.sqrt());
        self.origin = origin;
        self.direction = wi;
        self.depth += 1;
        self.travelled = 0.0;
        survives(&mut self.throughput, self.eta_scale, self.depth <= self.settings.roulette_depth, u)
    }

    fn record_first(&mut self, distance: f32, normal: Vec3) {
        if self.depth == 0 && self.record.values.alpha == 0.0 {
            self.record.record_first(self.travelled + distance, normal);
        }
    }

    fn finish(mut self) -> PathRecord {
        self.record.values.cost += self.numbers_drawn as f32 * TRACKING_STEPS;
        self.record.keep(self.radiance);
        self.record
    }
}

/// The numbers that tracking takes, one after the other.
fn numbers(sampler: PixelSampler, drawn: &mut u64) -> impl FnMut() -> f32 {
    move || {
        *drawn += 1;
        sampler.hashed(TRACKING ^ *drawn)
    }
}

/// Weight of the strategy with density `chosen` against two others (Veach 1997, eq. 9.13, β = 2).
fn power_heuristic(chosen: f32, others: [f32; 2]) -> f32 {
    // By the ratios, so that squares of large densities do not overflow.
    let ratios = others.map(|other| other / chosen);
    1.0 / (1.0 + ratios[0] * ratios[0] + ratios[1] * ratios[1])
}
