//! Orientation and position of sensors and emitters.

use glam::{Affine3A, DMat3, DMat4, DVec3};

use super::context::ImportContext;
use super::document::Object;

/// Returns rotation (which may mirror) and position of a transformation, and true if it has no other part. `None`: it
/// is singular.
pub(super) fn standing(to_world: &DMat4) -> Option<(DMat3, DVec3, bool)> {
    let linear = DMat3::from_mat4(*to_world);
    // Keep the viewing direction and make the other axes perpendicular to it.
    let z = linear.z_axis.try_normalize()?;
    let y = (linear.y_axis - z * z.dot(linear.y_axis)).try_normalize()?;
    let x = linear.x_axis - z * z.dot(linear.x_axis);
    let x = (x - y * y.dot(x)).try_normalize()?;
    let rotation = DMat3::from_cols(x, y, z);
    let position = to_world.w_axis.truncate();
    (rotation.is_finite() && position.is_finite()).then(|| (rotation, position, linear.abs_diff_eq(rotation, 1e-3)))
}

/// Returns the orthonormal part of a transformation; it may mirror.
pub(super) fn rotation(context: &mut ImportContext<'_>, object: &Object, to_world: &DMat4) -> DMat3 {
    match standing(to_world) {
        Some((rotation, _, is_pure)) => {
            if !is_pure {
                context.warn(object.at, format!("the scale of the {} is left out", object.describe()));
            }
            rotation
        }
        None => {
            context.warn(object.at, format!("the {} has no orientation", object.describe()));
            DMat3::IDENTITY
        }
    }
}

/// Returns world from camera space. Our camera looks along −z with +x to the right, Mitsuba's along +z with +x to the
/// left.
pub(super) fn looking(rotation: &DMat3, position: DVec3) -> Affine3A {
    let turned = *rotation * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
    Affine3A { matrix3: turned.as_mat3().into(), translation: position.as_vec3().into() }
}
