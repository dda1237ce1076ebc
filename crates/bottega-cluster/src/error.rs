//! The errors of a farm.

use std::path::PathBuf;

use bottega_agents::driver::{
    nats::{BlobError, NatsError},
    node::NodeError,
};
use bottega_farm::JobError;
use thiserror::Error as ThisError;

/// The error of an operation on a farm, or of the library below it.
#[derive(Debug, ThisError)]
#[non_exhaustive]
pub enum Error {
    /// An error of the library or of this crate: an invalid request, an unusable file, or an operation that failed.
    #[error(transparent)]
    Bottega(#[from] bottega::Error),
    /// The connection to the farm cannot be made or used.
    #[error("no farm")]
    Farm {
        /// The error of the NATS connection.
        source: NatsError,
        /// The advice to the user.
        remedy: String,
    },
    /// The farm could not store or return a blob.
    #[error("the farm does not store the data")]
    Blob(#[source] BlobError),
    /// The FIPA platform cannot be served.
    #[error("no platform")]
    Platform(#[source] NodeError),
}

impl Error {
    /// Returns a usage error: the request is invalid. Both texts are for the user: the problem, and the advice to solve it.
    pub fn usage(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        bottega::Error::usage(problem, remedy).into()
    }

    /// Returns a failure: an operation was tried and failed. Both texts are for the user: the problem, and the advice to solve
    /// it.
    pub fn failed(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        bottega::Error::failed(problem, remedy).into()
    }

    /// Returns the error for a file that cannot be written.
    pub fn write(path: PathBuf, source: std::io::Error) -> Self {
        bottega::Error::Write { path, source }.into()
    }

    /// Returns the error for a file that cannot be read.
    pub fn read(path: PathBuf, source: std::io::Error) -> Self {
        bottega::Error::Read { path, source }.into()
    }

    /// Returns the error of a job whose agents produced no picture.
    pub fn job(error: JobError) -> Self {
        bottega::Error::Job(error).into()
    }

    /// Returns true if the request is invalid; false if an operation was tried and failed.
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::Bottega(error) if error.is_usage())
    }

    /// Returns true if a retry may succeed: the server did not answer or had no room for a blob.
    pub fn may_pass(&self) -> bool {
        matches!(self, Self::Blob(error) if !error.is_lasting)
    }

    /// Returns advice for the user about the error; `None`: nothing specific.
    pub fn remedy(&self) -> Option<String> {
        match self {
            Self::Bottega(error) => error.remedy(),
            Self::Farm { remedy, .. } => Some(remedy.clone()),
            Self::Blob(_) => None,
            Self::Platform(_) => None,
        }
    }

    /// Returns the error and all its causes in one line: `error: cause: cause`.
    pub fn error_chain(&self) -> String {
        bottega::error::error_chain(self)
    }

    /// Returns the error and all its causes in one line, followed by the advice for the user, if any.
    pub fn error_chain_with_remedy(&self) -> String {
        let remedy = self.remedy().map(|remedy| format!("; {remedy}")).unwrap_or_default();
        format!("{}{remedy}", self.error_chain())
    }
}

impl From<bottega_image::ImageError> for Error {
    fn from(error: bottega_image::ImageError) -> Self {
        bottega::Error::from(error).into()
    }
}
