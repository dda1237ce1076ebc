//! Input and output of the readers of all formats.

use std::{
    io::{Seek, SeekFrom},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use crate::{ImageError, Metadata, Picture, WhitePoint, limits::ReadLimits};

/// A picture with its position and metadata.
#[derive(Clone, Debug)]
pub struct ImageFile {
    /// The pixels of the file; for EXR, those of the data window.
    pub picture: Picture,
    /// Position of the upper left pixel in the whole picture; not (0, 0) for a crop.
    pub offset: (i32, i32),
    /// Width and height of the whole picture.
    pub full_size: (u32, u32),
    /// Text metadata of the file.
    pub metadata: Metadata,
}

/// The file and limits of a reader.
pub(crate) struct PictureSource<'a> {
    pub(crate) path: &'a Path,
    pub(crate) limits: ReadLimits,
    /// Treatment of the file's white point.
    pub(crate) white_point: WhitePoint,
}

impl<'a> PictureSource<'a> {
    /// Makes a source that adapts the white point.
    pub(crate) fn new(path: &'a Path, limits: ReadLimits) -> Self {
        Self { path, limits, white_point: WhitePoint::default() }
    }

    /// Makes the error for a malformed file.
    pub(crate) fn malformed(&self, format: &'static str, detail: impl Into<String>) -> ImageError {
        ImageError::malformed(self.path, format, detail)
    }

    /// Checks the size in a header, before anything is allocated.
    ///
    /// - `width`, `height`: in pixels.
    ///
    /// # Errors
    /// The picture has no pixels, or more than the limits allow.
    pub(crate) fn check_size(&self, width: u64, height: u64) -> Result<(), ImageError> {
        let max_pixels = self.limits.max_pixels;
        match width.checked_mul(height) {
            Some(0) => Err(ImageError::Malformed {
                path: self.path.to_owned(),
                format: "picture",
                detail: format!("it announces {width} × {height} pixels"),
            }),
            Some(pixels) if pixels <= max_pixels && width.max(height) <= u64::from(u32::MAX) => Ok(()),
            _ => Err(ImageError::TooLarge { path: self.path.to_owned(), width, height, max_pixels }),
        }
    }
}

/// Returns the length of a file, which stays at its beginning.
pub(crate) fn file_bytes<R: Seek>(source: &PictureSource<'_>, input: &mut R) -> Result<u64, ImageError> {
    let length = input.seek(SeekFrom::End(0)).and_then(|length| input.rewind().map(|()| length));
    length.map_err(|error| ImageError::read(source.path, error))
}

/// Runs a decoder and turns its panics into errors of the file: fuzzing has found panics in third-party decoders.
///
/// - `format`: name of the file format, for the error.
///
/// # Errors
/// The decoder fails or panics.
pub(crate) fn guarded<T>(
    source: &PictureSource<'_>,
    format: &'static str,
    read: impl FnOnce() -> Result<T, ImageError>,
) -> Result<T, ImageError> {
    // Unwinding is safe: nothing that `read` leaves inconsistent is used afterwards.
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(source.malformed(format, "its decoder gave up")))
}
