//! A sensor's probe: it goes to a place near by, and looks for the light.

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

/// Sets the numbers of sensors apart from those of agents.
const SENSOR_SEED: u64 = 0x7365_6e73_6f72_7321;
/// Sensors are looked for so far above and below the plane of an agent, as a share of how far they are from it, and at
/// least as a share of how far it looks around.
const SLOPE: f32 = 0.5;
const HEIGHT_MIN: f32 = 0.02;
/// Surfaces in the way that are counted.
pub(super) const SURFACES_MAX: u32 = 4;
/// Most parts into which numbers of sensors of one kind are stratified.
const PARTS: u32 = 64;

/// The kinds of sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SensorKind {
    Geometry,
    Proximity,
    Penumbra,
    Irradiance,
}

/// Where sensors of one agent go.
#[derive(Clone, Copy)]
pub(super) struct Probe<'a> {
    pub(super) prepared: &'a PreparedScene,
    pub(super) agent: &'a Agent,
    pub(super) seed: u64,
    /// How far the agent looks around.
    pub(super) reach: f32,
}

impl Probe<'_> {
    /// The surface where a sensor goes; `None` where there is none that faces the same way.
    pub(super) fn place(&self, kind: SensorKind, number: u32, distance: f32, normal: Vec3) -> Option<Interaction> {
        let height = (SLOPE * distance).max(HEIGHT_MIN * self.reach);
        let origin = self.beside(kind, number, distance, normal) + normal * height;
        let ray = Ray { t_max: 2.0 * height, ..Ray::new(origin, -normal) };
        let hit = meets(self.prepared, &ray);
        if hit.is_none() {
            return None;
        }
        let point = Interaction::new(self.prepared, &hit, origin, -normal, RayCone::default());
        (is_alike(side(&point), normal) && point.p.is_finite()).then_some(point)
    }

    /// A place on the plane of the agent, in a direction of the sensor's own.
    pub(super) fn beside(&self, kind: SensorKind, number: u32, distance: f32, normal: Vec3) -> Vec3 {
        let (sin, cos) = math::sin_cos_of_turns(self.numbers(kind, 0, number)[0]);
        let (s, t) = orthonormal_basis(normal);
        self.agent.p + (s * cos + t * sin) * distance
    }

    /// The numbers of a sensor: those of all sensors of a kind are stratified.
    pub(super) fn numbers(&self, kind: SensorKind, what: u32, number: u32) -> Quad {
        let set = DimensionSet::scattering(2 * kind as u32 + what);
        self.sampler(0, 0).split_quad(set, number % PARTS, PARTS)
    }

    /// Numbers of the agent's own.
    ///
    /// - `variant`, `index`: different ones are independent.
    pub(super) fn sampler(&self, variant: u32, index: u32) -> PixelSampler {
        let Agent { cast, clone, .. } = *self.agent;
        PixelSampler::new(self.seed ^ SENSOR_SEED, cast, clone | variant << 16, index)
    }

    /// Surfaces between a sensor and a place on the light, that of the light among them: 1 where it is seen; and how far it is.
    /// `None`: the light does not shine there at all.
    ///
    /// - `most`: no more surfaces are counted.
    pub(super) fn surfaces_to_light(&self, point: &Interaction, number: u32, most: u32) -> Option<(u32, f32)> {
        let lights = self.prepared.lights();
        let [u, v, ..] = self.numbers(SensorKind::Penumbra, 1, number);
        let sample = lights.sample_place(self.prepared, self.agent.light, point.p_outside, [u, v])?;
        let mut count = 1;
        if sample.wi.dot(side(point)) <= 0.0 {
            // Its own surface is in the way.
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

/// Normal of the real surface on the side that it was looked at from.
pub(super) fn side(point: &Interaction) -> Vec3 {
    if point.front { point.ng } else { -point.ng }
}
