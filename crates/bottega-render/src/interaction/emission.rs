//! Light that a surface emits, and the material of a hit.

use bottega_kernels::Hit;
use bottega_scene::{Scene, Spectrum, Sphere};
use glam::Vec3;

use super::{mesh::uvs_at, sphere::sphere_uv};
use crate::surfaces::Surfaces;

/// Returns the radiance that a sphere emits at outward normal `n`.
#[inline(always)]
pub(crate) fn emitted_by_sphere(scene: &Scene, sphere: &Sphere, n: Vec3, footprint: f32) -> Spectrum {
    let emission = &scene.materials[sphere.material as usize].emission;
    if emission.texture.is_none() {
        return emission.factor;
    }
    emission.eval(scene, [sphere_uv(sphere, n); 2], footprint)
}

/// Returns the radiance that a triangle emits at barycentric coordinates.
#[inline(always)]
pub(crate) fn emitted(scene: &Scene, instance: u32, triangle: u32, b: (f32, f32), footprint: f32) -> Spectrum {
    let instance = &scene.instances[instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let emission = &scene.materials[scene.material_of(instance) as usize].emission;
    if emission.texture.is_none() {
        return emission.factor;
    }
    emission.eval(scene, uvs_at(mesh, mesh.triangles[triangle as usize], b.0, b.1), footprint)
}

/// Returns the material of the surface that was hit.
pub(crate) fn material_of(surfaces: &Surfaces, hit: &Hit) -> u32 {
    let scene = surfaces.scene();
    match hit.sphere() {
        Some(sphere) => scene.spheres[sphere as usize].material,
        None => surfaces.material_of(hit.instance),
    }
}

/// Returns true if the surface that was hit emits light, on any side.
pub(crate) fn shines(surfaces: &Surfaces, hit: &Hit) -> bool {
    surfaces.material(material_of(surfaces, hit)).1.shines
}
