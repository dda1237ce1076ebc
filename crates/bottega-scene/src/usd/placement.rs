//! Things placed in the world, before they are instances of the scene.

use std::rc::Rc;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Quat};

use super::light::LightSpec;
use super::source::StageSource;
use crate::error::SceneError;
use crate::import::placed_meshes::MIRROR;
use crate::model::Instance;

/// A thing with its place.
#[derive(Clone)]
pub(super) struct ThingPlacement {
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
            problem: format!("the stage places more than {PLACEMENTS_MAX} objects"),
            remedy: "leave out instances",
        });
    }
    source.take(path, more.saturating_mul(size_of::<ThingPlacement>() + size_of::<Instance>()))
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
