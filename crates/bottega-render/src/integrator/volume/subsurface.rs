//! Subsurface scattering: a random walk from the point where light enters a solid to the point where it leaves.
//!
//! The walk is the path through a homogeneous medium, except that it counts as one bounce, and samples no lights: the
//! surface around it hides them. Where it meets the surface from inside, part of the light is reflected back, and the rest
//! leaves into the cosine-weighted hemisphere outside, where lights are sampled.
//!
//! Source: Křivánek and d'Eon 2014, *A Zero-Variance-Based Sampling Scheme for Monte Carlo Subsurface Scattering*
//! (analogue walk); Chiang, Kutz and Burley 2016, *Practical and Controllable Subsurface Scattering for Production Path
//! Tracing*.

use bottega_kernels::{Hit, Ray};
use bottega_scene::{Spectrum, Visibility};
use glam::Vec3;

use super::{
    passage::{STEPS, numbers},
    state::{MediumPath, PreviousVertex},
};
use crate::{
    bsdf::{Interior, warp},
    density::SolidAnglePdf,
    interaction::{Interaction, material_of},
    media::{Homogeneous, channel_probabilities},
    sampler::DimensionSet,
    shading::left_bsdf,
    vertex::{LeavingDirection, SurfaceVertex, leaving_direction, receiver_at},
};

/// Greatest number of scattering events and inner reflections of a walk; the little light that is left then is lost.
const EVENTS_MAX: u32 = 4096;
/// Number of events after which Russian roulette may end a walk.
const SURE_EVENTS: u32 = 16;

/// The way in which a path leaves the solid.
pub(super) struct Departure {
    /// Start of the next ray.
    pub(super) origin: Vec3,
    /// Direction of the next ray; unit length.
    pub(super) wi: Vec3,
    /// Density of the direction, in sr⁻¹.
    pub(super) pdf: f32,
    /// Random number for Russian roulette.
    pub(super) u_roulette: f32,
}

/// The weight of a walk whose distances are drawn by the extinction of one of three channels: one-sample MIS of all.
struct WalkWeight {
    /// Share of the light that the walk carries.
    share: Spectrum,
    /// Density of the walk for each choice of the channel, over the density for a random choice.
    densities: Spectrum,
}

impl WalkWeight {
    /// Multiplies by a step of the walk.
    ///
    /// - `value`: share of the light that the step passes on.
    /// - `densities`: density or probability of the step for each choice of the channel.
    /// - `channels`: probabilities of the choices.
    fn multiply(&mut self, value: Spectrum, densities: Spectrum, channels: Spectrum) {
        self.share *= value;
        self.densities *= densities;
        let mean = channels.dot(self.densities);
        if mean > 0.0 && mean.is_finite() {
            self.share /= mean;
            self.densities /= mean;
        } else {
            self.share = Spectrum::ZERO;
        }
    }
}

impl MediumPath<'_> {
    /// Follows light below a surface, and scatters it where it leaves. Returns `None` when the path ends.
    ///
    /// - `wi`: direction in which the path continues, in world space.
    pub(super) fn pass_below(&mut self, point: &Interaction, wi: Vec3, interior: &Interior) -> Option<Departure> {
        let exit = self.walk(point, wi, interior)?;
        let prepared = self.prepared;
        let [u, v, u_roulette, u_part] = self.sampler.quad(DimensionSet::leaving(self.depth));
        let bsdf = left_bsdf(prepared, &exit, u_part);
        // The direction from below does not change how the light leaves
        let bsdf = bsdf.at(Vec3::Z);
        let receiver = receiver_at(&exit, prepared.material(exit.material).1);
        // Sample lights where it leaves
        if self.samples_lights() {
            self.add_direct_light(&SurfaceVertex { point: &exit, bsdf: &bsdf, receiver, wo: Vec3::Z }, false);
        }
        // Sample the direction in which it leaves
        let sample = bsdf.sample(0.5, [u, v])?;
        let LeavingDirection { wi, .. } = leaving_direction(&exit, &sample)?;
        self.throughput *= sample.weight();
        self.previous = PreviousVertex { receiver, pdf: Some(SolidAnglePdf::new(sample.pdf)), along: None };
        self.event = Visibility::DIFFUSE;
        Some(Departure { origin: exit.ray_origin(wi), wi, pdf: sample.pdf, u_roulette })
    }

    /// Walks through the substance below a surface. Returns the point where the walk leaves, seen from outside; `None` if
    /// the light is absorbed, or the solid is not closed.
    fn walk(&mut self, entry: &Interaction, wi: Vec3, interior: &Interior) -> Option<Interaction> {
        let prepared = self.prepared;
        let medium = Homogeneous::of_coefficients(interior.absorption, interior.scattering, interior.g);
        let (mut origin, mut direction) = (entry.ray_origin(wi), wi);
        // Draw all distances by the extinction of one random color channel
        let [u_channel, u_first, ..] = self.sampler.quad(DimensionSet::below(self.depth));
        let channels = channel_probabilities(self.throughput);
        let mut weight = WalkWeight { share: Spectrum::ONE, densities: Spectrum::ONE };
        for event in 0..EVENTS_MAX {
            let u = if event == 0 { u_first } else { self.next_number() };
            let distance = medium.sample_distance(channels, u_channel, u);
            // Find the surface of the solid up to there
            let ray = Ray { t_max: distance, ..Ray::new(origin, direction) };
            let is_boundary = |hit: &Hit| {
                prepared.material(material_of(prepared, hit)).1.has_subsurface && self.catchers.has(prepared, hit)
            };
            let hit = prepared.accel().intersect_filtered_at(&ray, self.time, is_boundary);
            self.record.values.cost += STEPS;
            self.record.counts.media += 1;
            if hit.is_none() {
                if !distance.is_finite() {
                    return None;
                }
                // Scatter
                let scattered = medium.transmittance(distance) * medium.scattering;
                weight.multiply(scattered, medium.distance_pdfs(distance), channels);
                origin += direction * distance;
                direction = medium.phase.sample(direction, [self.next_number(), self.next_number()]).0;
            } else {
                let passed = medium.transmittance(hit.t);
                weight.multiply(passed, passed, channels);
                // See the surface from outside: along the same line from the other end
                let cone = self.cone.at(hit.t);
                let beyond = origin + direction * (2.0 * hit.t);
                let exit = Interaction::at(prepared, &hit, beyond, -direction, cone, self.time);
                if self.next_number() >= interior.inner_reflectance {
                    self.throughput *= weight.share;
                    self.cone = cone;
                    return (self.throughput.max_element() > 0.0).then_some(exit);
                }
                // Reflect back inside, diffusely
                let back = warp::cosine_hemisphere([self.next_number(), self.next_number()]);
                direction = exit.to_world(Vec3::new(back.x, back.y, -back.z));
                origin = exit.ray_origin(direction);
            }
            // End the walk by Russian roulette
            let survival = weight.share.max_element().min(1.0);
            if event >= SURE_EVENTS && survival < 1.0 {
                if self.next_number() >= survival {
                    return None;
                }
                weight.share /= survival;
            }
        }
        None
    }

    /// Returns the next random number of the walk.
    fn next_number(&mut self) -> f32 {
        numbers(self.sampler, &mut self.numbers_drawn)()
    }
}
