//! The probe of an agent: finds points for its sensors, and tests the visibility of its light.

use bottega_kernels::{Ray, math};
use glam::Vec3;

use super::agent::{Agent, meets};
use crate::{
    camera::RayCone,
    integrator::shadow_ray,
    interaction::Interaction,
    photon::is_alike,
    prepare::PreparedScene,
    sampler::{DimensionSet, PixelSampler, Quad},
    sampling::orthonormal_basis,
};

/// Key of the random numbers of sensors, distinct from agents.
const SENSOR_SEED: u64 = 0x7365_6e73_6f72_7321;
/// Greatest height of a sensor above and below the plane of its agent, relative to their distance; and its lower bound,
/// relative to the radius of the agent's neighbourhood.
const SLOPE: f32 = 0.5;
const HEIGHT_MIN: f32 = 0.02;
/// Greatest number of surfaces in the way that are counted.
pub(super) const SURFACES_MAX: u32 = 4;
/// Number of strata of the random numbers of one kind of sensor.
const PARTS: u32 = 64;

/// The kinds of sensors (table 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SensorKind {
    Geometry,
    Proximity,
    Penumbra,
    Irradiance,
}

/// The probe of one agent.
#[derive(Clone, Copy)]
pub(super) struct Probe<'a> {
    /// The prepared scene.
    pub(super) prepared: &'a PreparedScene,
    /// The agent whose sensors are placed.
    pub(super) agent: &'a Agent,
    /// Seed of the random numbers.
    pub(super) seed: u64,
    /// Radius of the agent's neighbourhood.
    pub(super) reach: f32,
}

impl Probe<'_> {
    /// Returns the surface point of a sensor; `None`: no surface with a similar normal there.
    pub(super) fn place(&self, kind: SensorKind, number: u32, distance: f32, normal: Vec3) -> Option<Interaction> {
        let height = (SLOPE * distance).max(HEIGHT_MIN * self.reach);
        let origin = self.beside(kind, number, distance, normal) + normal * height;
        let ray = Ray { t_max: 2.0 * height, ..Ray::new(origin, -normal) };
        let hit = meets(self.prepared, &ray);
        if hit.is_none() {
            return None;
        }
        let point = Interaction::new(self.prepared, &hit, origin, -normal, RayCone::default());
        (is_alike(point.facing_ng(), normal) && point.p.is_finite()).then_some(point)
    }

    /// Returns the point of a sensor on the plane of its agent, in a random direction.
    pub(super) fn beside(&self, kind: SensorKind, number: u32, distance: f32, normal: Vec3) -> Vec3 {
        let (sin, cos) = math::sin_cos_of_turns(self.numbers(kind, 0, number)[0]);
        let (s, t) = orthonormal_basis(normal);
        self.agent.p + (s * cos + t * sin) * distance
    }

    /// Returns random numbers of a sensor, stratified over all sensors of a kind.
    pub(super) fn numbers(&self, kind: SensorKind, what: u32, number: u32) -> Quad {
        let set = DimensionSet::scattering(2 * kind as u32 + what);
        self.sampler(0, 0).split_quad(set, number % PARTS, PARTS)
    }

    /// Returns a sampler of the agent's own.
    ///
    /// - `variant`, `index`: distinct values give independent numbers.
    pub(super) fn sampler(&self, variant: u32, index: u32) -> PixelSampler {
        let Agent { cast, clone, .. } = *self.agent;
        PixelSampler::new(self.seed ^ SENSOR_SEED, cast, clone | variant << 16, index)
    }

    /// Returns the number of surfaces up to a random point on the light, including the light's own (1: visible), and
    /// the distance. `None`: the light does not shine there at all.
    ///
    /// - `most`: count no more surfaces.
    pub(super) fn surfaces_to_light(&self, point: &Interaction, number: u32, most: u32) -> Option<(u32, f32)> {
        let lights = self.prepared.lights();
        let [u, v, ..] = self.numbers(SensorKind::Penumbra, 1, number);
        let sample = lights.sample_place(self.prepared, self.agent.light, point.p_outside, [u, v])?;
        let mut count = 1;
        if sample.wi.dot(point.facing_ng()) <= 0.0 {
            // The sensor's own surface is in the way
            count += 1;
        } else {
            let mut ray = shadow_ray(point, &sample);
            while count <= most {
                let hit = meets(self.prepared, &ray);
                if hit.is_none() {
                    break;
                }
                count += 1;
                ray.t_min = hit.t * 1.0001;
            }
        }
        Some((count, sample.distance))
    }
}
