//! Orientation of analytic spheres.

use glam::{DMat3, DQuat, DVec3, Quat};

/// Returns the orientation of a sphere whose texture has its pole at +z and its u from +x towards +y, as in Mitsuba and
/// pbrt. Ours has its pole at +y, and its u starts at −z and increases towards −x.
///
/// - `rotation`: object space to world space; orthonormal, not mirroring.
pub(crate) fn orientation(rotation: &DMat3) -> Quat {
    let theirs_from_ours = DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X);
    DQuat::from_mat3(&(*rotation * theirs_from_ours)).normalize().as_quat().normalize()
}
