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

/// The error type of the library. `source()` gives the cause; [`Error::error_chain`] gives all causes in one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene cannot be read or is invalid.
    #[error("cannot use the scene")]
    Scene(#[from] SceneError),
    /// A picture or image file cannot be read, written or used.
    #[error("cannot use the picture")]
    Image(#[from] ImageError),
    /// The acceleration structures of the scene cannot be built, or the settings are invalid.
    #[error("cannot prepare the scene for rendering")]
    Prepare(#[from] RenderError),
    /// The built-in engine failed while rendering.
    #[error("the engine failed")]
    Engine(#[from] EngineError),
    /// An external engine cannot be started, or failed.
    #[error("the engine `{engine}` cannot paint")]
    External {
        /// The name of the engine, as in its manifest.
        engine: String,
        /// The fault of the engine or its process.
        source: EngineFault,
    },
    /// The manifest of an external engine is invalid; the error holds file, line and column.
    #[error("the manifest `{}` cannot be used, line {}, column {}: {}", printable_path(&.0.path), .0.line, .0.column, .0.problem)]
    Manifest(Box<ManifestError>),
    /// The agents did not complete the picture.
    #[error("the work failed")]
    Job(#[source] JobError),
    /// The request names a kind of device that this build of the library does not support.
    #[error("cannot use {device}: this program was built without such devices")]
    NotBuiltIn {
        /// The name of the device, as in the request.
        device: String,
        /// The Cargo feature of the crate that adds support for it.
        feature: &'static str,
    },
    /// A requested GPU cannot be used.
    #[cfg(feature = "gpu")]
    #[error("cannot use the GPU")]
    Gpu(#[from] GpuError),
    /// A requested board cannot be used.
    #[cfg(feature = "board")]
    #[error("cannot use the board")]
    Board(#[from] BoardError),
    /// The denoiser cannot be loaded, or denoising failed.
    #[error("cannot denoise the picture")]
    Denoise(#[from] DenoiseError),
    /// A rule file is invalid as a whole.
    #[error("cannot use the rules in `{}`: {problem}", printable_path(.path))]
    Rules {
        /// The path of the rule file.
        path: PathBuf,
        /// The problem, in one sentence.
        problem: String,
    },
    /// A rule file is invalid at one position.
    #[error("cannot use the rules in `{}`, {place}: {problem}", printable_path(.path))]
    RulesText {
        /// The path of the rule file.
        path: PathBuf,
        /// The line and column of the problem.
        place: Position,
        /// The problem, in one sentence.
        problem: String,
        /// The whole text of the file.
        text: Arc<str>,
        /// The byte range of `text` that the problem is about.
        span: Range<usize>,
    },
    /// The journal of an interrupted picture cannot be used.
    #[error("cannot resume from `{}`", printable_path(.path))]
    Journal {
        /// The path of the journal.
        path: PathBuf,
        /// The reason why the journal is unusable.
        source: JournalError,
    },
    /// A record of a run, for the simulator, cannot be made or read.
    #[error("cannot use the record `{}`", printable_path(.path))]
    Record {
        /// The path of the record.
        path: PathBuf,
        /// The reason why the record cannot be used.
        source: RecordError,
    },
    /// A text is not a valid request.
    #[error("cannot use the request in {origin}")]
    Request {
        /// The origin of the text for messages, such as a file name.
        origin: String,
        /// The reason why the text is not a request.
        source: RequestError,
    },
    /// A field of the request has a value that is not allowed.
    #[error("the request cannot be painted")]
    Invalid(#[from] InvalidField),
    /// A file cannot be written.
    #[error("cannot write `{}`", printable_path(.path))]
    Write {
        /// The path of the file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// A file cannot be read.
    #[error("cannot read `{}`", printable_path(.path))]
    Read {
        /// The path of the file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The request cannot be fulfilled; see [`Error::usage`].
    #[error("{problem}")]
    Usage {
        /// The problem, in one sentence.
        problem: String,
        /// Advice for the user.
        remedy: String,
    },
    /// An operation failed although the request was valid; see [`Error::failed`].
    #[error("{problem}")]
    Failed {
        /// The problem, in one sentence.
        problem: String,
        /// Advice for the user.
        remedy: String,
    },
}

/// An excerpt: a text and the byte range in it that an error is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Excerpt {
    /// The name of the file, for messages.
    pub name: String,
    /// The whole text of the file.
    pub text: String,
    /// The byte range of `text` that the error is about.
    pub span: Range<usize>,
}

impl Error {
    /// Makes a usage error: the request must be changed to succeed.
    ///
    /// - `problem`: the problem in one sentence, for the user.
    /// - `remedy`: advice for the user.
    pub fn usage(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Usage { problem: problem.into(), remedy: remedy.into() }
    }

    /// Makes an error of an operation that failed although the request was valid; parameters as for [`Self::usage`].
    pub fn failed(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Failed { problem: problem.into(), remedy: remedy.into() }
    }

    /// Returns true if the request itself is wrong (exit code 2 of the command line), false if an operation failed.
    pub fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::Usage { .. } | Self::NotBuiltIn { .. } | Self::Manifest(_) | Self::Request { .. } | Self::Invalid(_)
        )
    }

    /// Returns advice for the user about the error; `None`: nothing specific.
    pub fn remedy(&self) -> Option<String> {
        match self {
            Self::Usage { remedy, .. } | Self::Failed { remedy, .. } => Some(remedy.clone()),
            Self::NotBuiltIn { feature, .. } => {
                Some(format!("build it with the feature `{feature}` of the crate bottega"))
            }
            Self::Scene(SceneError::UnknownFormat { path, .. }) => formats::remedy(path),
            Self::Denoise(DenoiseError::NotFound { .. } | DenoiseError::Unfit { .. }) => Some(install_hint()),
            Self::Denoise(_) => Some("leave out the denoising; `--resume` continues the picture".to_owned()),
            Self::Request { .. } => Some("`bottega request schema` says what a request may hold".to_owned()),
            _ => None,
        }
    }

    /// Returns the text and the byte range in it that the error is about; `None`: the error is not about a text.
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

    /// Returns the error and all its causes in one line: `error: cause: cause`.
    pub fn error_chain(&self) -> String {
        error_chain(self)
    }
}

/// Returns an error and all its causes in one line: `error: cause: cause`.
pub fn error_chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |error| error.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}
