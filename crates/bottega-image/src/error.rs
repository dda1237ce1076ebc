//! The errors of pictures.

use std::path::{Path, PathBuf};

use crate::printable::printable_path;

/// An image file or a picture that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The operating system refused to read.
    #[error("cannot read `{}`", printable_path(.path))]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The operating system refused to write.
    #[error("cannot write `{}`", printable_path(.path))]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The path cannot become a picture; found before anything is painted.
    #[error("cannot write `{}`: {reason}", printable_path(.path))]
    NotWritable {
        /// The file.
        path: PathBuf,
        /// What stands in the way, and what to do.
        reason: String,
    },
    /// The file is in none of the formats that are read.
    #[error("`{}` is not a picture in a known format: EXR, PNG or Radiance HDR is expected", printable_path(.path))]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file contradicts its format, or ends too early.
    #[error("`{}` is not a sound {format} file: {detail}", printable_path(.path))]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: &'static str,
        /// What is wrong, and where.
        detail: String,
    },
    /// The file is sound as far as it was read, but uses a feature that is not supported.
    #[error("`{}` uses a feature of {format} that is not read: {detail}; save it again with common settings", printable_path(.path))]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: &'static str,
        /// Which feature.
        detail: String,
    },
    /// The header announces more than the caller allows; nothing was allocated.
    #[error("`{}` announces {width} × {height} pixels; at most {max_pixels} are read", printable_path(.path))]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// The limit that the caller set.
        max_pixels: u64,
    },
    /// An EXR file without R, G, B or Y.
    #[error("`{}` holds no color: R, G, B or Y is expected, found {found}", printable_path(.path))]
    NoColor {
        /// The file.
        path: PathBuf,
        /// The channels that it holds.
        found: String,
    },
    /// A picture of no pixels cannot be written.
    #[error("cannot write `{}`: the picture has no pixels", printable_path(.path))]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Only pictures of equal size can be compared.
    #[error("pictures of different sizes: {}×{} and {}×{}", .first.0, .first.1, .second.0, .second.1)]
    SizesDiffer {
        /// Width and height of the first.
        first: (u32, u32),
        /// Width and height of the second.
        second: (u32, u32),
    },
}

impl ImageError {
    pub(crate) fn read(path: &Path, source: std::io::Error) -> Self {
        Self::Read { path: path.to_owned(), source }
    }

    pub(crate) fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Write { path: path.to_owned(), source }
    }

    pub(crate) fn malformed(path: &Path, format: &'static str, detail: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), format, detail: detail.into() }
    }
}
