//! Texture coordinates on spheres.

use std::f32::consts::PI;

use bottega_kernels::math;
use bottega_scene::Sphere;
use glam::{Vec2, Vec3};

/// Returns the texture coordinates on a sphere: u around +y, v from the upper pole down.
pub(super) fn sphere_uv(sphere: &Sphere, n: Vec3) -> Vec2 {
    let n = sphere.world_from_object.inverse() * n;
    let u = 0.5 + math::atan2(n.x, n.z) / (2.0 * PI);
    Vec2::new(u, math::acos(n.y) / PI)
}
