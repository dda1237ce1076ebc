//! Surface interactions at a time, and where their points are at others.

use bottega_kernels::Hit;
use glam::Vec3;

use super::{Interaction, TrianglePose};
use crate::{
    camera::RayCone,
    surfaces::{Surfaces, prepare_instance},
};

impl Interaction {
    /// Computes the point that a ray hit at a time of the shutter, from 0 to 1; see [`Self::new`].
    pub(crate) fn at(surfaces: &Surfaces, hit: &Hit, origin: Vec3, direction: Vec3, cone: RayCone, time: f32) -> Self {
        if let Some(index) = hit.sphere() {
            if let Some(sphere) = surfaces.moved_sphere(index, time) {
                return Self::on_sphere(surfaces, &sphere, hit, origin, direction, cone);
            }
        } else if surfaces.is_moving(hit.instance) {
            return Self::on_moving(surfaces, hit, (origin, direction), cone, time);
        }
        Self::new(surfaces, hit, origin, direction, cone)
    }

    /// Computes the point of a moving instance.
    #[cold]
    #[inline(never)]
    fn on_moving(surfaces: &Surfaces, hit: &Hit, ray: (Vec3, Vec3), cone: RayCone, time: f32) -> Self {
        let world_from_object = &surfaces.world_from_object(hit.instance, time);
        let scene = surfaces.scene();
        let index = scene.instances[hit.instance as usize].mesh;
        let mesh = &scene.meshes[index as usize];
        if let Some(curves) = &mesh.curves {
            return Self::on_curve(surfaces, curves, world_from_object, hit, ray, cone);
        }
        let triangle = mesh.triangles[hit.primitive as usize];
        let vertices = surfaces.motion().corners(scene, index, triangle, time);
        let [corners, normals] = vertices.unwrap_or_else(|| {
            let normal = |vertex: u32| mesh.normals.get(vertex as usize).copied().unwrap_or_default();
            [triangle.map(|vertex| mesh.positions[vertex as usize]), triangle.map(normal)]
        });
        let instance = prepare_instance(world_from_object);
        let (world_from_normal, scale) = (instance.world_from_normal, instance.scale);
        let pose = TrianglePose { world_from_object, world_from_normal, scale, corners, normals: || normals };
        Self::on_triangle(surfaces, &pose, hit, ray.1, cone)
    }
}

/// Returns where the point of a hit is at another time of the shutter. A point of a surface that stands still is `p` at all
/// times.
///
/// - `p`: the point at the time of the ray that hit it, world space.
/// - `times`: the time of that ray, and the other time, from 0 to 1.
pub(crate) fn place_at(surfaces: &Surfaces, hit: &Hit, p: Vec3, [time, other]: [f32; 2]) -> Vec3 {
    if let Some(index) = hit.sphere() {
        let (Some(sphere), Some(later)) = (surfaces.moved_sphere(index, time), surfaces.moved_sphere(index, other))
        else {
            return p;
        };
        let n = sphere.world_from_object.inverse() * ((p - sphere.center) / sphere.radius);
        return later.center + later.world_from_object * n * later.radius;
    }
    if !surfaces.is_moving(hit.instance) {
        return p;
    }
    let world_from_object = surfaces.world_from_object(hit.instance, other);
    if surfaces.mesh(hit.instance).curves.is_some() {
        // Curves move with their instance alone
        let local = surfaces.world_from_object(hit.instance, time).inverse().transform_point3(p);
        return world_from_object.transform_point3(local);
    }
    let [p0, p1, p2] = surfaces.corners(hit.instance, hit.primitive, other);
    world_from_object.transform_point3(p0 + (p1 - p0) * hit.u + (p2 - p0) * hit.v)
}
