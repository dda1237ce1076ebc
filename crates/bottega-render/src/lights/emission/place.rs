//! Emission of photons by lights with extent.

use std::f32::consts::PI;

use bottega_scene::{Scene, Sides, Spectrum, Sphere};
use glam::Vec3;

use super::super::{Profile, sphere, surface::SurfaceLight};
use crate::{
    bsdf::warp::cosine_hemisphere,
    color::luminance,
    interaction::{CLEARANCE, EXTENT_CLEARANCE},
    sampling::{around, orthonormal_basis, uniform_sphere, uniform_triangle},
    surfaces::Surfaces,
};

/// The start of a photon: origin, direction, and the power that it represents.
pub(super) struct PhotonStart {
    /// Origin in world space, just off the light.
    pub(super) origin: Vec3,
    /// Direction of travel, unit length.
    pub(super) direction: Vec3,
    /// Power that the photon represents, in watts, given its source.
    pub(super) power: Spectrum,
    /// Density by which the direction was drawn.
    pub(super) spread: DirectionDensity,
}

/// The density by which the direction was drawn.
pub(super) enum DirectionDensity {
    /// Uniform over the sphere.
    Everywhere,
    /// Proportional to the cosine to this normal.
    Cosine(Vec3),
    /// Not to be replaced by another direction.
    AsDrawn,
}

impl PhotonStart {
    /// Creates a start whose direction must be kept.
    pub(super) fn as_drawn(origin: Vec3, direction: Vec3, power: Spectrum) -> Self {
        Self { origin, direction, power, spread: DirectionDensity::AsDrawn }
    }

    /// Draws the direction of a photon that leaves a surface.
    ///
    /// - `power`: the power that a photon represents if directions are drawn by the cosine.
    fn from_surface(
        surfaces: &Surfaces,
        material: u32,
        origin: Vec3,
        n: Vec3,
        power: Spectrum,
        towards: [f32; 2],
    ) -> Self {
        match surfaces.material(material).1.profile {
            Profile::Diffuse => {
                Self { origin, direction: leaving(n, towards), power, spread: DirectionDensity::Cosine(n) }
            }
            profile => {
                let (direction, factor) = profile.leaving(surfaces.scene(), n, towards);
                Self::as_drawn(origin, direction, power * factor)
            }
        }
    }
}

/// Returns true if the photon leaves from the front, and the number of emitting sides.
fn side(sides: Sides, u: f32) -> (bool, f32) {
    match sides {
        Sides::Front => (true, 1.0),
        Sides::Back => (false, 1.0),
        Sides::Both => (u < 0.5, 2.0),
    }
}

/// Samples a photon of a spot with a radius: a direction within its cone, then a point of the disc that faces it.
fn spot_from_sphere(
    surfaces: &Surfaces,
    sphere: &Sphere,
    axis: Vec3,
    cos_outer: f32,
    place: [f32; 2],
    towards: [f32; 2],
) -> Option<PhotonStart> {
    let direction = around(axis, towards[0] * (1.0 - cos_outer), towards[1]);
    let outwards = leaving(direction, place);
    let factor =
        surfaces.material(sphere.material).1.profile.factor(surfaces.scene(), direction, outwards.dot(direction));
    let disc = PI * sphere.radius * sphere.radius;
    let radiance = sphere::radiance_at(surfaces.scene(), sphere, outwards);
    let power = radiance * (factor * disc * 2.0 * PI * (1.0 - cos_outer));
    let clearance = CLEARANCE * (sphere.center.abs().max_element() + sphere.radius);
    let origin = sphere.center + outwards * (sphere.radius + clearance);
    (luminance(power) > 0.0).then(|| PhotonStart::as_drawn(origin, direction, power))
}

/// Draws a direction by the cosine to `n`.
fn leaving(n: Vec3, u: [f32; 2]) -> Vec3 {
    let local = cosine_hemisphere(u);
    let (s, t) = orthonormal_basis(n);
    s * local.x + t * local.y + n * local.z
}

impl SurfaceLight {
    /// Estimates the light's power, as luminance.
    pub(in super::super) fn power(&self, scene: &Scene) -> f32 {
        let sides = side(scene.materials[self.material() as usize].emission_sides, 0.0).1;
        let profile = Profile::new(&scene.materials[self.material() as usize].emission_profile);
        self.flux(scene) * PI * sides * profile.power_share(scene)
    }

    /// Samples a photon, uniform by area and by the cosine. `choice`: number that chooses the side.
    pub(super) fn emit(
        &self,
        surfaces: &Surfaces,
        choice: f32,
        place: [f32; 2],
        towards: [f32; 2],
    ) -> Option<PhotonStart> {
        let scene = surfaces.scene();
        let (corner, x, y) = self.extent();
        let place = if self.is_rectangle() { place } else { uniform_triangle(place).into() };
        let (front, sides) = side(scene.materials[self.material() as usize].emission_sides, choice);
        let cross = x.cross(y);
        let double_area = cross.length();
        let n = if front { cross } else { -cross } / double_area;
        let p = corner + x * place[0] + y * place[1];
        let extent = x.abs().max(y.abs()).max_element();
        let clearance = CLEARANCE * p.abs().max_element() + EXTENT_CLEARANCE * extent;
        let power = self.radiance_at(scene, place) * (PI * self.area(double_area) * sides);
        (double_area > 0.0)
            .then(|| PhotonStart::from_surface(surfaces, self.material(), p + n * clearance, n, power, towards))
    }
}

/// Estimates the power of a sphere, as luminance.
pub(super) fn power_of_sphere(scene: &Scene, index: u32) -> f32 {
    let sphere = &scene.spheres[index as usize];
    let sides = side(scene.materials[sphere.material as usize].emission_sides, 0.0).1;
    // The intensity of the bounds is the disc's area times the radiance
    let profile = Profile::new(&scene.materials[sphere.material as usize].emission_profile);
    sphere::bounds(scene, sphere).intensity * 4.0 * PI * sides * profile.power_share(scene)
}

/// Samples a photon, uniform by area and by the cosine. `choice`: number that chooses the side.
pub(super) fn emit_from_sphere(
    surfaces: &Surfaces,
    index: u32,
    choice: f32,
    place: [f32; 2],
    towards: [f32; 2],
) -> Option<PhotonStart> {
    let scene = &**surfaces.scene();
    let sphere = &scene.spheres[index as usize];
    let material = &scene.materials[sphere.material as usize];
    let (front, sides) = side(material.emission_sides, choice);
    if let Profile::Spot { axis, cos_outer, .. } = surfaces.material(sphere.material).1.profile
        && material.emission_sides == Sides::Front
    {
        return spot_from_sphere(surfaces, sphere, axis, cos_outer, place, towards);
    }
    let outwards = uniform_sphere(place);
    let n = if front { outwards } else { -outwards };
    let radiance = sphere::radiance_at(scene, sphere, outwards);
    let area = 4.0 * PI * sphere.radius * sphere.radius;
    let clearance = CLEARANCE * (sphere.center.abs().max_element() + sphere.radius);
    let power = radiance * (PI * area * sides);
    let origin = sphere.center + outwards * sphere.radius + n * clearance;
    (luminance(power) > 0.0).then(|| PhotonStart::from_surface(surfaces, sphere.material, origin, n, power, towards))
}
