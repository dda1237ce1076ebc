//! Lights that move: their bounds over the whole span of the shutter, and samples at one time of it.
//!
//! The tree chooses lights by bounds that hold at all times. The point on the chosen light, and its density, are those of
//! the light as it is at the time of the path.

use bottega_kernels::{Aabb, MovingTransform};
use bottega_scene::{LightKind, Sphere};
use glam::Vec3;

use super::{
    Arc, Light, LightSample, Lights, Receiver, Segment,
    bounds::{Cone, LightBounds},
    punctual, sphere,
    surface::{Panel, SurfaceLight},
};
use crate::{sampler::Quad, surfaces::Surfaces};

/// A moving light as it is at a time.
enum PosedLight {
    Punctual(LightKind),
    Sphere(Sphere),
    Surface(SurfaceLight),
}

/// Returns a box around all boxes of a path.
fn along(moving: &MovingTransform, object: &Aabb) -> Aabb {
    moving.path(object).iter().fold(Aabb::EMPTY, |all, (_, bounds)| all.union(bounds))
}

/// Returns bounds of a light without extent for the whole span of the shutter.
pub(super) fn along_light(surfaces: &Surfaces, index: u32, bounds: LightBounds) -> LightBounds {
    let Some(moving) = surfaces.motion().light(index) else { return bounds };
    let cone = if moving.only_shifts() { bounds.cone } else { Cone::SPHERE };
    LightBounds { bounds: along(moving, &bounds.bounds), cone, ..bounds }
}

/// Returns bounds of an emitting sphere for the whole span of the shutter.
pub(super) fn along_sphere(surfaces: &Surfaces, index: u32, bounds: LightBounds) -> LightBounds {
    let Some(keys) = surfaces.motion().sphere_keys(index) else { return bounds };
    let around = |all: Aabb, center: Vec3, radius: f32| all.union(&Aabb::around(center, radius));
    LightBounds { bounds: keys.iter().fold(Aabb::EMPTY, |all, key| around(all, key.center, key.radius)), ..bounds }
}

/// Returns bounds of a part of a panel for the whole span of the shutter.
pub(super) fn along_panel(surfaces: &Surfaces, panel: &Panel, bounds: LightBounds) -> LightBounds {
    if !panel.moves {
        return bounds;
    }
    let (scene, motion) = (surfaces.scene(), surfaces.motion());
    let instance = &scene.instances[panel.instance() as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let triangle = mesh.triangles[panel.triangle as usize];
    // Bound the triangle in object space, then its path
    let moved = motion.triangle_bounds(scene, instance.mesh, triangle);
    let still = || triangle.iter().fold(Aabb::EMPTY, |all, &vertex| all.with(mesh.positions[vertex as usize]));
    let object = moved.unwrap_or_else(still);
    let transform = motion.instance(panel.instance());
    let path = match transform {
        Some(moving) => along(moving, &object),
        None => {
            let stays = MovingTransform::new(&[(0.0, instance.world_from_object)]);
            stays.map_or(bounds.bounds, |stays| along(&stays, &object))
        }
    };
    // Its normal stays the same only if the whole triangle is shifted
    let is_shifted = moved.is_none() && transform.is_none_or(MovingTransform::only_shifts);
    LightBounds { bounds: path, cone: if is_shifted { bounds.cone } else { Cone::SPHERE }, ..bounds }
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

    /// Samples one light and a point on it at a time; see [`Self::sample`].
    pub(crate) fn sample_at(
        &self,
        surfaces: &Surfaces,
        receiver: &Receiver,
        u: Quad,
        time: f32,
    ) -> Option<LightSample> {
        if surfaces.motion().moves() {
            self.sample_in::<true>(surfaces, receiver, u, time)
        } else {
            self.sample(surfaces, receiver, u)
        }
    }

    /// Samples a point on a given light at a time; see [`Self::sample_place`].
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

    /// Returns the density of a point on a light at a time; see [`Self::place_pdf`].
    pub(crate) fn place_pdf_at(&self, surfaces: &Surfaces, light: u32, from: Vec3, p: Vec3, time: f32) -> f32 {
        match self.posed(surfaces, light, time) {
            None => self.place_pdf(surfaces.scene(), light, from, p),
            Some(PosedLight::Surface(surface)) => surface.pdf(from, p),
            Some(PosedLight::Sphere(sphere)) => sphere::pdf(&sphere, from, p),
            Some(PosedLight::Punctual(_)) => 0.0,
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
