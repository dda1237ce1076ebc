//! Images of renders and of their differences.

use std::path::Path;

use bottega_image::{Canvas, Picture, ToneMap};

use crate::error::Error;

pub(super) fn write_png(folder: &Path, name: &str, picture: &Picture) -> Result<(), Error> {
    Ok(Canvas::of_picture(picture, 0.0, ToneMap::Agx).write_png(folder.join(name))?)
}

/// Returns five times the absolute difference, as in the paper's figures 4 and 5.
pub(super) fn difference(a: &Picture, b: &Picture) -> Picture {
    let pixel = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|i| 5.0 * (a[i] - b[i]).abs());
    Picture { data: a.data.iter().zip(&b.data).map(pixel).collect(), ..*a }
}
