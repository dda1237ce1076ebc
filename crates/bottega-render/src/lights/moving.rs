//! Bounds of lights that move, over the whole span of the shutter. The tree chooses lights by them.

use bottega_kernels::{Aabb, MovingTransform};
use glam::Vec3;

use super::{
    bounds::{Cone, LightBounds},
    panel::Panel,
};
use crate::surfaces::Surfaces;

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
    let instance = &scene.instances[panel.instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let triangle = mesh.triangles[panel.triangle as usize];
    // Bound the triangle in object space, then its path
    let moved = motion.triangle_bounds(scene, instance.mesh, triangle);
    let still = || triangle.iter().fold(Aabb::EMPTY, |all, &vertex| all.with(mesh.positions[vertex as usize]));
    let object = moved.unwrap_or_else(still);
    let transform = motion.instance(panel.instance);
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
