//! Triangles that shine.

use bottega_scene::{Scene, Spectrum};
use glam::Vec3;

use super::{LightSample, exitance, spherical::SphericalTriangle};
use crate::{
    interaction::{emitted, opacity_at},
    prepare::PreparedScene,
    sampling::uniform_triangle,
};

/// A triangle that is seen under a larger solid angle than this is sampled by solid angle, in sr. Below, area sampling
/// is as good, cheaper and more precise.
const SOLID_ANGLE_MIN: f32 = 0.25;

/// The corners in world space.
#[inline]
fn corners(scene: &Scene, instance: u32, triangle: u32) -> [Vec3; 3] {
    let instance = &scene.instances[instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    mesh.triangles[triangle as usize]
        .map(|vertex| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]))
}

/// Luminous power, for the choice of a light.
pub(super) fn power(scene: &Scene, instance: u32, triangle: u32) -> f32 {
    let [a, b, c] = corners(scene, instance, triangle);
    let area = 0.5 * (b - a).cross(c - a).length();
    let mesh = &scene.meshes[scene.instances[instance as usize].mesh as usize];
    let material = &scene.materials[mesh.material as usize];
    let mean = if material.emission.texture.is_some() {
        // The centers of the four triangles that halving the edges makes.
        let third = 1.0 / 3.0;
        let sixth = 1.0 / 6.0;
        let places = [(third, third), (sixth, sixth), (4.0 * sixth, sixth), (sixth, 4.0 * sixth)];
        let footprint = mesh_uv_size(scene, instance, triangle) * 0.5;
        places.iter().map(|&b| emitted(scene, instance, triangle, b, footprint)).sum::<Spectrum>() / 4.0
    } else {
        material.emission.factor
    };
    area * exitance(mean, material.emission_sides)
}

/// The size of a triangle in texture coordinates.
fn mesh_uv_size(scene: &Scene, instance: u32, triangle: u32) -> f32 {
    let mesh = &scene.meshes[scene.instances[instance as usize].mesh as usize];
    let [a, b, c] =
        mesh.triangles[triangle as usize].map(|vertex| mesh.uvs[0].get(vertex as usize).copied().unwrap_or_default());
    (b - a).perp_dot(c - a).abs().sqrt()
}

/// How a triangle is sampled from a point: a pure function of both, so that `sample` and `pdf` agree.
enum Strategy {
    SolidAngle(SphericalTriangle),
    /// By area: twice the area.
    Area(f32),
}

impl Strategy {
    #[inline]
    fn of(corners: &[Vec3; 3], from: Vec3) -> Self {
        let [a, b, c] = *corners;
        let double_area = (b - a).cross(c - a).length();
        // An upper bound of the solid angle, good enough from afar.
        let middle = (a + b + c) * (1.0 / 3.0) - from;
        if 0.5 * double_area > SOLID_ANGLE_MIN * middle.length_squared()
            && let Some(spherical) = SphericalTriangle::new(corners, from)
        {
            return Self::SolidAngle(spherical);
        }
        Self::Area(double_area)
    }
}

/// Draws a place on the triangle for the point `from`.
#[inline]
pub(super) fn sample(
    prepared: &PreparedScene,
    instance: u32,
    triangle: u32,
    from: Vec3,
    u: [f32; 2],
) -> Option<LightSample> {
    let scene = &**prepared.scene();
    let corners = corners(scene, instance, triangle);
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let material = &scene.materials[scene.meshes[scene.instances[instance as usize].mesh as usize].material as usize];
    let (barycentric, solid_angle_pdf) = match Strategy::of(&corners, from) {
        Strategy::SolidAngle(spherical) => (spherical.sample(&corners, from, u)?, Some(spherical.pdf())),
        Strategy::Area(_) => (uniform_triangle(u), None),
    };
    let p = a + (b - a) * barycentric.0 + (c - a) * barycentric.1;
    let to_light = p - from;
    let distance_squared = to_light.length_squared();
    let distance = distance_squared.sqrt();
    // Twice the projected area times the distance, above 0 where the front is seen.
    let facing = -normal.dot(to_light);
    if !(distance > 0.0 && facing != 0.0 && material.emission_sides.has(facing > 0.0)) {
        return None;
    }
    let pdf = solid_angle_pdf.unwrap_or_else(|| 2.0 * distance_squared * distance / facing.abs());
    let mut radiance = emitted(scene, instance, triangle, barycentric, 0.0);
    if material.has_opacity() {
        radiance *= opacity_at(scene, instance, triangle, barycentric);
    }
    pdf.is_finite().then_some(LightSample { wi: to_light / distance, distance, radiance, pdf, is_delta: false })
}

/// Density per solid angle with which [`sample`] draws the place `p` from `from`.
pub(super) fn pdf(prepared: &PreparedScene, instance: u32, triangle: u32, from: Vec3, p: Vec3, ng: Vec3) -> f32 {
    match Strategy::of(&corners(prepared.scene(), instance, triangle), from) {
        Strategy::SolidAngle(spherical) => spherical.pdf(),
        Strategy::Area(double_area) => {
            let to_light = p - from;
            let distance_squared = to_light.length_squared();
            let projected = double_area * ng.dot(to_light).abs();
            if projected > 0.0 { 2.0 * distance_squared * distance_squared.sqrt() / projected } else { 0.0 }
        }
    }
}
