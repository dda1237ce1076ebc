//! An engine with a scene: one worker process, or a command line for each window.

mod command;
mod worker;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use bottega_image::Rect;

pub use super::protocol::{CameraView, CombineWord, Files, Opened, OpenedLayer};
use super::{error::EngineFault, locate::Located, manifest::Kind, quarantine};
use crate::CancelSwitch;
use command::CommandLine;
use worker::Worker;

/// A scene as an engine is to paint it.
#[derive(Clone, Debug)]
pub struct SceneRequest {
    /// The file.
    pub scene: PathBuf,
    /// Size of the picture; `None`: as the scene says.
    pub size: Option<(u32, u32)>,
    /// Which frame of an animation.
    pub frame: Option<i32>,
    /// Threads of the engine.
    pub threads: usize,
    /// The camera of a scene that has none.
    pub view: Option<CameraView>,
    /// Whether scripts in the scene may run.
    pub trust: bool,
    /// More for the engine: what its manifest says, and the user beside it.
    pub parameters: BTreeMap<String, serde_json::Value>,
    /// Files and folders that the engine may read beside the folder of the scene; `/`: all that this process may read.
    pub outside: Vec<PathBuf>,
}

impl SceneRequest {
    /// What the engine may read of the disk beside what is its own.
    pub(super) fn reads(&self) -> Vec<PathBuf> {
        reads(&self.scene, &self.outside)
    }
}

/// What an engine may read for a scene.
fn reads(scene: &Path, outside: &[PathBuf]) -> Vec<PathBuf> {
    let folder = scene.parent().map(Path::to_owned);
    outside.iter().cloned().chain(folder).chain([scene.to_owned()]).collect()
}

/// A window to paint. What is `None` is as the scene says, or the engine has it not.
#[derive(Clone, Debug)]
pub(super) struct WindowRequest {
    pub(super) window: Rect,
    pub(super) samples: u32,
    pub(super) first_sample: u32,
    pub(super) seed: u32,
    pub(super) max_depth: Option<u32>,
    pub(super) light_samples: Option<u32>,
    /// For how long it may paint: what is done by then is the picture.
    pub(super) seconds: Option<u32>,
    pub(super) cancel: CancelSwitch,
}

/// A picture that an engine wrote.
#[derive(Debug)]
pub(super) struct Written {
    pub(super) file: PathBuf,
    /// Which part of the frame it shows.
    pub(super) shows: Rect,
    /// Whether its rows come from below.
    pub(super) is_upside_down: bool,
    /// Samples of a pixel, where the engine tells.
    pub(super) samples: Option<u32>,
    /// Seconds that went into what later windows find done.
    pub(super) once: f64,
}

/// An engine with a scene.
#[derive(Debug)]
pub struct Session {
    driver: Driver,
    opened: Opened,
}

#[derive(Debug)]
enum Driver {
    Worker(Box<Worker>),
    Command(Box<CommandLine>),
}

impl Session {
    /// Starts an engine and opens a scene.
    ///
    /// # Errors
    /// The engine does not start, or refuses the scene.
    pub fn open(engine: &Arc<Located>, request: &SceneRequest) -> Result<Self, EngineFault> {
        quarantine::check(engine)?;
        match engine.manifest().kind {
            Kind::Worker => {
                let mut worker = Worker::start(engine, request.reads())?;
                let opened = worker.open(request)?;
                Ok(Self { driver: Driver::Worker(Box::new(worker)), opened })
            }
            Kind::Command => {
                let (line, opened) = CommandLine::open(engine, request)?;
                Ok(Self { driver: Driver::Command(Box::new(line)), opened })
            }
        }
    }

    /// Opens it again, as another request says: at another size, say.
    ///
    /// # Errors
    /// The engine refuses it.
    pub fn reopen(&mut self, engine: &Arc<Located>, request: &SceneRequest) -> Result<(), EngineFault> {
        match &mut self.driver {
            // It sees no other files than those of the scene for which it was started.
            Driver::Worker(worker) if worker.reads() == request.reads() => self.opened = worker.open(request)?,
            Driver::Worker(_) | Driver::Command(_) => *self = Self::open(engine, request)?,
        }
        Ok(())
    }

    /// What it says of the scene.
    pub fn opened(&self) -> &Opened {
        &self.opened
    }

    /// Paints a window.
    ///
    /// - `told`: is told the share that is painted, as often as the engine says.
    pub(super) fn paint(&mut self, request: &WindowRequest, told: &mut dyn FnMut(f64)) -> Result<Written, EngineFault> {
        match &mut self.driver {
            Driver::Worker(worker) => worker.paint(request, told),
            Driver::Command(line) => line.paint(request, told),
        }
    }
}

/// Asks which files a scene refers to.
///
/// # Errors
/// The engine does not start, or cannot tell.
///
/// - `outside`: see [`SceneRequest`].
pub(super) fn ask_files(engine: &Arc<Located>, scene: &Path, outside: &[PathBuf]) -> Result<Files, EngineFault> {
    Worker::start(engine, reads(scene, outside))?.files(scene)
}

/// A worker that was started to see whether it answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// How long that took.
    pub seconds: f64,
}

impl Probe {
    /// Starts a worker and ends it again.
    ///
    /// # Errors
    /// It does not start, or does not keep to the protocol.
    pub fn start(engine: &Arc<Located>) -> Result<Self, EngineFault> {
        let begun = std::time::Instant::now();
        Worker::start(engine, Vec::new())?;
        Ok(Self { seconds: begun.elapsed().as_secs_f64() })
    }
}
