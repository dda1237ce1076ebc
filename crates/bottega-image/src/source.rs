//! The source of a picture, as the readers of all formats need it, and what they make.

use std::{
    io::{Seek, SeekFrom},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use crate::{ImageError, Metadata, Picture, WhitePoint, limits::ReadLimits};

/// A picture and what its file says of it.
#[derive(Clone, Debug)]
pub struct ImageFile {
    /// The pixels that the file holds: of EXR, those of the data window.
    pub picture: Picture,
    /// Where the upper left pixel lies in the whole picture: other than (0, 0) for a crop.
    pub offset: (i32, i32),
    /// Width and height of the whole picture.
    pub full_size: (u32, u32),
    /// Text that the file carries.
    pub metadata: Metadata,
}

/// What the readers of all formats need to know.
pub(crate) struct PictureSource<'a> {
    pub(crate) path: &'a Path,
    pub(crate) limits: ReadLimits,
    pub(crate) white_point: WhitePoint,
}

impl<'a> PictureSource<'a> {
    pub(crate) fn new(path: &'a Path, limits: ReadLimits) -> Self {
        Self { path, limits, white_point: WhitePoint::default() }
    }

    pub(crate) fn malformed(&self, format: &'static str, detail: impl Into<String>) -> ImageError {
        ImageError::malformed(self.path, format, detail)
    }

    /// To be asked with the size in the header, before anything is allocated by it.
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

/// How long a file is, which stays at its beginning.
pub(crate) fn file_bytes<R: Seek>(source: &PictureSource<'_>, input: &mut R) -> Result<u64, ImageError> {
    let length = input.seek(SeekFrom::End(0)).and_then(|length| input.rewind().map(|()| length));
    length.map_err(|error| ImageError::read(source.path, error))
}

/// The decoders are other people's, and fuzzing has found panics in such before: one becomes an error of the file.
pub(crate) fn guarded<T>(
    source: &PictureSource<'_>,
    format: &'static str,
    read: impl FnOnce() -> Result<T, ImageError>,
) -> Result<T, ImageError> {
    // Nothing that `read` leaves half changed outlives it, so unwinding out of it is safe.
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(source.malformed(format, "its decoder gave up")))
}
