//! Transformations of prims: the ordered operations of UsdGeomXformable.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use openusd::sdf::Value;
use openusd::usd::Prim;

use super::source::StageSource;
use super::values;
use crate::text::shortened;

/// The transformation of a prim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LocalTransform {
    pub(super) parent_from_prim: DAffine3,
    /// `true`: the transformations of the prim's ancestors do not apply.
    pub(super) resets: bool,
}

/// Reads the transformation of a prim. An operation that cannot be read is left out, with a warning.
pub(super) fn read(source: &StageSource<'_>, prim: &Prim, time: f64) -> LocalTransform {
    let mut local = LocalTransform { parent_from_prim: DAffine3::IDENTITY, resets: false };
    let Some(order) = source.read(prim, "xformOpOrder", time, values::texts) else { return local };
    for name in order {
        if name == "!resetXformStack!" {
            local = LocalTransform { parent_from_prim: DAffine3::IDENTITY, resets: true };
            continue;
        }
        let (name, is_inverted) = name.strip_prefix("!invert!").map_or((name.as_str(), false), |name| (name, true));
        let place = format!("{}.{}", prim.path(), shortened(name));
        // An operation without a value does nothing
        let Some(value) = source.value(prim, name, time) else { continue };
        let Some(operation) = operation(name, &value) else {
            source.unsupported(&place, "is not a transformation that can be read; it is left out");
            continue;
        };
        let is_affine = operation.row(3).abs_diff_eq(glam::DVec4::W, 1e-9);
        if !is_affine {
            source
                .unsupported(&place, "the fourth column of the matrix is left out: it is not an affine transformation");
        }
        let matrix3 = DMat3::from_mat4(operation);
        let operation = DAffine3 { matrix3, translation: operation.w_axis.truncate() };
        let operation = if is_inverted { operation.inverse() } else { operation };
        if operation.is_finite() {
            local.parent_from_prim *= operation;
        } else {
            source.warn(&place, "is not finite or cannot be inverted; it is left out");
        }
    }
    local
}

/// Returns the matrix of an operation, for column vectors; `None`: it is unknown, or its value has another type.
fn operation(name: &str, value: &Value) -> Option<DMat4> {
    let kind = name.strip_prefix("xformOp:")?.split(':').next()?;
    let number = || values::number(value);
    let vector = || values::vector(value);
    Some(match kind {
        "translate" => DMat4::from_translation(vector()?),
        "translateX" => DMat4::from_translation(DVec3::X * number()?),
        "translateY" => DMat4::from_translation(DVec3::Y * number()?),
        "translateZ" => DMat4::from_translation(DVec3::Z * number()?),
        "scale" => DMat4::from_scale(vector()?),
        "scaleX" => DMat4::from_scale(DVec3::ONE.with_x(number()?)),
        "scaleY" => DMat4::from_scale(DVec3::ONE.with_y(number()?)),
        "scaleZ" => DMat4::from_scale(DVec3::ONE.with_z(number()?)),
        "orient" => {
            // A quaternion without length turns nothing
            let turn = values::quaternion(value)?;
            DMat4::from_quat(if turn.length_squared() > 0.0 { turn.normalize() } else { DQuat::IDENTITY })
        }
        "transform" => values::matrix(value)?,
        "rotateX" => rotation(b'X', number()?)?,
        "rotateY" => rotation(b'Y', number()?)?,
        "rotateZ" => rotation(b'Z', number()?)?,
        "rotateXYZ" | "rotateXZY" | "rotateYXZ" | "rotateYZX" | "rotateZXY" | "rotateZYX" => {
            let angles = vector()?;
            // The first axis of the name turns first
            let mut matrix = DMat4::IDENTITY;
            for axis in kind.bytes().skip("rotate".len()) {
                matrix = rotation(axis, angles[usize::from(axis - b'X')])? * matrix;
            }
            matrix
        }
        _ => return None,
    })
}

/// Returns the rotation about an axis by an angle in degrees.
fn rotation(axis: u8, degrees: f64) -> Option<DMat4> {
    let radians = degrees.to_radians();
    Some(match axis {
        b'X' => DMat4::from_rotation_x(radians),
        b'Y' => DMat4::from_rotation_y(radians),
        b'Z' => DMat4::from_rotation_z(radians),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use openusd::gf;

    use super::*;

    #[test]
    fn the_first_axis_turns_first() {
        let value = Value::Vec3f(gf::vec3f(90.0, 90.0, 0.0));
        let turned = |name: &str, v: DVec3| operation(name, &value).unwrap().transform_vector3(v);
        // About x, y becomes z; about y, that becomes x
        assert!(turned("xformOp:rotateXYZ", DVec3::Y).abs_diff_eq(DVec3::X, 1e-12));
        // About y, y stays; about x, it becomes z
        assert!(turned("xformOp:rotateYXZ:pivot", DVec3::Y).abs_diff_eq(DVec3::Z, 1e-12));
    }

    #[test]
    fn unknown_operations_are_none() {
        assert_eq!(operation("xformOp:shear", &Value::Float(1.0)), None);
        assert_eq!(operation("xformOp:translate", &Value::Float(1.0)), None);
        assert_eq!(operation("translate", &Value::Vec3f(gf::vec3f(0.0, 0.0, 0.0))), None);
    }
}
