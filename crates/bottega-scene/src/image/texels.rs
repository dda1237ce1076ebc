//! Decoded texels, before they become an image.

use bytemuck::Pod;

use super::error::PictureError;
use crate::values;

/// The decoded texels of a picture, row-major from the upper row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum DecodedTexels {
    Gray8(Vec<u8>),
    Rgb8(Vec<[u8; 3]>),
    Rgba8(Vec<[u8; 4]>),
    Rgba16(Vec<[u16; 4]>),
    Rgb32(Vec<[f32; 3]>),
    Rgba32(Vec<[f32; 4]>),
}

impl DecodedTexels {
    /// Replaces NaN, infinite and huge floats; see [`values::mend`]. Returns a note for a warning; `None`: nothing
    /// changed.
    pub(super) fn mend(&mut self) -> Option<String> {
        match self {
            Self::Rgb32(texels) => values::mend(texels.as_flattened_mut()),
            Self::Rgba32(texels) => values::mend(texels.as_flattened_mut()),
            _ => None,
        }
    }
}

/// Allocates zeroed texels.
pub(super) fn zeroed<T: Pod>(count: usize) -> Result<Vec<T>, PictureError> {
    let mut texels = Vec::new();
    texels.try_reserve_exact(count).map_err(|_| PictureError::NoMemory(format!("{count} pixels")))?;
    texels.resize(count, T::zeroed());
    Ok(texels)
}
