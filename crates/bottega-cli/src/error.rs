//! The errors of the program, with remedies.

use std::path::PathBuf;

use bottega::error::Excerpt;
use bottega_agents::{driver::node::NodeError, file_store::FileStoreError};
use bottega_engines::EngineError;
use bottega_farm::simulate::SimulationError;
use bottega_gpu::GpuError;
use bottega_image::{ImageError, printable, printable_lines};
use bottega_render::RenderError;
use bottega_scene::SceneError;
use bottega_web::ServeError;
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use thiserror::Error;

/// The libraries' errors, and those of the program itself.
#[derive(Debug, Error)]
pub(crate) enum CliError {
    #[error(transparent)]
    Bottega(#[from] bottega::Error),
    #[error(transparent)]
    Cluster(#[from] bottega_cluster::Error),
    #[error("cannot serve the live view")]
    Serve(#[from] ServeError),
    #[error("the simulation failed")]
    Simulation(#[source] SimulationError),
    #[error("the platform does not run")]
    Node(#[source] NodeError),
    #[error("cannot store the platform in `{}`", .path.display())]
    State { path: PathBuf, source: FileStoreError },
}

impl CliError {
    pub(crate) fn usage(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        bottega::Error::usage(problem, remedy).into()
    }

    pub(crate) fn failed(problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        bottega::Error::failed(problem, remedy).into()
    }

    pub(crate) fn write(path: PathBuf, source: std::io::Error) -> Self {
        bottega::Error::Write { path, source }.into()
    }

    pub(crate) fn read(path: PathBuf, source: std::io::Error) -> Self {
        bottega::Error::Read { path, source }.into()
    }

    /// Returns true for usage errors: the request is invalid, as opposed to an attempt that failed.
    pub(crate) fn is_usage(&self) -> bool {
        match self {
            Self::Bottega(error) => error.is_usage(),
            Self::Cluster(error) => error.is_usage(),
            _ => false,
        }
    }

    /// Returns the remedy, if one is known.
    fn remedy(&self) -> Option<String> {
        match self {
            Self::Bottega(error) => error.remedy(),
            Self::Cluster(error) | Self::Serve(ServeError::Listen(error)) => error.remedy(),
            _ => None,
        }
    }
}

/// An error for display: with its causes, its remedy, and the position in a text if there is one.
#[derive(Debug, Error)]
#[error("{problem}")]
struct ShownError {
    problem: String,
    #[source]
    causes: Option<Cause>,
    remedy: Option<String>,
    text: Option<NamedSource<String>>,
    label: Option<LabeledSpan>,
}

/// A cause of an error, and its own causes.
#[derive(Debug, Error)]
#[error("{problem}")]
struct Cause {
    problem: String,
    #[source]
    behind: Option<Box<Cause>>,
}

impl Cause {
    fn of(error: Option<&(dyn std::error::Error + 'static)>) -> Option<Self> {
        let error = error?;
        Some(Self {
            problem: printable_lines(&error.to_string()).into_owned(),
            behind: Self::of(error.source()).map(Box::new),
        })
    }
}

impl Diagnostic for ShownError {
    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        self.remedy.as_ref().map(|remedy| Box::new(remedy) as _)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.text.as_ref().map(|text| text as _)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.label.clone().map(|label| Box::new(std::iter::once(label)) as _)
    }
}

fn shown(error: &dyn std::error::Error, remedy: Option<String>, excerpt: Option<Excerpt>) -> String {
    let (text, label) = match excerpt {
        Some(Excerpt { name, text, span }) => {
            let label = LabeledSpan::new_with_span(Some("here".to_owned()), span);
            (Some(NamedSource::new(printable(&name), without_actions(&text))), Some(label))
        }
        None => (None, None),
    };
    let problem = printable_lines(&error.to_string()).into_owned();
    let remedy = remedy.map(|remedy| printable_lines(&remedy).into_owned());
    let shown = ShownError { problem, causes: Cause::of(error.source()), remedy, text, label };
    format!("{:?}", miette::Report::new(shown))
}

/// Replaces characters that control a terminal by others with as many bytes.
fn without_actions(text: &str) -> String {
    let replace = |c: char| {
        if printable_lines(c.encode_utf8(&mut [0; 4])).len() == c.len_utf8() {
            return c.to_string();
        }
        if c.len_utf8() == 3 { '\u{fffd}'.to_string() } else { "?".repeat(c.len_utf8()) }
    };
    text.chars().map(replace).collect()
}

/// Formats an error of the program for display.
pub(crate) fn report(error: &CliError) -> String {
    let excerpt = match error {
        CliError::Bottega(error) | CliError::Cluster(bottega_cluster::Error::Bottega(error)) => error.excerpt(),
        _ => None,
    };
    shown(error, error.remedy(), excerpt)
}

/// Formats an error of a farm for display.
pub(crate) fn report_of(error: &bottega_cluster::Error) -> String {
    let excerpt = match error {
        bottega_cluster::Error::Bottega(error) => error.excerpt(),
        _ => None,
    };
    shown(error, error.remedy(), excerpt)
}

/// Implements conversions for errors that the library's error type covers.
macro_rules! through_library {
    ($($source:ty),*) => {
        $(impl From<$source> for CliError {
            fn from(source: $source) -> Self {
                bottega::Error::from(source).into()
            }
        })*
    };
}

through_library!(SceneError, ImageError, RenderError, EngineError, GpuError);
