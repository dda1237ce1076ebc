//! The errors between a request and its picture.

use std::{ops::Range, path::PathBuf, sync::Arc};

#[cfg(feature = "board")]
use bottega_board::BoardError;
use bottega_denoise::{DenoiseError, install_hint};
use bottega_engines::{
    EngineError,
    external::{EngineFault, manifest::ManifestError},
};
use bottega_farm::{JobError, JournalError, simulate::RecordError};
use bottega_fuzzy::Position;
#[cfg(feature = "gpu")]
use bottega_gpu::GpuError;
use bottega_image::{ImageError, printable_path};
use bottega_render::RenderError;
use bottega_scene::SceneError;
use thiserror::Error;

use crate::{
    formats,
    request::{InvalidField, RequestError},
};

/// The errors of the library, each with its causes behind it.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene cannot be read.
    #[error("cannot use the scene")]
    Scene(#[from] SceneError),
    /// A picture cannot be read or written.
    #[error("cannot use the picture")]
    Image(#[from] ImageError),
    /// The scene cannot be prepared.
    #[error("cannot prepare the scene for rendering")]
    Prepare(#[from] RenderError),
    /// The engine failed.
    #[error("the engine failed")]
    Engine(#[from] EngineError),
    /// Another renderer failed.
    #[error("the engine `{engine}` cannot paint")]
    External {
        /// Its name.
        engine: String,
        /// Why.
        source: EngineFault,
    },
    /// The manifest of another renderer is wrong.
    #[error("the manifest `{}` cannot be used, line {}, column {}: {}", printable_path(&.0.path), .0.line, .0.column, .0.problem)]
    Manifest(Box<ManifestError>),
    /// The agents came to no picture.
    #[error("the work failed")]
    Job(#[source] JobError),
    /// A device was asked for that this build of the library leaves out.
    #[error("cannot use {device}: this program was built without such devices")]
    NotBuiltIn {
        /// The device, as it was asked for.
        device: String,
        /// The feature of the library that has it.
        feature: &'static str,
    },
    /// A GPU that was asked for cannot be used.
    #[cfg(feature = "gpu")]
    #[error("cannot use the GPU")]
    Gpu(#[from] GpuError),
    /// A board that was asked for cannot be used.
    #[cfg(feature = "board")]
    #[error("cannot use the board")]
    Board(#[from] BoardError),
    /// The picture cannot be denoised.
    #[error("cannot denoise the picture")]
    Denoise(#[from] DenoiseError),
    /// Rules are wrong as a whole.
    #[error("cannot use the rules in `{}`: {problem}", printable_path(.path))]
    Rules {
        /// Their file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// Rules are wrong at a place.
    #[error("cannot use the rules in `{}`, {place}: {problem}", printable_path(.path))]
    RulesText {
        /// Their file.
        path: PathBuf,
        /// Line and column.
        place: Position,
        /// What is wrong.
        problem: String,
        /// The text.
        text: Arc<str>,
        /// The bytes of the text that are meant.
        span: Range<usize>,
    },
    /// What is kept of an interrupted picture cannot be used.
    #[error("cannot go on with `{}`", printable_path(.path))]
    Journal {
        /// The journal.
        path: PathBuf,
        /// Why.
        source: JournalError,
    },
    /// A record for the simulator is wrong.
    #[error("cannot use the record `{}`", printable_path(.path))]
    Record {
        /// The record.
        path: PathBuf,
        /// Why.
        source: RecordError,
    },
    /// A text is no request.
    #[error("cannot use the request in {origin}")]
    Request {
        /// Where it came from, as people call it.
        origin: String,
        /// Why.
        source: RequestError,
    },
    /// A field of the request is wrong.
    #[error("the request cannot be painted")]
    Invalid(#[from] InvalidField),
    /// A file cannot be written.
    #[error("cannot write `{}`", printable_path(.path))]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file cannot be read.
    #[error("cannot read `{}`", printable_path(.path))]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// What was asked for cannot be.
    #[error("{problem}")]
    Usage {
        /// What is wrong.
        problem: String,
        /// What can be done.
        remedy: String,
    },
    /// It was tried, and failed.
    #[error("{problem}")]
    Failed {
        /// What is wrong.
        problem: String,
        /// What can be done.
        remedy: String,
    },
}

/// The place in a text where something is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Excerpt {
    /// The name of the file.
    pub name: String,
    /// All of its text.
    pub text: String,
    /// The bytes that are meant.
    pub span: Range<usize>,
}

impl Error {
    /// What was asked for cannot be.
    pub fn usage(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Usage { problem: problem.into(), remedy: remedy.into() }
    }

    /// It was tried, and failed.
    pub fn failed(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Failed { problem: problem.into(), remedy: remedy.into() }
    }

    /// Whether what was asked for cannot be; as opposed to: it was tried and failed.
    pub fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::Usage { .. } | Self::NotBuiltIn { .. } | Self::Manifest(_) | Self::Request { .. } | Self::Invalid(_)
        )
    }

    /// What can be done about it.
    pub fn remedy(&self) -> Option<String> {
        match self {
            Self::Usage { remedy, .. } | Self::Failed { remedy, .. } => Some(remedy.clone()),
            Self::NotBuiltIn { feature, .. } => {
                Some(format!("build it with the feature `{feature}` of the crate bottega"))
            }
            Self::Scene(SceneError::UnknownFormat { path, .. }) => formats::remedy(path),
            Self::Denoise(DenoiseError::NotFound { .. } | DenoiseError::Unfit { .. }) => Some(install_hint()),
            Self::Denoise(_) => Some("leave out the denoising; what was painted can be gone on with".to_owned()),
            Self::Request { .. } => Some("`bottega request schema` says what a request may hold".to_owned()),
            _ => None,
        }
    }

    /// The place in a text that it is about.
    pub fn excerpt(&self) -> Option<Excerpt> {
        match self {
            Self::Manifest(error) => {
                Some(Excerpt { name: printable_path(&error.path), text: error.text.clone(), span: error.span.clone() })
            }
            Self::RulesText { path, text, span, .. } => {
                Some(Excerpt { name: printable_path(path), text: text.to_string(), span: span.clone() })
            }
            _ => None,
        }
    }

    /// With all that it is due to, in one line.
    pub fn error_chain(&self) -> String {
        error_chain(self)
    }
}

/// An error with all that it is due to, in one line.
pub fn error_chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |error| error.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}
