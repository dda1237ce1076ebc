//! Errors of reading, writing and comparing pictures.

use std::path::{Path, PathBuf};

use crate::printable::printable_path;

/// The reason why a picture or its file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The operating system cannot read the file.
    #[error("cannot read `{}`", printable_path(.path))]
    Read {
        /// The file that cannot be read.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The operating system cannot write the file.
    #[error("cannot write `{}`", printable_path(.path))]
    Write {
        /// The file that cannot be written.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The path is unsuitable for a picture, which is found before rendering; or the file format cannot hold the picture.
    #[error("cannot write `{}`: {reason}", printable_path(.path))]
    NotWritable {
        /// The path of the file.
        path: PathBuf,
        /// The reason, and what to do.
        reason: String,
    },
    /// The file is not in a supported format.
    #[error("`{}` is not a picture in a known format: EXR, PNG or Radiance HDR is expected", printable_path(.path))]
    UnknownFormat {
        /// The file of unknown format.
        path: PathBuf,
    },
    /// The file contradicts its format or is cut off.
    #[error("`{}` is not a sound {format} file: {detail}", printable_path(.path))]
    Malformed {
        /// The malformed file.
        path: PathBuf,
        /// Format of the file.
        format: &'static str,
        /// The error, and its location.
        detail: String,
    },
    /// The file is valid as far as it was read, but uses an unsupported feature.
    #[error("`{}` uses a feature of {format} that is not read: {detail}; save it again with common settings", printable_path(.path))]
    Unsupported {
        /// The file with the unsupported feature.
        path: PathBuf,
        /// Format of the file.
        format: &'static str,
        /// The unsupported feature.
        detail: String,
    },
    /// The header announces more pixels than the caller allows; nothing was allocated.
    #[error("`{}` announces {width} × {height} pixels; at most {max_pixels} are read", printable_path(.path))]
    TooLarge {
        /// The file that is too large.
        path: PathBuf,
        /// Width, in pixels.
        width: u64,
        /// Height, in pixels.
        height: u64,
        /// The caller's limit.
        max_pixels: u64,
    },
    /// An EXR file has neither R, G and B nor Y.
    #[error("`{}` holds no color: R, G, B or Y is expected, found {found}", printable_path(.path))]
    NoColor {
        /// The EXR file without color.
        path: PathBuf,
        /// Names of the file's channels.
        found: String,
    },
    /// The picture to write has no pixels.
    #[error("cannot write `{}`: the picture has no pixels", printable_path(.path))]
    Empty {
        /// The file that was to be written.
        path: PathBuf,
    },
    /// The pictures to compare differ in size.
    #[error("pictures of different sizes: {}×{} and {}×{}", .first.0, .first.1, .second.0, .second.1)]
    SizesDiffer {
        /// Width and height of the first.
        first: (u32, u32),
        /// Width and height of the second.
        second: (u32, u32),
    },
}

impl ImageError {
    /// Makes the error for a failed read.
    pub(crate) fn read(path: &Path, source: std::io::Error) -> Self {
        Self::Read { path: path.to_owned(), source }
    }

    /// Makes the error for a failed write.
    pub(crate) fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Write { path: path.to_owned(), source }
    }

    /// Makes the error for a malformed file.
    pub(crate) fn malformed(path: &Path, format: &'static str, detail: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), format, detail: detail.into() }
    }
}
