//! Opacity of surfaces at candidate hits.

use bottega_kernels::{Hit, Ray};
use bottega_scene::{Scene, Sphere};
use glam::{Affine3A, Vec3};

use super::{
    curve::meeting,
    mesh::{interpolate, uvs_at},
    sphere::sphere_uv,
};
use crate::{
    mapping::{MappingPoint, TexturePlace},
    surfaces::Surfaces,
};

/// Returns the opacity of a triangle at barycentric coordinates, in [0, 1].
pub(crate) fn opacity_at(scene: &Scene, instance: u32, triangle: u32, b: (f32, f32)) -> f32 {
    let world_from_object = &scene.instances[instance as usize].world_from_object;
    posed_opacity_at(scene, instance, triangle, b, world_from_object)
}

/// Returns the opacity of a triangle of an instance with this transformation.
fn posed_opacity_at(scene: &Scene, instance: u32, triangle: u32, b: (f32, f32), world_from_object: &Affine3A) -> f32 {
    let instance = &scene.instances[instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let vertices = mesh.triangles[triangle as usize];
    let alpha = interpolate(&mesh.colors, vertices, b.0, b.1).map_or(1.0, |color| color.w);
    let material = &scene.materials[scene.material_of(instance) as usize];
    let uvs = uvs_at(mesh, vertices, b.0, b.1);
    let is_mapped = material.opacity.texture.as_ref().is_some_and(|(map, _)| map.mapping(scene).is_some());
    if !is_mapped {
        return material.opacity_at(scene, uvs, 0.0, alpha);
    }
    let local = interpolate(&mesh.positions, vertices, b.0, b.1).unwrap_or_default();
    let mapping_point = MappingPoint::sharp(world_from_object.transform_point3(local));
    material.opacity_at(scene, TexturePlace { uvs, mapping_point }, 0.0, alpha)
}

/// Returns the opacity of a sphere at a point on it, in [0, 1].
///
/// - `from_center`: vector from the sphere's centre to the point.
pub(crate) fn opacity_of_sphere(scene: &Scene, sphere: &Sphere, from_center: Vec3) -> f32 {
    let material = &scene.materials[sphere.material as usize];
    let uv = sphere_uv(sphere, from_center.normalize_or(Vec3::Y));
    let mapping_point = MappingPoint::sharp(sphere.center + from_center);
    material.opacity_at(scene, TexturePlace { uvs: [uv; 2], mapping_point }, 0.0, 1.0)
}

/// Returns the opacity at a candidate hit at a time, and true if a ray leaves a sphere there.
pub(crate) fn opacity_of(surfaces: &Surfaces, ray: &Ray, time: f32, hit: &Hit) -> (f32, bool) {
    let scene = &**surfaces.scene();
    let moved = hit.sphere().and_then(|index| surfaces.moved_sphere(index, time));
    let sphere = hit.sphere().map(|index| moved.as_ref().unwrap_or(&scene.spheres[index as usize]));
    let material = match sphere {
        Some(sphere) => sphere.material,
        None => {
            let mesh = surfaces.mesh(hit.instance);
            if let Some(curves) = &mesh.curves {
                let world_from_object = surfaces.world_from_object(hit.instance, time);
                if meeting(curves, &world_from_object, hit, (ray.origin, ray.direction), ray.t_max).is_none() {
                    return (0.0, false);
                }
            }
            surfaces.material_of(hit.instance)
        }
    };
    let known = surfaces.material(material).1;
    if !known.has_opacity || known.is_null {
        return (if known.is_null { 0.0 } else { 1.0 }, false);
    }
    match sphere {
        Some(sphere) => {
            let ng = ray.origin + hit.t * ray.direction - sphere.center;
            (opacity_of_sphere(scene, sphere, ng), ng.dot(ray.direction) > 0.0)
        }
        None => {
            let world_from_object = surfaces.world_from_object(hit.instance, time);
            let place = (hit.u, hit.v);
            (posed_opacity_at(scene, hit.instance, hit.primitive, place, &world_from_object), false)
        }
    }
}
