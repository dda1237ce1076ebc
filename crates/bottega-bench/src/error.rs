//! The errors of measurements.

use std::{io, path::PathBuf};

use bottega_engines::EngineError;
use bottega_farm::simulate::{SimulationError, WorkpieceError};
use bottega_gpu::GpuError;
use bottega_hra::{SubmitError, UnitError};
use bottega_image::ImageError;
use bottega_kernels::BuildError;
use bottega_render::RenderError;
use bottega_scene::SceneError;

/// The errors of measurements, and those of the libraries that they measure.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// A scene, a picture, an engine or a device cannot be used.
    #[error(transparent)]
    Bottega(#[from] bottega::Error),
    /// There is no way into the farm.
    #[error(transparent)]
    Cluster(#[from] bottega_cluster::Error),
    /// No hierarchy can be built over a built-in scene.
    #[error("cannot build a hierarchy over a built-in scene")]
    Build(#[from] BuildError),
    /// A file is no neutral description of a scene.
    #[error("`{}` describes no scene: {problem}", .path.display())]
    NeutralScene {
        /// The file.
        path: PathBuf,
        /// What it lacks.
        problem: String,
    },
    /// A folder has no scene with a reference.
    #[error("there is no scene in `{}`", .folder.display())]
    NoScenes {
        /// The folder.
        folder: PathBuf,
    },
    /// The time of the processors was asked for, and the system does not tell it.
    #[error("this system does not tell processor times")]
    NoProcessorTime,
    /// What was recorded cannot be replayed.
    #[error("the recorded zones cannot be replayed")]
    Workpiece(#[from] WorkpieceError),
    /// A replay came to nothing.
    #[error("the simulation came to nothing")]
    Simulation(#[from] SimulationError),
    /// The allocator takes no work.
    #[error("the allocator takes no work")]
    Submit(#[from] SubmitError),
    /// A resource of the allocator failed.
    #[error("a resource of the allocator failed")]
    Unit(#[from] UnitError),
    /// The allocator answered something else than was asked.
    #[error("the allocator answered something else than was asked")]
    WrongAnswer,
    /// Two ways to follow the same paths found different light.
    #[error("{way} found other light: {found} instead of {known}")]
    OtherLight {
        /// The way, as tables name it.
        way: &'static str,
        /// Mean light of a pixel.
        found: f64,
        /// What the way before it found.
        known: f64,
    },
    /// A thread of a measurement panicked.
    #[error("{thread} ended in a panic")]
    Panic {
        /// Which.
        thread: &'static str,
    },
    /// The system gives no thread.
    #[error("cannot start a thread")]
    Thread(#[source] io::Error),
    /// The system gives no process.
    #[error("cannot start a process")]
    Process(#[source] io::Error),
    /// A process with agents ended before the work.
    #[error("a process with agents ended before the work")]
    PartEnded,
    /// The process with the Master ended before the work.
    #[error("the process with the Master has ended")]
    MasterGone,
    /// The user stopped the work.
    #[error("stopped before the picture was there")]
    Stopped,
    /// The agents did not paint every pixel once.
    #[error("{zones} zones are not painted, {pixels} pixels not once")]
    Unpainted {
        /// Zones that are not painted.
        zones: usize,
        /// Pixels that are not painted once.
        pixels: usize,
    },
    /// A picture was cut into too few zones, or painted in pieces, to compare anything.
    #[error("a picture of {count} zones tells nothing of how well their times were known")]
    TooFewZones {
        /// All zones.
        count: usize,
    },
    /// Embree does not build a tree.
    #[error("{0}")]
    Embree(String),
    /// No scene is named, nor a folder with one.
    #[error("no scene is named")]
    NoScene,
    /// Pairs of scenes are needed.
    #[error("the last scene has no second one")]
    NoPair,
    /// No server is named to a process with agents.
    #[error("no farm is named")]
    NoFarm,
    /// The program whose pictures are measured is not there.
    #[error("there is no program `{}`", .path.display())]
    NoProgram {
        /// Where it was looked for first.
        path: PathBuf,
    },
    /// The program whose pictures are measured does not start.
    #[error("cannot start `{}`", .path.display())]
    StartRender {
        /// The program.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// Ctrl-C cannot be watched for.
    #[error("cannot watch for Ctrl-C")]
    Signal(#[from] ctrlc::Error),
    /// Nobody can read the figures.
    #[error("cannot write to standard output")]
    Output(#[source] io::Error),
    /// `bottega render` failed.
    #[error("bottega render fails: {said}")]
    Render {
        /// What it wrote to standard error.
        said: String,
    },
}

impl Error {
    /// The exit code of the program: 2 is for a usage error, 130 for what the user stopped, 1 for what failed.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Stopped => 130,
            error if error.is_usage() => 2,
            _ => 1,
        }
    }

    /// Whether what was asked for cannot be; as opposed to: it was tried and failed.
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

    /// What can be done about it.
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
            Self::Build(_) | Self::Workpiece(_) | Self::Signal(_) => "this is unexpected; report it",
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

/// Errors of crates that the library has a word for.
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
