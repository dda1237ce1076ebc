//! Transformations of pbrt: its directives and the current transformation matrix.

use crate::import::text_place::{TextFault, TextPlace};
use glam::{Affine3A, DAffine3, DMat3, DMat4, DVec3};

/// Returns pbrt's `LookAt`: world space to a left-handed camera that looks along its +z. `None`: the directions are
/// degenerate.
pub(super) fn look_at(eye: DVec3, look: DVec3, up: DVec3) -> Option<DAffine3> {
    let z = (look - eye).try_normalize()?;
    let x = up.try_normalize()?.cross(z).try_normalize()?;
    let world_from_camera = DAffine3::from_mat3_translation(DMat3::from_cols(x, z.cross(x), z), eye);
    Some(world_from_camera.inverse())
}

/// Converts the 16 numbers of `Transform` and `ConcatTransform`, column by column.
pub(super) fn from_columns(numbers: &[f64; 16], at: TextPlace) -> Result<DAffine3, TextFault> {
    let matrix = DMat4::from_cols_array(numbers);
    let w = matrix.row(3);
    if w.truncate() != DVec3::ZERO || w.w == 0.0 {
        return Err(at.fault("the matrix is not an affine transformation: its last row is not 0 0 0 1"));
    }
    Ok(DAffine3::from_mat4(matrix * (1.0 / w.w)))
}

/// Rounds to single precision; an error if the result is singular or out of range.
pub(super) fn rounded(transform: &DAffine3, at: TextPlace) -> Result<Affine3A, TextFault> {
    let rounded = transform.as_affine3a();
    let determinant = rounded.matrix3.determinant();
    if rounded.is_finite() && determinant.is_normal() && rounded.inverse().is_finite() {
        Ok(rounded)
    } else {
        Err(at.fault("the transformation in force here cannot be inverted, or scales out of all bounds"))
    }
}

/// Returns the orthonormal axes (which may mirror) and the scales of a transformation with perpendicular axes.
pub(super) fn axes_and_scale(transform: &DAffine3) -> (DMat3, DVec3) {
    let m = transform.matrix3;
    let scale = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
    (DMat3::from_cols(m.x_axis / scale.x, m.y_axis / scale.y, m.z_axis / scale.z), scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_at_puts_the_eye_into_the_origin_and_the_target_on_plus_z() {
        let camera = look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, -4.0), DVec3::Y).unwrap();
        assert!(camera.transform_point3(DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
        assert!((camera.transform_point3(DVec3::new(1.0, 2.0, -4.0)) - DVec3::Z * 7.0).length() < 1e-12);
        // Left-handed: seen along −z with +y up, +x of the world is on the left.
        assert!(camera.transform_vector3(DVec3::X).x < 0.0);
        assert_eq!(look_at(DVec3::ZERO, DVec3::ZERO, DVec3::Y), None);
        assert_eq!(look_at(DVec3::ZERO, DVec3::Y, DVec3::Y), None);
    }

    #[test]
    fn matrices_are_given_by_columns() {
        let mut numbers = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 5.0, 6.0, 7.0, 1.0];
        let transform = from_columns(&numbers, TextPlace::default()).unwrap();
        assert_eq!(transform.translation, DVec3::new(5.0, 6.0, 7.0));
        numbers[3] = 1.0;
        assert!(from_columns(&numbers, TextPlace::default()).is_err());
    }
}
