//! Transformations as sequences of operations.

use glam::{DMat4, DVec3, DVec4};

use super::placement::Transform;
use super::report::ImportReport;
use super::value::{ValueError, number, numbers, triple, vector};
use super::xml::XmlElement;
use crate::import::text_place::TextFault;

/// Tolerance of a rotation axis' squared length around 1.
const AXIS_TOLERANCE: f64 = 1e-6;

/// Reads the operations of a `<transform>`, the first one applied first.
///
/// - `is_old`: rotation axes are normalized, as before Mitsuba 2.
pub(super) fn read(element: &XmlElement, is_old: bool, report: &mut ImportReport) -> Result<Transform, TextFault> {
    let mut transform = Transform::IDENTITY;
    for operation in &element.children {
        let next = read_operation(operation, is_old).map_err(|error| operation.at.fault(error))?;
        if next.taken_inverse.is_some() {
            let message =
                "the axis of a rotation is not of unit length, and scales what is rotated as in Mitsuba 2 and 3";
            report.note(operation.at, message);
        }
        transform = transform.then(next);
        if !transform.matrix.is_finite() {
            return Err(operation.at.fault(ValueError::NotFinite));
        }
    }
    Ok(transform)
}

fn read_operation(operation: &XmlElement, is_old: bool) -> Result<Transform, ValueError> {
    let matrix = match operation.name.as_str() {
        "translate" => DMat4::from_translation(vector(operation, 0.0)?),
        "scale" => DMat4::from_scale(vector(operation, 1.0)?),
        "rotate" => {
            let angle = operation.required("angle")?;
            let angle = number(angle)?.to_radians();
            let axis = vector(operation, 0.0)?;
            let unit = axis.try_normalize().ok_or(ValueError::NoAxis)?;
            if !is_old && (axis.length_squared() - 1.0).abs() > AXIS_TOLERANCE {
                return Ok(Transform::rodrigues(axis, angle));
            }
            DMat4::from_axis_angle(unit, angle)
        }
        "lookat" | "lookAt" => {
            let missing = |attribute| ValueError::NoAttribute { tag: "lookat".into(), attribute };
            let point = |name: &'static str| operation.attribute(name).map(triple).transpose();
            let origin = point("origin")?.ok_or_else(|| missing("origin"))?;
            let target = point("target")?.ok_or_else(|| missing("target"))?;
            look_at(origin, target, point("up")?.unwrap_or(DVec3::ZERO))?
        }
        "matrix" => {
            let text = operation.required("value")?;
            let m = numbers(text)?;
            match m.len() {
                16 => DMat4::from_cols_slice(&m).transpose(),
                9 => DMat4::from_mat3(glam::DMat3::from_cols_slice(&m).transpose()),
                count => return Err(ValueError::MatrixSize { count }),
            }
        }
        other => return Err(ValueError::NotOperation(other.into())),
    };
    Ok(matrix.into())
}

/// Returns the transformation of +z to the direction of the target, +y as close to `up` as possible, and +x to the
/// left.
fn look_at(origin: DVec3, target: DVec3, up: DVec3) -> Result<DMat4, ValueError> {
    let direction = (target - origin).try_normalize().ok_or(ValueError::LooksAtOrigin)?;
    let left = match up.cross(direction).try_normalize() {
        Some(left) => left,
        // Without `up`, or with one along the line of sight, choose any.
        None => direction.any_orthonormal_vector(),
    };
    let up = direction.cross(left);
    let column = |v: DVec3, w: f64| DVec4::from((v, w));
    Ok(DMat4::from_cols(column(left, 0.0), column(up, 0.0), column(direction, 0.0), column(origin, 1.0)))
}
