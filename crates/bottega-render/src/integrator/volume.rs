//! Path tracing through participating media.
//!
//! Light scattered on a path segment through a homogeneous medium is found in three ways, combined by the power
//! heuristic. Two of them scatter at a distance drawn by extinction: (1) sampling a light from there, and (2) sampling
//! the phase function. (3) scatters at a distance drawn for one light, uniform in the angle under which that light sees
//! the segment. Emission at the end of a segment is always added, attenuated by the medium, wherever the path
//! continues. In heterogeneous media, paths are tracked by null collisions and only (1) and (2) are used.
//!
//! Sources: Kulla and Fajardo 2012, *Importance Sampling Techniques for Path Tracing in Participating Media*; Veach 1997,
//! *Robust Monte Carlo Methods for Light Transport Simulation*, chapter 9.

mod light;
mod passage;
mod state;
mod subsurface;

use bottega_image::SurfaceValues;
use bottega_kernels::{Hit, Ray};
use bottega_scene::{Spectrum, Surface, Visibility};
use glam::Vec3;

use super::{
    group_sums::GroupSums,
    path::PathIntegrator,
    record::PathRecord,
    surface::WantedSurface,
    transport::{survives, widen},
};
use crate::{
    bsdf::{BsdfAt, BsdfSample, LobeFlags},
    camera::CameraRay,
    catchers::CatcherRole,
    density::SolidAnglePdf,
    interaction::Interaction,
    lights::{Receiver, Segment},
    media::{
        Homogeneous, Phase, PreparedMedium, channel_probabilities,
        varying::{CarriedLight, Line, Varying},
    },
    sampler::{DimensionSet, PixelSampler},
    vertex::{LeavingDirection, SurfaceVertex, bsdf_at_vertex, entered_bsdf_at_vertex, leaving_direction, receiver_at},
};
use passage::{BOUNDARIES_MAX, STEPS, numbers};
use state::{ArrivingLight, FirstSurface, MediumPath, PreviousVertex, SegmentPoint};

/// Cost of one random number of tracking with its grid lookup, in traversal steps.
const TRACKING_STEPS: f32 = 2.0;
/// Key of the random numbers of panes, distinct from all other decisions.
const PANE: u64 = 0x7061_6e65_7061_6e65;

/// Returns the kind of the event that a BSDF sample is.
fn event_of(sample: &BsdfSample) -> Visibility {
    if sample.lobe.contains(LobeFlags::TRANSMISSION) {
        Visibility::TRANSMISSION
    } else if sample.lobe.contains(LobeFlags::DIFFUSE) {
        Visibility::DIFFUSE
    } else {
        Visibility::GLOSSY
    }
}

impl PathIntegrator<'_> {
    /// Traces one sample of a scene with media or motion.
    ///
    /// - `catchers`: the part that shadow catchers play.
    /// - `groups`: receives its light by groups of lights, if it is wanted.
    pub(super) fn trace_volume(
        &self,
        x: u32,
        y: u32,
        sample_index: u32,
        catchers: CatcherRole<'_>,
        groups: Option<GroupSums<'_>>,
    ) -> PathRecord {
        let sampler = PixelSampler::new(self.settings().seed, x, y, sample_index);
        let time = self.time_of(&sampler, y);
        let (ray, factor) = self.camera_ray_at(&sampler, x, y, time);
        let mut path = MediumPath { catchers, groups, ..begin(self, sampler, &ray, time) };
        while path.advance() {}
        path.finish(factor)
    }

    /// Returns the part that shadow catchers play for paths of the picture.
    pub(super) fn catcher_role(&self) -> CatcherRole<'_> {
        self.catchers().map_or(CatcherRole::Objects, CatcherRole::Unseen)
    }

    /// Returns the time of a path of a row; 0 if nothing moves.
    fn time_of(&self, sampler: &PixelSampler, y: u32) -> f32 {
        let motion = self.prepared().motion();
        if !motion.moves() {
            return 0.0;
        }
        let u = if self.settings().instant_shutter { 0.5 } else { sampler.quad(DimensionSet::TIME)[0] };
        self.time_of_row(motion.time(u), y)
    }

    /// Returns the first surface, or the first scattering in a medium, of a sample that [`Self::trace_volume`] traces: it
    /// follows the same path that far.
    pub(super) fn surface_in_volume(&self, x: u32, y: u32, sample_index: u32, wanted: WantedSurface) -> SurfaceValues {
        let sampler = PixelSampler::new(self.settings().seed, x, y, sample_index);
        let time = self.time_of(&sampler, y);
        let (ray, weight) = self.camera_ray_at(&sampler, x, y, time);
        let mut path = MediumPath { catchers: self.catcher_role(), ..begin(self, sampler, &ray, time) };
        path.wants_surface = Some(wanted);
        while path.surface.is_none() && path.depth == 0 && path.advance() {}
        let Some(FirstSurface { values, hit }) = path.surface else {
            return SurfaceValues { weight, ..SurfaceValues::default() };
        };
        let motion =
            if wanted.motion { self.motion_vectors(values.position.into(), &hit, time, (x, y)) } else { [0.0; 4] };
        SurfaceValues { weight, motion, ..values }
    }
}

/// Starts a path at a camera ray. The integrator gives the camera and the settings.
fn begin<'a>(integrator: &PathIntegrator<'a>, sampler: PixelSampler, ray: &CameraRay, time: f32) -> MediumPath<'a> {
    let (prepared, settings) = (integrator.prepared(), integrator.settings());
    MediumPath {
        prepared,
        settings,
        sampler,
        time,
        throughput: Spectrum::ONE,
        radiance: Spectrum::ZERO,
        medium: integrator.camera_medium(),
        eta_scale: 1.0,
        depth: 0,
        event: Visibility::CAMERA,
        segment: 0,
        boundaries: 0,
        travelled: ray.start,
        reach: ray.reach,
        numbers_drawn: 0,
        origin: ray.origin,
        direction: ray.direction,
        cone: ray.cone,
        hides_emitters: integrator.hides_emitters(),
        catchers: CatcherRole::Objects,
        wants_surface: None,
        surface: None,
        previous: PreviousVertex { receiver: Receiver { p: ray.origin, n: Vec3::ZERO }, pdf: None, along: None },
        wants_albedo: integrator.wanted().albedo,
        wants_cost: integrator.wanted().cost,
        record: PathRecord::split(),
        groups: None,
    }
}

impl MediumPath<'_> {
    /// Moves the path to its next scattering event or boundary. Returns `false` when the path ends.
    fn advance(&mut self) -> bool {
        let prepared = self.prepared;
        let reach = std::mem::replace(&mut self.reach, f32::INFINITY);
        let ray = Ray { t_max: reach, ..Ray::new(self.origin, self.direction) };
        // Intersect the ray with the scene
        let hit = prepared.accel().intersect_filtered_at(&ray, self.time, |hit| self.meets(&ray, hit));
        self.record.values.cost += STEPS;
        self.record.counts.media += u32::from(self.medium.is_some());
        self.segment += 1;
        let cone = self.cone.at(hit.t);
        let interaction = || Interaction::at(prepared, &hit, self.origin, self.direction, cone, self.time);
        let is_caught = self.depth == 0 && self.catchers.hides(prepared, &hit);
        let point = (hit.is_some() && !is_caught).then(interaction);
        // Compute the emission at the end of the segment
        let radiance = match &point {
            Some(point) => self.emission(point),
            None => self.environment(),
        };
        let arriving = ArrivingLight { radiance, point: point.as_ref() };
        // Pass through the medium: add light along the segment, and scatter or continue
        let segment = Segment { origin: self.origin, direction: self.direction, length: hit.t.min(reach) };
        match self.medium.map(|medium| prepared.medium(medium)) {
            None => self.add_arriving(self.throughput, arriving),
            Some(PreparedMedium::Homogeneous(medium)) => {
                if let Some(goes_on) = self.pass(&medium, segment, arriving) {
                    return goes_on;
                }
            }
            Some(PreparedMedium::Varying(medium)) => {
                if let Some(goes_on) = self.pass_varying(&medium, segment, arriving) {
                    return goes_on;
                }
            }
        }
        // Count the light found so far as direct
        if self.depth == 1 && self.wants_cost {
            self.record.mark_direct(self.radiance);
        }
        let Some(point) = point else {
            self.record.is_caught = is_caught;
            return false;
        };
        // Continue at the surface, or through a boundary without one
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
            self.record_surface(&point);
            self.record.record_albedo(&mut self.wants_albedo, point.unlit(prepared.scene(), color));
            return false;
        }
        self.meet(&point)
    }

    /// Passes through a homogeneous medium. Returns `None` if the path reaches the end of the segment unscattered; else
    /// `Some`, with `true` if it continues.
    ///
    /// - `arriving`: emission at the end of the segment.
    fn pass(&mut self, medium: &Homogeneous, segment: Segment, arriving: ArrivingLight<'_>) -> Option<bool> {
        // Add the medium's emission, and the light from the end of the segment
        self.add(self.throughput * medium.emitted(segment.length), self.depth);
        let transmittance = medium.transmittance(segment.length);
        self.add_arriving(self.throughput * transmittance, arriving);
        if !(medium.scatters() && self.depth < self.settings.max_depth) {
            self.throughput *= transmittance;
            return None;
        }
        // Sample a light and a distance for it
        self.add_light_along(medium, &segment);
        let [u_channel, u, ..] = self.sampler.quad(DimensionSet::distance(self.segment));
        // Sample a distance by extinction in a random color channel
        let channels = channel_probabilities(self.throughput);
        let distance = medium.sample_distance(channels, u_channel, u);
        if distance < segment.length {
            let pdf = medium.distance_pdf(channels, distance);
            self.throughput *= medium.transmittance(distance) * medium.scattering / pdf;
            let along = SegmentPoint { segment, distance, pdf };
            return Some(self.scatter_within(medium.phase, medium.albedo(), &segment, distance, Some(along)));
        }
        self.throughput *= transmittance / medium.survival(channels, segment.length);
        None
    }

    /// Passes through a heterogeneous medium; see [`Self::pass`].
    fn pass_varying(&mut self, medium: &Varying<'_>, segment: Segment, arriving: ArrivingLight<'_>) -> Option<bool> {
        let [u_kind, u, ..] = self.sampler.quad(DimensionSet::distance(self.segment));
        let line = Line { origin: segment.origin, direction: segment.direction, length: segment.length };
        let before = self.radiance;
        let mut carried = CarriedLight { throughput: self.throughput, radiance: self.radiance };
        // Track the path to a real collision or to the end of the segment
        let collision = medium.track(&line, &mut carried, [u_kind, u], numbers(self.sampler, &mut self.numbers_drawn));
        CarriedLight { throughput: self.throughput, radiance: self.radiance } = carried;
        self.count_direct(self.radiance - before, self.depth);
        let Some(collision) = collision else {
            self.add_arriving(self.throughput, arriving);
            return None;
        };
        if self.depth >= self.settings.max_depth {
            return Some(false);
        }
        Some(self.scatter_within(medium.phase, collision.albedo, &segment, collision.distance, None))
    }

    /// Scatters at a distance along a segment through a medium. Returns `false` when the path ends.
    ///
    /// - `along`: density of the distance, if light there is found in several ways.
    fn scatter_within(
        &mut self,
        phase: Phase,
        albedo: Spectrum,
        segment: &Segment,
        distance: f32,
        along: Option<SegmentPoint>,
    ) -> bool {
        self.cone = self.cone.at(distance);
        let p = segment.origin + segment.direction * distance;
        let receiver = Receiver { p, n: Vec3::ZERO };
        self.record.vertex_count += 1;
        self.record_first(distance, Vec3::ZERO);
        if self.wants_surface.is_some() && self.surface.is_none() {
            let values = SurfaceValues { position: p.to_array(), ..SurfaceValues::default() };
            self.surface = Some(FirstSurface { values, hit: Hit::NONE });
        }
        self.record.record_albedo(&mut self.wants_albedo, albedo);
        // Sample lights from there
        self.add_light_at(phase, segment.direction, &receiver, along.as_ref());
        let u = self.sampler.quad(DimensionSet::scattering(self.depth));
        // Sample the phase function
        let (wi, pdf) = phase.sample(segment.direction, [u[1], u[2]]);
        self.previous = PreviousVertex { receiver, pdf: Some(SolidAnglePdf::new(pdf)), along };
        self.event = Visibility::VOLUME;
        self.go_on(p, wi, pdf, u[3])
    }

    /// Scatters at a surface that is more than a boundary of media. Returns `false` when the path ends.
    fn meet(&mut self, point: &Interaction) -> bool {
        let prepared = self.prepared;
        let is_last = self.depth >= self.settings.max_depth;
        // Stop at the maximum depth; panes are passed even there
        let known = prepared.material(point.material).1;
        if !known.is_pane {
            self.record_surface(point);
            if is_last && !self.wants_albedo {
                return false;
            }
        }
        // Evaluate the BSDF's parameters, and those of the substance below
        let mut storage = None;
        let mut bsdf = bsdf_at_vertex(prepared, point, &self.sampler, self.depth, &mut storage);
        if self.wants_cost {
            self.record.counts.meet(bsdf, known);
        }
        let wo = point.to_local(point.wo);
        // Treat panes of glass without refraction separately
        if known.is_pane && bsdf.straight(wo) != Spectrum::ZERO {
            return self.meet_pane(point, &bsdf.at_carrying(wo, self.throughput), is_last);
        }
        self.record_surface(point);
        let is_delta_only = bsdf.is_delta_only();
        if self.wants_albedo && (is_last || !is_delta_only) {
            self.record.record_albedo(&mut self.wants_albedo, bsdf.albedo(wo));
        }
        if is_last {
            return false;
        }
        let (entered, interior);
        if known.has_subsurface {
            (entered, interior) = entered_bsdf_at_vertex(prepared, point, &self.sampler, self.depth);
            bsdf = &entered;
        } else {
            interior = None;
        }
        let is_delta_only = bsdf.is_delta_only();
        let (receiver, bsdf) = (receiver_at(point, known), &bsdf.at_carrying(wo, self.throughput));
        let vertex = SurfaceVertex { point, bsdf, receiver, wo };
        // Sample direct illumination
        if !is_delta_only && self.samples_lights() {
            self.add_direct_light(&vertex, interior.is_some());
        }
        // Sample the BSDF
        let u = self.sampler.quad(DimensionSet::scattering(self.depth));
        let Some(sample) = bsdf.sample(u[0], [u[1], u[2]]) else { return false };
        if let Some(interior) = interior.filter(|_| sample.lobe.contains(LobeFlags::TRANSMISSION)) {
            self.throughput *= sample.weight();
            let departure = self.pass_below(point, point.to_world(sample.wi), &interior);
            return departure.is_some_and(|it| self.go_on(it.origin, it.wi, it.pdf, it.u_roulette));
        }
        let Some(LeavingDirection { wi, is_reflection }) = leaving_direction(point, &sample) else { return false };
        // Update throughput and medium, and move on
        self.throughput *= sample.weight();
        self.medium = self.medium_towards(point, wi);
        if !is_reflection {
            self.eta_scale *= sample.eta * sample.eta;
        }
        let pdf = (!sample.is_delta()).then_some(sample.pdf);
        self.previous = PreviousVertex { receiver, pdf: pdf.map(SolidAnglePdf::new), along: None };
        self.event = event_of(&sample);
        self.go_on(point.ray_origin(wi), wi, pdf.unwrap_or(f32::INFINITY), u[3])
    }

    /// Scatters at a pane: mirrors the path, or passes it straight through. Returns `false` when the path ends.
    fn meet_pane(&mut self, point: &Interaction, bsdf: &BsdfAt<'_>, is_last: bool) -> bool {
        let [u_lobe, u_roulette] =
            [0, 1].map(|number| self.sampler.hashed(PANE ^ u64::from(self.segment) << 1 ^ number));
        let Some(sample) = bsdf.sample(u_lobe, [0.5; 2]) else { return false };
        let Some(LeavingDirection { wi, is_reflection }) = leaving_direction(point, &sample) else { return false };
        self.throughput *= sample.weight();
        if !is_reflection {
            return self.pass_boundary(point);
        }
        self.record_surface(point);
        if is_last {
            return false;
        }
        let receiver = Receiver { p: point.p_outside, n: Vec3::ZERO };
        self.previous = PreviousVertex { receiver, pdf: None, along: None };
        self.event = event_of(&sample);
        self.go_on(point.ray_origin(wi), wi, f32::INFINITY, u_roulette)
    }

    /// Continues straight on behind a surface. Returns `false` after too many boundaries.
    fn pass_boundary(&mut self, point: &Interaction) -> bool {
        self.medium = self.medium_towards(point, self.direction);
        self.origin = point.ray_origin(self.direction);
        self.travelled += point.hit.t;
        self.boundaries += 1;
        self.boundaries < BOUNDARIES_MAX
    }

    /// Continues along `wi`, which was drawn with density `pdf`. Returns `false` when Russian roulette ends the path.
    fn go_on(&mut self, origin: Vec3, wi: Vec3, pdf: f32, u: f32) -> bool {
        widen(&mut self.cone, pdf);
        self.origin = origin;
        self.direction = wi;
        self.depth += 1;
        self.travelled = 0.0;
        survives(&mut self.throughput, self.eta_scale, self.depth <= self.settings.roulette_depth, u)
    }

    /// Records the first visible surface.
    fn record_surface(&mut self, point: &Interaction) {
        self.record_first(point.hit.t, point.frame[2]);
        if let Some(wanted) = self.wants_surface
            && self.surface.is_none()
        {
            let values = wanted.values(self.prepared, point, self.time);
            self.surface = Some(FirstSurface { values, hit: point.hit });
        }
    }

    /// Records the first visible surface or scattering event.
    fn record_first(&mut self, distance: f32, normal: Vec3) {
        if self.depth == 0 && self.record.values.alpha == 0.0 {
            self.record.record_first(self.travelled + distance, normal);
        }
    }

    /// Returns the record of the path, multiplied by the factor of its sample.
    fn finish(mut self, factor: f32) -> PathRecord {
        self.record.values.cost += self.numbers_drawn as f32 * TRACKING_STEPS;
        let kept = self.record.keep(self.radiance, self.settings.sample_max);
        if let Some(sums) = &mut self.groups {
            sums.scale(kept * factor);
        }
        self.record.scaled(factor)
    }
}
