//! Whole HDR pictures for textures and environments: OpenEXR and Radiance.
//!
//! If an OpenEXR file's data window is smaller or larger than the picture, the result has the size of the picture:
//! missing pixels are black and transparent, and pixels outside are ignored.

use std::{io::Cursor, path::Path};

use crate::{
    ImageError, Picture, WhitePoint,
    exr_read::{self, ColorHeader, ExrWindow, WantedChannels},
    limits::{Packing, ReadLimits, check_announced},
    radiance_read,
    source::{PictureSource, guarded},
};

/// Returns true if bytes begin like an OpenEXR or Radiance file.
pub fn is_float_picture(bytes: &[u8]) -> bool {
    is_exr(bytes) || radiance_read::recognizes(bytes)
}

fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

/// The header of a file, read without allocating the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WholeHeader {
    /// Width of the picture, in pixels.
    pub width: u32,
    /// Height of the picture, in pixels.
    pub height: u32,
    /// `true`: the picture has alpha beside the color.
    pub has_alpha: bool,
}

/// A picture with all its pixels.
#[derive(Clone, Debug)]
pub struct WholePicture {
    /// Linear Rec. 709 colors.
    pub picture: Picture,
    /// Alpha, row by row from the top; `None` if the file has none.
    pub alpha: Option<Vec<f32>>,
    /// Notes for the user about choices and omissions, each beginning with "it" or "its".
    pub notes: Vec<String>,
}

impl WholeHeader {
    /// Reads and checks the header of an OpenEXR or Radiance file.
    ///
    /// - `name`: file name, for errors.
    /// - `bytes`: the whole file.
    ///
    /// # Errors
    /// The bytes are not such a picture, are damaged, use an unsupported feature, have no color or no pixels, or exceed the
    /// limits.
    pub fn read(name: impl AsRef<Path>, bytes: &[u8], limits: ReadLimits) -> Result<Self, ImageError> {
        let source = PictureSource::new(name.as_ref(), limits);
        if is_exr(bytes) {
            let described = guarded(&source, "EXR", || exr_read::describe(&source, Cursor::new(bytes)))?;
            return Self::of(&source, &described);
        }
        let mut input = bytes;
        let header = radiance_read::RadianceHeader::read(&source, &mut input, bytes.len() as u64)?;
        let (width, height) = header.size();
        Ok(Self { width, height, has_alpha: false })
    }

    fn of(source: &PictureSource<'_>, described: &ColorHeader) -> Result<Self, ImageError> {
        let placing = Placing::of(described.window());
        let (width, height) = placing.size;
        source.check_size(u64::from(width), u64::from(height))?;
        // A small data window in a large frame takes no bytes for the rest.
        let held = described.window().size;
        check_announced(
            (u64::from(width), u64::from(height)),
            32,
            Packing::Unbounded,
            u64::from(held.0) * u64::from(held.1),
        )
        .map_err(|_| {
            let (columns, rows) = held;
            source.malformed("EXR", format!("it announces {width} × {height} pixels and holds {columns} × {rows}"))
        })?;
        Ok(Self { width, height, has_alpha: described.has_alpha() })
    }
}

/// Reads the picture of an OpenEXR or Radiance file; `name` and `bytes` as for [`WholeHeader::read`].
///
/// - `white_point`: treatment of a white point other than D65.
///
/// # Errors
/// As for [`WholeHeader::read`].
pub fn read_whole(
    name: impl AsRef<Path>,
    bytes: &[u8],
    limits: ReadLimits,
    white_point: WhitePoint,
) -> Result<WholePicture, ImageError> {
    let source = PictureSource { white_point, ..PictureSource::new(name.as_ref(), limits) };
    if !is_exr(bytes) {
        let (file, notes) = radiance_read::read(&source, bytes, bytes.len() as u64)?;
        return Ok(WholePicture { picture: file.picture, alpha: None, notes });
    }
    let described = guarded(&source, "EXR", || exr_read::describe(&source, Cursor::new(bytes)))?;
    WholeHeader::of(&source, &described)?;
    let read = guarded(&source, "EXR", || {
        exr_read::read(&source, Cursor::new(bytes), WantedChannels { names: &[], alpha: true })
    })?;
    let placing = Placing::of(described.window());
    let mut notes = read.notes;
    notes.extend(placing.is_apart.then(|| "its data window lies outside of its display window, and counts".to_owned()));
    let (width, height) = placing.size;
    let data = placing.place(read.file.picture.data, [0.0; 3]);
    let alpha = read.alpha.map(|alpha| placing.place(alpha, 0.0));
    Ok(WholePicture { picture: Picture { width, height, data }, alpha, notes })
}

/// The position of a file's pixels in its picture.
struct Placing {
    window: ExrWindow,
    /// Columns and rows of the picture.
    size: (u32, u32),
    /// `true`: the data window does not overlap the picture, so its pixels become the picture.
    is_apart: bool,
}

impl Placing {
    fn of(window: ExrWindow) -> Self {
        let overlaps = |offset: i32, size: u32, full: u32| {
            i64::from(offset) < i64::from(full) && i64::from(offset) + i64::from(size) > 0
        };
        let is_apart = !overlaps(window.offset.0, window.size.0, window.full_size.0)
            || !overlaps(window.offset.1, window.size.1, window.full_size.1);
        Self { window, size: if is_apart { window.size } else { window.full_size }, is_apart }
    }

    /// Places pixels in the picture.
    ///
    /// - `pixels`: pixels of the file, row by row.
    /// - `outside`: value of the pixels that the file lacks.
    fn place<T: Copy>(&self, pixels: Vec<T>, outside: T) -> Vec<T> {
        let ExrWindow { size, offset, full_size } = self.window;
        if self.is_apart || (offset == (0, 0) && size == full_size) {
            return pixels;
        }
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let mut placed = vec![outside; width * height];
        // First pixel in the picture, first pixel of the file, and number of pixels.
        let overlap = |offset: i32, size: u32, full: u32| {
            let start = offset.max(0) as usize;
            let end = (i64::from(offset) + i64::from(size)).min(i64::from(full)) as usize;
            (start, (start as i64 - i64::from(offset)) as usize, end.saturating_sub(start))
        };
        let (x, first_column, columns) = overlap(offset.0, size.0, full_size.0);
        let (y, first_row, rows) = overlap(offset.1, size.1, full_size.1);
        let lines = pixels.chunks_exact(size.0 as usize).skip(first_row).take(rows);
        for (row, line) in placed.chunks_exact_mut(width).skip(y).zip(lines) {
            row[x..x + columns].copy_from_slice(&line[first_column..first_column + columns]);
        }
        placed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(size: (u32, u32), offset: (i32, i32), full_size: (u32, u32)) -> (Vec<u32>, bool) {
        let placing = Placing::of(ExrWindow { size, offset, full_size });
        (placing.place((1..=size.0 * size.1).collect(), 0), placing.is_apart)
    }

    #[test]
    fn the_data_window_is_placed_in_the_display_window() {
        assert_eq!(placed((2, 1), (0, 0), (2, 1)).0, [1, 2]);
        assert_eq!(placed((2, 1), (1, 1), (3, 2)).0, [0, 0, 0, 0, 1, 2]);
        // Data windows that extend beyond the edges or lie outside.
        assert_eq!(placed((4, 3), (-1, -1), (2, 1)).0, [6, 7]);
        assert_eq!(placed((2, 2), (-1, 1), (2, 2)).0, [0, 0, 2, 0]);
        assert_eq!(placed((2, 1), (5, 0), (3, 1)), (vec![1, 2], true));
    }
}
