//! Placements as instances, spheres and lights of the scene.

use glam::{DAffine3, DMat3};

use super::light_shape;
use super::material::Materials;
use super::placement::{Thing, ThingPlacement, even_scale};
use super::source::StageSource;
use crate::error::SceneError;
use crate::import::placed_meshes::{MIRROR, PlacedMeshes};
use crate::model::{COORDINATE_MAX, Instance, Mesh, Scene, Sphere};
use crate::visibility::Visibility;

/// Puts all placements into the scene.
pub(super) fn place_all(
    source: &StageSource<'_>,
    placements: &[ThingPlacement],
    scene: &mut Scene,
    materials: &mut Materials<'_, '_>,
) -> Result<(), SceneError> {
    let mut placed = PlacedMeshes::new(source.request.origin);
    for placement in placements {
        match &placement.thing {
            &Thing::Mesh { mesh, material } => {
                place_mesh(source, &mut placed, scene, placement, mesh, material)?;
            }
            &Thing::Sphere { radius, material } => {
                place_sphere(source, &mut placed, scene, placement, radius, material)?;
            }
            Thing::Light(spec) => light_shape::place(source, scene, materials, spec, placement),
        }
    }
    Ok(())
}

/// Places a mesh. One that cannot be placed is left out, with a warning unless it is scaled to a point.
fn place_mesh(
    source: &StageSource<'_>,
    placed: &mut PlacedMeshes,
    scene: &mut Scene,
    placement: &ThingPlacement,
    mut mesh: u32,
    material: u32,
) -> Result<(), SceneError> {
    let center = placed.center(scene, mesh, |warning| source.warn(&placement.path, warning));
    let mut world = placement.world_from_object * DAffine3::from_translation(center);
    if world.matrix3.determinant() < 0.0 {
        mesh = placed.mirrored(scene, mesh, |bytes| source.take(&placement.path, bytes))?;
        world *= DAffine3::from_scale(MIRROR);
    }
    let world_from_object = world.as_affine3a();
    if !placed.is_placeable(scene, mesh, &world_from_object) {
        if world.matrix3 != DMat3::ZERO {
            source.warn(&placement.path, "the transformation is singular, or out of reach; it is left out");
        }
        return Ok(());
    }
    let own = (scene.meshes[mesh as usize].material != material).then_some(material);
    scene.instances.push(Instance { material: own, ..Instance::new(mesh, world_from_object) });
    Ok(())
}

/// Places a sphere: analytic if it is scaled evenly, else as a mesh.
fn place_sphere(
    source: &StageSource<'_>,
    placed: &mut PlacedMeshes,
    scene: &mut Scene,
    placement: &ThingPlacement,
    radius: f64,
    material: u32,
) -> Result<(), SceneError> {
    let DAffine3 { matrix3, translation } = placement.world_from_object;
    let Some((scale, rotation)) = even_scale(&matrix3) else {
        let mesh = Mesh::uv_sphere(glam::Vec3::ZERO, radius as f32, 64).with_material(material);
        source.take(&placement.path, mesh.memory_bytes())?;
        let mesh = scene.push_mesh(mesh);
        return place_mesh(source, placed, scene, placement, mesh, material);
    };
    let radius = (radius * scale) as f32;
    let is_sound = radius > 0.0 && radius <= COORDINATE_MAX && translation.abs().max_element() <= COORDINATE_MAX.into();
    if !is_sound {
        if scale > 0.0 {
            source.warn(&placement.path, "the sphere is out of reach; it is left out");
        }
        return Ok(());
    }
    scene.spheres.push(Sphere {
        center: translation.as_vec3(),
        radius,
        world_from_object: rotation,
        material,
        visibility: Visibility::ALL,
        motion: Vec::new(),
    });
    Ok(())
}
