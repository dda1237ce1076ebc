//! The errors of a farm.

use std::path::PathBuf;

use bottega_agents::driver::{
    nats::{BlobError, NatsError},
    node::NodeError,
};
use bottega_farm::JobError;
use thiserror::Error as ThisError;

/// The errors of a farm, and those of the library behind it.
#[derive(Debug, ThisError)]
#[non_exhaustive]
pub enum Error {
    /// The picture could not be painted, or a file not be used.
    #[error(transparent)]
    Bottega(#[from] bottega::Error),
    /// There is no way into the farm.
    #[error("no farm")]
    Farm {
        /// Why.
        source: NatsError,
        /// What can be done.
        remedy: String,
    },
    /// The farm does not keep what it was given.
    #[error("the farm does not keep what it was given")]
    Blob(#[source] BlobError),
    /// Its platform cannot be served.
    #[error("no platform")]
    Platform(#[source] NodeError),
}

impl Error {
    /// What was asked for cannot be.
    pub fn usage(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        bottega::Error::usage(problem, remedy).into()
    }

    /// It was tried, and failed.
    pub fn failed(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        bottega::Error::failed(problem, remedy).into()
    }

    /// A file cannot be written.
    pub fn write(path: PathBuf, source: std::io::Error) -> Self {
        bottega::Error::Write { path, source }.into()
    }

    /// A file cannot be read.
    pub fn read(path: PathBuf, source: std::io::Error) -> Self {
        bottega::Error::Read { path, source }.into()
    }

    /// The agents came to no picture.
    pub fn job(error: JobError) -> Self {
        bottega::Error::Job(error).into()
    }

    /// Whether what was asked for cannot be; as opposed to: it was tried and failed.
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::Bottega(error) if error.is_usage())
    }

    /// Whether it may succeed when it is tried again: a farm's server that is away comes back.
    pub fn may_pass(&self) -> bool {
        matches!(self, Self::Blob(error) if !error.is_lasting)
    }

    /// What can be done about it.
    pub fn remedy(&self) -> Option<String> {
        match self {
            Self::Bottega(error) => error.remedy(),
            Self::Farm { remedy, .. } => Some(remedy.clone()),
            Self::Blob(_) => None,
            Self::Platform(_) => None,
        }
    }

    /// With all that it is due to, in one line.
    pub fn error_chain(&self) -> String {
        bottega::error::error_chain(self)
    }

    /// The same with what can be done about it.
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
