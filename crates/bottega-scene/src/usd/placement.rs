//! Things placed in the world, before they are instances of the scene.

use std::rc::Rc;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Quat};

use super::light::LightSpec;
use super::light_shape;
use super::material::Materials;
use super::source::StageSource;
use crate::error::SceneError;
use crate::import::placed_meshes::{MIRROR, PlacedMeshes};
use crate::model::{COORDINATE_MAX, Instance, Mesh, Scene, Sphere};
use crate::visibility::Visibility;

/// A thing with its place.
#[derive(Clone)]
pub(super) struct Placement {
    pub(super) thing: Thing,
    /// Object space to world space.
    pub(super) world_from_object: DAffine3,
    /// Path of its prim, for messages.
    pub(super) path: Rc<str>,
}

/// A thing that can be placed.
#[derive(Clone)]
pub(super) enum Thing {
    /// Index of a mesh of the scene, and of its material.
    Mesh { mesh: u32, material: u32 },
    /// A sphere around the origin.
    Sphere { radius: f64, material: u32 },
    /// A light.
    Light(Rc<LightSpec>),
}

/// Most placements of a stage.
const PLACEMENTS_MAX: usize = 1 << 28;

/// Returns an error if there are too many placements, and books their memory.
pub(super) fn book(source: &StageSource<'_>, path: &str, count: usize, more: usize) -> Result<(), SceneError> {
    if count.saturating_add(more) > PLACEMENTS_MAX {
        return Err(SceneError::Limit {
            path: source.request.path.into(),
            place: path.into(),
            problem: format!("the stage places more than {PLACEMENTS_MAX} things"),
            remedy: "leave out instances",
        });
    }
    source.take(path, more.saturating_mul(size_of::<Placement>() + size_of::<Instance>()))
}

/// Puts all placements into the scene.
pub(super) fn place_all(
    source: &StageSource<'_>,
    placements: &[Placement],
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
    placement: &Placement,
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
    placement: &Placement,
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

/// Returns the scale and rotation of a matrix; `None`: it stretches.
pub(super) fn even_scale(matrix: &DMat3) -> Option<(f64, Quat)> {
    let lengths = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec3::length);
    let scale = lengths[0];
    let is_even = lengths.iter().all(|length| (length - scale).abs() <= 1e-6 * scale);
    let unit = *matrix * (1.0 / scale);
    let is_right = unit.x_axis.dot(unit.y_axis).abs() < 1e-6
        && unit.y_axis.dot(unit.z_axis).abs() < 1e-6
        && unit.z_axis.dot(unit.x_axis).abs() < 1e-6;
    if scale == 0.0 && is_even {
        return Some((0.0, Quat::IDENTITY));
    }
    if !(is_even && is_right && unit.is_finite()) {
        return None;
    }
    // A mirrored sphere is a sphere; only its texture is mirrored
    let turned = if unit.determinant() < 0.0 { unit * DMat3::from_diagonal(MIRROR) } else { unit };
    Some((scale, glam::DQuat::from_mat3(&turned).normalize().as_quat().normalize()))
}

/// Returns a transformation without scale that keeps −z and, as far as possible, +y; `None`: it has no direction.
pub(super) fn rigid(world: &DAffine3) -> Option<Affine3A> {
    let z = world.matrix3.z_axis.try_normalize()?;
    let x = world.matrix3.y_axis.cross(z).try_normalize()?;
    let rigid = DAffine3 { matrix3: DMat3::from_cols(x, z.cross(x), z), translation: world.translation };
    let rigid = rigid.as_affine3a();
    rigid.is_finite().then_some(rigid)
}
