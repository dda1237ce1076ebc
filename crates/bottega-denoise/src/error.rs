//! Why a picture is not denoised.

use std::path::PathBuf;

use bottega_image::LayersError;

/// Why a picture is not denoised.
#[derive(Debug, thiserror::Error)]
pub enum DenoiseError {
    /// There is no library.
    #[error("Open Image Denoise is not installed here ({tried})")]
    NotFound {
        /// What was tried.
        tried: String,
    },
    /// What was found is not the library.
    #[error("`{}` is no Open Image Denoise of version 1.4 or newer: {problem}", .path.display())]
    Unfit {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The library says why.
    #[error("Open Image Denoise says: {0}")]
    Failed(String),
    /// Whoever asked does not want it any more.
    #[error("nobody wants it any more")]
    Cancelled,
    /// The picture has no room for the color as it was.
    #[error("the noisy color cannot be kept")]
    Layers(#[from] LayersError),
}
