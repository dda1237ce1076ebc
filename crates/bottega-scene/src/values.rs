//! Limits of values, and replacement of NaN, infinite and huge ones.

/// The maximum of a texel, a vertex colour component or a grid cell: a few hundred times the luminance of the sun's
/// disk in cd/m².
pub const VALUE_MAX: f32 = 1e12;

/// The maximum of a factor of a light or material. Its product with [`VALUE_MAX`] stays finite in an `f32`, even lit
/// from a millimetre away.
pub const FACTOR_MAX: f32 = 1e15;

/// Replaces unusable values: NaN by 0, and infinite ones or those beyond [`VALUE_MAX`] by the largest of the others
/// with their sign, so a sun that is too bright for its file stays the brightest spot. Returns a note for a warning,
/// `None` if nothing changed.
pub(crate) fn mend(values: &mut [f32]) -> Option<String> {
    let (mut nones, mut enormous, mut largest) = (0_usize, 0_usize, 0.0_f32);
    for value in values.iter() {
        if value.is_nan() {
            nones += 1;
        } else if value.abs() > VALUE_MAX {
            enormous += 1;
        } else {
            largest = largest.max(*value);
        }
    }
    if nones + enormous == 0 {
        return None;
    }
    for value in values {
        if value.is_nan() {
            *value = 0.0;
        } else if value.abs() > VALUE_MAX {
            *value = largest.copysign(*value);
        }
    }
    let nones = (nones > 0).then(|| format!("{nones} of its values are not numbers, and count as 0"));
    let enormous = (enormous > 0).then(|| {
        let limit = VALUE_MAX;
        format!("{enormous} of its values are infinite or above {limit:e}, and count as {largest}, the largest of the others")
    });
    Some(nones.into_iter().chain(enormous).collect::<Vec<_>>().join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_not_finite_become_numbers_and_are_reported() {
        let mended = |values: &[f32]| {
            let mut values = values.to_vec();
            let note = mend(&mut values);
            (values, note)
        };
        assert_eq!(mended(&[0.0, -3.0, 1e12]), (vec![0.0, -3.0, 1e12], None));
        let (values, note) = mended(&[f32::NAN, f32::INFINITY, 5.0, 1e30, f32::NEG_INFINITY]);
        assert_eq!(values, [0.0, 5.0, 5.0, 5.0, -5.0]);
        let note = note.unwrap();
        assert!(
            note.contains("1 of its values are not numbers") && note.contains("3 of its values are infinite"),
            "{note}"
        );
        assert_eq!(mended(&[f32::INFINITY]).0, [0.0]);
    }
}
