//! The errors of denoising.

use std::path::PathBuf;

use bottega_image::LayersError;

/// The reason why a picture is not denoised.
#[derive(Debug, thiserror::Error)]
pub enum DenoiseError {
    /// The library was not found.
    #[error("Open Image Denoise is not installed here ({tried})")]
    NotFound {
        /// The places that were searched, as text.
        tried: String,
    },
    /// A file was found that is not the library, or is too old.
    #[error("`{}` is not Open Image Denoise 1.4 or newer: {problem}", .path.display())]
    Unfit {
        /// The path of the file.
        path: PathBuf,
        /// The problem, in one clause.
        problem: String,
    },
    /// The library reports an error; the text is its message.
    #[error("Open Image Denoise says: {0}")]
    Failed(String),
    /// The caller cancelled denoising.
    #[error("it is not needed any more")]
    Cancelled,
    /// The film cannot take the layer [`NOISY`](crate::NOISY).
    #[error("cannot store the noisy color")]
    Layers(#[from] LayersError),
}
