//! Samples of lights that move, at the time of a path.
//!
//! The tree chooses a light by bounds that hold at all times. The point on it, and its density, are those of the light as it is at the
//! time.

use bottega_scene::{LightKind, Sphere};
use glam::Vec3;

use super::{Arc, Light, LightSample, Lights, Receiver, Segment, punctual, sphere, surface::SurfaceLight};
use crate::{density::SolidAnglePdf, sampler::Quad, surfaces::Surfaces};

/// A moving light as it is at a time.
enum PosedLight {
    Punctual(LightKind),
    Sphere(Sphere),
    Surface(SurfaceLight),
}

impl Lights {
    /// Returns a light of the tree as it is at a time, if it moves.
    fn posed(&self, surfaces: &Surfaces, light: u32, time: f32) -> Option<PosedLight> {
        Some(match &self.lights[light as usize] {
            Light::Surface(surface) if surface.moves() => PosedLight::Surface(surface.at(surfaces, time)),
            Light::Surface(_) => return None,
            Light::Sphere(index) => PosedLight::Sphere(surfaces.moved_sphere(*index, time)?),
            Light::Punctual(index) => {
                let moving = surfaces.motion().light(*index)?;
                PosedLight::Punctual(surfaces.scene().lights[*index as usize].kind.moved(&moving.at(time)))
            }
        })
    }

    /// Samples one light and a point on it at a time; arguments and `None` as for [`Self::sample`].
    pub(crate) fn sample_at(
        &self,
        surfaces: &Surfaces,
        receiver: &Receiver,
        u: Quad,
        time: f32,
    ) -> Option<LightSample> {
        if surfaces.motion().moves() {
            let place = |light, place| self.sample_place_at(surfaces, light, receiver.p, place, time);
            self.sample_by_place(surfaces, receiver, u, place)
        } else {
            self.sample(surfaces, receiver, u)
        }
    }

    /// Samples a point on a given light at a time; arguments and `None` as for [`Self::sample_place`].
    pub(crate) fn sample_place_at(
        &self,
        surfaces: &Surfaces,
        light: u32,
        from: Vec3,
        u: [f32; 2],
        time: f32,
    ) -> Option<LightSample> {
        let Some(posed) = self.posed(surfaces, light, time) else {
            return self.sample_place(surfaces, light, from, u);
        };
        let sample = match &posed {
            PosedLight::Surface(surface) => surface.sample(surfaces, from, u)?,
            PosedLight::Sphere(sphere) => sphere::sample(surfaces, sphere, from, u)?,
            PosedLight::Punctual(kind) => punctual::sample(surfaces.scene(), kind, from)?,
        };
        Some(LightSample { light, visibility: self.visibility_of(light), ..sample })
    }

    /// Returns the density of the direction to a point on a light at a time; see [`Self::place_pdf`].
    pub(crate) fn place_pdf_at(
        &self,
        surfaces: &Surfaces,
        light: u32,
        from: Vec3,
        p: Vec3,
        time: f32,
    ) -> SolidAnglePdf {
        match self.posed(surfaces, light, time) {
            None => self.place_pdf(surfaces.scene(), light, from, p),
            Some(PosedLight::Surface(surface)) => surface.pdf(from, p),
            Some(PosedLight::Sphere(sphere)) => sphere::pdf(&sphere, from, p),
            Some(PosedLight::Punctual(_)) => SolidAnglePdf::ZERO,
        }
    }

    /// Returns a segment as seen from the centre of a light at a time; see [`Self::arc`].
    pub(crate) fn arc_at(&self, surfaces: &Surfaces, segment: &Segment, light: u32, time: f32) -> Arc {
        let (middle, radius_squared) = match self.posed(surfaces, light, time) {
            None => return self.arc(surfaces.scene(), segment, light),
            Some(PosedLight::Surface(surface)) => surface.ball(),
            Some(PosedLight::Sphere(sphere)) => (sphere.center, sphere.radius * sphere.radius),
            Some(PosedLight::Punctual(kind)) => (punctual::position(&kind), 0.0),
        };
        Arc::new(segment, middle, radius_squared)
    }
}
