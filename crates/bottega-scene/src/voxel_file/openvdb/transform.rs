//! The transformation of an OpenVDB grid.

use glam::{DAffine3, DMat3, DVec3};

use super::super::cursor::ByteCursor;
use super::super::error::VoxelError;

/// Reads the transformation from index space to the space of the file. `grid`: its name, for messages.
pub(super) fn read(cursor: &mut ByteCursor<'_>, grid: &str) -> Result<DAffine3, VoxelError> {
    const WHAT: &str = "the transformation of a grid";
    let map = cursor.text(WHAT)?;
    let vector = |cursor: &mut ByteCursor<'_>| cursor.f64s::<3>(WHAT).map(DVec3::from_array);
    Ok(match map.as_str() {
        "AffineMap" | "UnitaryMap" => {
            // Rows, of which the last is the translation: points are row vectors.
            let m = cursor.f64s::<16>(WHAT)?;
            let row = |index: usize| DVec3::new(m[4 * index], m[4 * index + 1], m[4 * index + 2]);
            DAffine3 { matrix3: DMat3::from_cols(row(0), row(1), row(2)), translation: row(3) }
        }
        "TranslationMap" => DAffine3::from_translation(vector(cursor)?),
        "ScaleMap" | "UniformScaleMap" => {
            let scale = vector(cursor)?;
            // Followed by what derives from it: the size of voxels, inverses
            cursor.f64s::<12>(WHAT)?;
            DAffine3::from_scale(scale)
        }
        "ScaleTranslateMap" | "UniformScaleTranslateMap" => {
            let (translation, scale) = (vector(cursor)?, vector(cursor)?);
            cursor.f64s::<12>(WHAT)?;
            DAffine3::from_translation(translation) * DAffine3::from_scale(scale)
        }
        _ => return Err(VoxelError::Transform { map, grid: grid.into() }),
    })
}
