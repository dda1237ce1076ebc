//! Transformations with Mitsuba's inverse, which may be wrong.

use glam::{DMat3, DMat4, DVec3};

/// A transformation with the inverse that Mitsuba uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform {
    /// The transformation of points.
    pub(super) matrix: DMat4,
    /// Mitsuba's transposed inverse of the matrix, if it is wrong: after rotations about axes that are not of unit
    /// length, which it does not normalize.
    pub(super) taken_inverse: Option<DMat4>,
}

impl From<DMat4> for Transform {
    fn from(matrix: DMat4) -> Self {
        Self { matrix, taken_inverse: None }
    }
}

impl Transform {
    /// The transformation that moves nothing.
    pub(super) const IDENTITY: Self = Self { matrix: DMat4::IDENTITY, taken_inverse: None };

    /// Composes transformations: first `self`, then `next`.
    pub(super) fn then(self, next: Self) -> Self {
        let matrix = next.matrix * self.matrix;
        let taken = |it: &Self| it.taken_inverse.unwrap_or_else(|| it.matrix.inverse().transpose());
        let is_odd = self.taken_inverse.is_some() || next.taken_inverse.is_some();
        Self { matrix, taken_inverse: is_odd.then(|| taken(&next) * taken(&self)) }
    }

    /// Returns a rotation about an axis, by an angle in radians (Rodrigues' formula). If the axis is not of unit
    /// length, it also scales.
    pub(super) fn rodrigues(axis: DVec3, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        let cross = DMat3::from_cols(
            DVec3::new(0.0, axis.z, -axis.y),
            DVec3::new(-axis.z, 0.0, axis.x),
            DVec3::new(axis.y, -axis.x, 0.0),
        );
        let matrix = DMat4::from_mat3(DMat3::from_diagonal(DVec3::splat(cos)) + outer * (1.0 - cos) + cross * sin);
        Self { matrix, taken_inverse: Some(matrix) }
    }

    /// Returns the transformation of a shape that Mitsuba intersects with rays transformed by its inverse.
    pub(super) fn by_inverse(&self) -> DMat4 {
        self.taken_inverse.map_or(self.matrix, |taken| taken.transpose().inverse())
    }
}

/// Splits a matrix into a symmetric one of scales and shears, applied first, and a rotation (which may mirror).
///
/// Source: Higham 1986, *Computing the Polar Decomposition*.
pub(super) fn polar(matrix: &DMat3) -> (DMat3, DMat3) {
    let mut rotation = *matrix;
    for _ in 0..25 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    (rotation.transpose() * *matrix, rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_of_another_length_scale_as_in_mitsuba() {
        // `mitsuba.ScalarTransform4f().rotate([0, 1, 1], 40)` of Mitsuba 3.9.1.
        let expected = DMat3::from_cols(
            DVec3::new(0.76604444, 0.6427876, -0.6427876),
            DVec3::new(-0.6427876, 1.0, 0.23395556),
            DVec3::new(0.6427876, 0.23395556, 1.0),
        );
        let axis = DVec3::new(0.0, 1.0, 1.0);
        let found = Transform::rodrigues(axis, 40f64.to_radians());
        assert!(found.matrix.abs_diff_eq(DMat4::from_mat3(expected), 1e-7), "{found:?}");
        let (scale, rotation) = polar(&DMat3::from_mat4(found.matrix));
        assert!((rotation * scale).abs_diff_eq(expected, 1e-7) && scale.abs_diff_eq(scale.transpose(), 1e-9));
        assert!((rotation * rotation.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-9));
        // With a unit axis, the formula gives a rotation.
        let found = Transform::rodrigues(axis.normalize(), 40f64.to_radians());
        assert!(found.matrix.abs_diff_eq(DMat4::from_axis_angle(axis.normalize(), 40f64.to_radians()), 1e-12));
        assert!(found.by_inverse().abs_diff_eq(found.matrix, 1e-12));
    }
}
