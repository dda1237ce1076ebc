//! Fields of view of sensors and projectors.

use super::context::ImportContext;
use super::document::Object;
use super::value::{Value, number};
use crate::camera::FovAxis;
use crate::import::text_place::ImportResult;
use crate::text::shortened;

/// Returns the axis of a sensor's or projector's field of view.
pub(super) fn fov_axis(context: &mut ImportContext<'_>, object: &Object) -> ImportResult<FovAxis> {
    let axis = object.string("fov_axis")?;
    if object.property("fov").is_none() {
        return Ok(FovAxis::Diagonal);
    }
    Ok(match axis {
        None | Some("x") => FovAxis::X,
        Some("y") => FovAxis::Y,
        Some("diagonal") => FovAxis::Diagonal,
        Some("smaller") => FovAxis::Smaller,
        Some("larger") => FovAxis::Larger,
        Some(other) => {
            let message = format!("`fov_axis` cannot be `{}`; `x` replaces it", shortened(other));
            context.warn(object.at, message);
            FovAxis::X
        }
    })
}

/// Returns the field of view in radians, along the axis of [`fov_axis`]; a focal length gives the diagonal.
pub(super) fn fov(object: &Object) -> ImportResult<f64> {
    if let Some(fov) = object.float("fov")? {
        if !(fov > 0.0 && fov < 180.0) {
            return Err(object.at.fault(format!("a field of view of {fov}° shows nothing")).into());
        }
        return Ok(fov.to_radians());
    }
    let millimetres = match object.property("focal_length") {
        None => 50.0,
        Some(property) => match &property.value {
            Value::String(text) => {
                number(text.trim().trim_end_matches("mm")).map_err(|problem| property.at.fault(problem))?
            }
            Value::Float(length) => *length,
            Value::Integer(length) => *length as f64,
            _ => return Err(property.wrong("a focal length").into()),
        },
    };
    if millimetres <= 0.0 {
        return Err(object.at.fault("the focal length is not above 0").into());
    }
    // On film of 36 mm × 24 mm.
    Ok(2.0 * (0.5 * f64::hypot(36.0, 24.0) / millimetres).atan())
}

/// Returns the angle from the lower to the upper edge, in radians.
///
/// - `aspect`: width over height.
pub(super) fn vertical_fov(fov: f64, axis: FovAxis, aspect: f64) -> f64 {
    let tan = (0.5 * fov).tan();
    let tan_y = match axis {
        FovAxis::X => tan / aspect,
        FovAxis::Y => tan,
        FovAxis::Diagonal => tan / (1.0 + aspect * aspect).sqrt(),
        FovAxis::Smaller => tan / aspect.min(1.0),
        FovAxis::Larger => tan / aspect.max(1.0),
    };
    2.0 * tan_y.atan()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_view_are_those_of_mitsuba() {
        // tan of half the vertical angle for 90° on a film of 2 : 1, as Mitsuba 3.9 has it.
        let cases = [
            (FovAxis::X, 0.5),
            (FovAxis::Y, 1.0),
            (FovAxis::Diagonal, 0.4472),
            (FovAxis::Smaller, 1.0),
            (FovAxis::Larger, 0.5),
        ];
        for (axis, expected) in cases {
            let tan = (0.5 * vertical_fov(std::f64::consts::FRAC_PI_2, axis, 2.0)).tan();
            assert!((tan - expected).abs() < 1e-4, "{axis:?}: {tan}");
        }
    }
}
