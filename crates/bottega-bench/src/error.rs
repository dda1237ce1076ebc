//! Errors of measurements.

use std::{io, path::PathBuf};

use bottega_engines::EngineError;
use bottega_farm::simulate::{RecordError, SimulationError, WorkpieceError};
use bottega_gpu::GpuError;
use bottega_hra::{SubmitError, UnitError};
use bottega_image::ImageError;
use bottega_kernels::BuildError;
use bottega_render::RenderError;
use bottega_scene::SceneError;

/// An error of a measurement, or of a library that it uses.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// A scene, a picture, an engine or a device cannot be used.
    #[error(transparent)]
    Bottega(#[from] bottega::Error),
    /// The farm cannot be reached.
    #[error(transparent)]
    Cluster(#[from] bottega_cluster::Error),
    /// No tree can be built over a built-in scene.
    #[error("cannot build a hierarchy over a built-in scene")]
    Build(#[from] BuildError),
    /// A file is not a neutral scene description.
    #[error("`{}` describes no scene: {problem}", .path.display())]
    NeutralScene {
        /// The scene file.
        path: PathBuf,
        /// The error in the description.
        problem: String,
    },
    /// A folder contains no scene with a reference.
    #[error("there is no scene in `{}`", .folder.display())]
    NoScenes {
        /// The folder that holds no scenes.
        folder: PathBuf,
    },
    /// Processor time was requested, but the system does not report it.
    #[error("this system does not tell processor times")]
    NoProcessorTime,
    /// A record cannot be replayed.
    #[error("the recorded zones cannot be replayed")]
    Workpiece(#[from] WorkpieceError),
    /// A picture left nothing to replay.
    #[error("nothing was recorded that can be replayed")]
    Record(#[source] RecordError),
    /// A replay did not finish.
    #[error("the simulation failed")]
    Simulation(#[from] SimulationError),
    /// The allocator refused the work.
    #[error("the allocator takes no work")]
    Submit(#[from] SubmitError),
    /// A resource of the allocator failed.
    #[error("a resource of the allocator failed")]
    Unit(#[from] UnitError),
    /// The allocator returned an answer to another question.
    #[error("the answer of the allocator does not fit the request")]
    WrongAnswer,
    /// Two methods that trace the same paths found different light.
    #[error("{way} found other light: {found} instead of {known}")]
    OtherLight {
        /// The way, as tables name it.
        way: &'static str,
        /// The mean radiance per pixel.
        found: f64,
        /// The mean radiance found by the previous method.
        known: f64,
    },
    /// A thread of a measurement panicked.
    #[error("{thread} ended in a panic")]
    Panic {
        /// The name of the thread.
        thread: &'static str,
    },
    /// The system cannot start a thread.
    #[error("cannot start a thread")]
    Thread(#[source] io::Error),
    /// The system cannot start a process.
    #[error("cannot start a process")]
    Process(#[source] io::Error),
    /// A process with agents ended too early.
    #[error("a process with agents ended before the work")]
    PartEnded,
    /// The process with the Master ended too early.
    #[error("the process with the Master has ended")]
    MasterGone,
    /// The user stopped the measurement.
    #[error("stopped before the picture was there")]
    Stopped,
    /// The agents did not paint every pixel exactly once.
    #[error("{zones} zones are not painted, {pixels} pixels not once")]
    Unpainted {
        /// Number of unpainted zones.
        zones: usize,
        /// Number of pixels that were not painted exactly once.
        pixels: usize,
    },
    /// An image has too few zones, or was rendered in pieces, so nothing can be compared.
    #[error("a picture of {count} zones tells nothing of how well their times were known")]
    TooFewZones {
        /// Number of zones.
        count: usize,
    },
    /// Embree failed to build a tree.
    #[error("{0}")]
    Embree(String),
    /// Neither a scene nor a folder of scenes is named.
    #[error("no scene is named")]
    NoScene,
    /// The number of scenes is odd, but pairs are needed.
    #[error("the last scene has no second one")]
    NoPair,
    /// A process with agents got no server address.
    #[error("no farm is named")]
    NoFarm,
    /// The measured program does not exist.
    #[error("there is no program `{}`", .path.display())]
    NoProgram {
        /// The first path that was tried.
        path: PathBuf,
    },
    /// The measured program cannot be started.
    #[error("cannot start `{}`", .path.display())]
    StartRender {
        /// The program that could not be started.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The handler for Ctrl-C cannot be installed.
    #[error("cannot watch for Ctrl-C")]
    Signal(#[from] ctrlc::Error),
    /// Standard output cannot be written.
    #[error("cannot write to standard output")]
    Output(#[source] io::Error),
    /// `bottega render` failed.
    #[error("bottega render fails: {said}")]
    Render {
        /// The program's output on standard error.
        said: String,
    },
}

impl Error {
    /// Returns the exit code: 2 for a usage error, 130 if the user stopped, 1 for a failure.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Stopped => 130,
            error if error.is_usage() => 2,
            _ => 1,
        }
    }

    /// Returns true for usage errors: the request is invalid, as opposed to an attempt that failed.
    fn is_usage(&self) -> bool {
        match self {
            Self::Bottega(error) => error.is_usage(),
            Self::Cluster(error) => error.is_usage(),
            Self::NoScenes { .. }
            | Self::NoProcessorTime
            | Self::NoScene
            | Self::NoPair
            | Self::NoFarm
            | Self::NoProgram { .. } => true,
            _ => false,
        }
    }

    /// Returns the remedy, if one is known.
    pub(crate) fn remedy(&self) -> Option<String> {
        let remedy = match self {
            Self::Bottega(error) => return error.remedy(),
            Self::Cluster(error) => return error.remedy(),
            Self::Simulation(_) | Self::MasterGone | Self::Stopped | Self::Output(_) => return None,
            Self::NeutralScene { .. } => {
                "it must have `camera`, `width`, `height`, `max_bounces`, `materials` and `meshes`"
            }
            Self::NoScenes { .. } => {
                "it must hold SCENE.json, SCENE.xml, SCENE.scn, their meshes, and reference/ref_SCENE.exr"
            }
            Self::NoProcessorTime => "leave out --processor-time, and let the machine do nothing else meanwhile",
            Self::TooFewZones { .. } => "paint larger pictures of more samples",
            Self::Build(_) | Self::Record(_) | Self::Workpiece(_) | Self::Signal(_) => "this is unexpected; report it",
            Self::Embree(_) => "name another library by BOTTEGA_EMBREE, or none",
            Self::NoScene => "name one, or the folder of scenes by --scenes or BOTTEGA_SCENES",
            Self::NoPair => "name two scenes for each pair",
            Self::NoFarm => "run `bottega-bench farm`, which starts this process",
            Self::NoProgram { .. } | Self::StartRender { .. } => {
                "build it (cargo build --release), or name it: --program"
            }
            Self::Submit(_) | Self::Unit(_) => "see `bottega devices`",
            Self::WrongAnswer | Self::Panic { .. } => "report it",
            Self::OtherLight { .. } => "report it, with the name of the device",
            Self::Thread(_) => "have fewer agents: --agents; or let fewer programs run at once",
            Self::Process(_) => "have fewer processes: --processes",
            Self::PartEnded => "see what it said above",
            Self::Unpainted { .. } => "ask for fewer agents or zones, or report it",
            Self::Render { .. } => "see what it says",
        };
        Some(remedy.to_owned())
    }
}

/// Implements conversions for errors that the library's error type covers.
macro_rules! through_library {
    ($($source:ty),*) => {
        $(impl From<$source> for Error {
            fn from(source: $source) -> Self {
                bottega::Error::from(source).into()
            }
        })*
    };
}

through_library!(SceneError, ImageError, RenderError, EngineError, GpuError);
