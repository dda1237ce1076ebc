//! What can go wrong in the command line, told with a remedy.

use std::{path::PathBuf, sync::Arc};

use bottega_agents::{
    driver::{
        nats::{BlobError, NatsError},
        node::NodeError,
    },
    file_store::FileStoreError,
};
use bottega_denoise::DenoiseError;
use bottega_engines::{
    EngineError,
    external::{EngineFault, manifest::ManifestError},
};
use bottega_farm::{
    JobError, JournalError,
    simulate::{RecordError, SimulationError},
};
use bottega_fuzzy::Position;
use bottega_gpu::GpuError;
use bottega_image::ImageError;
use bottega_render::RenderError;
use bottega_scene::SceneError;
use bottega_web::ServeError;
use miette::{Diagnostic, NamedSource, SourceSpan};
use thiserror::Error;

/// The crates' errors, and those of the command line itself.
#[derive(Debug, Error, Diagnostic)]
pub(crate) enum CliError {
    #[error("cannot use the scene")]
    Scene(#[source] SceneError),
    #[error("cannot use the picture")]
    Image(#[source] ImageError),
    #[error("cannot prepare the scene for rendering")]
    Prepare(#[source] RenderError),
    #[error("the engine failed")]
    Engine(#[source] EngineError),
    #[error("the engine `{engine}` cannot paint")]
    External { engine: String, source: EngineFault },
    #[error("the manifest `{}` cannot be used, line {}, column {}: {}", .error.path.display(), .error.line, .error.column, .error.problem)]
    Manifest {
        error: Box<ManifestError>,
        #[source_code]
        text: NamedSource<String>,
        #[label("here")]
        span: SourceSpan,
    },
    #[error("the work failed")]
    Job(#[source] JobError),
    #[error("cannot use the GPU")]
    Gpu(#[source] GpuError),
    #[error("cannot denoise the picture")]
    Denoise {
        source: DenoiseError,
        #[help]
        remedy: String,
    },
    #[error("cannot serve the live view")]
    Serve(#[source] ServeError),
    #[error("cannot use the rules in `{}`: {problem}", .path.display())]
    Rules { path: PathBuf, problem: String },
    #[error("cannot use the rules in `{}`, {place}: {problem}", .path.display())]
    RulesText {
        path: PathBuf,
        place: Position,
        problem: String,
        #[source_code]
        text: Arc<NamedSource<String>>,
        #[label("here")]
        span: SourceSpan,
    },
    #[error("cannot go on with `{}`", .path.display())]
    Journal { path: PathBuf, source: JournalError },
    #[error("cannot use the record `{}`", .path.display())]
    Record { path: PathBuf, source: RecordError },
    #[error("the simulation came to nothing")]
    Simulation(#[source] SimulationError),
    #[error("the platform does not run")]
    Node(#[source] NodeError),
    #[error("cannot keep the platform in `{}`", .path.display())]
    State { path: PathBuf, source: FileStoreError },
    #[error("no farm")]
    Farm {
        source: NatsError,
        #[help]
        remedy: String,
    },
    #[error("the farm does not keep what it was given")]
    Blob(#[source] BlobError),
    #[error("cannot write `{}`", .path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error("cannot read `{}`", .path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{problem}")]
    Usage {
        problem: String,
        #[help]
        remedy: String,
    },
    #[error("{problem}")]
    Failed {
        problem: String,
        #[help]
        remedy: String,
    },
}

impl CliError {
    /// What was asked for cannot be; as opposed to: it was tried and failed.
    pub(crate) fn is_usage(&self) -> bool {
        matches!(self, Self::Usage { .. } | Self::Manifest { .. })
    }

    /// Whether it may succeed when it is tried again: a farm's server that is away comes back.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(self, Self::Blob(error) if !error.is_lasting)
    }

    /// With all that it is due to, in one line.
    pub(crate) fn told(&self) -> String {
        let mut text = self.to_string();
        let mut source = std::error::Error::source(self);
        while let Some(error) = source {
            text += &format!(": {error}");
            source = error.source();
        }
        text
    }

    /// The same with what can be done about it.
    pub(crate) fn told_with_remedy(&self) -> String {
        let remedy = self.help().map(|help| format!("; {help}")).unwrap_or_default();
        format!("{}{remedy}", self.told())
    }

    pub(crate) fn manifest(error: ManifestError) -> Self {
        let text = NamedSource::new(error.path.display().to_string(), error.text.clone());
        let span = error.span.clone().into();
        Self::Manifest { error: Box::new(error), text, span }
    }

    pub(crate) fn usage(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Usage { problem: problem.into(), remedy: remedy.into() }
    }

    pub(crate) fn failed(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Failed { problem: problem.into(), remedy: remedy.into() }
    }
}

impl From<SceneError> for CliError {
    fn from(source: SceneError) -> Self {
        Self::Scene(source)
    }
}

impl From<ImageError> for CliError {
    fn from(source: ImageError) -> Self {
        Self::Image(source)
    }
}

impl From<RenderError> for CliError {
    fn from(source: RenderError) -> Self {
        Self::Prepare(source)
    }
}

impl From<EngineError> for CliError {
    fn from(source: EngineError) -> Self {
        Self::Engine(source)
    }
}

impl From<GpuError> for CliError {
    fn from(source: GpuError) -> Self {
        Self::Gpu(source)
    }
}

impl From<ServeError> for CliError {
    fn from(source: ServeError) -> Self {
        Self::Serve(source)
    }
}
