//! A session of an external engine with a scene: a worker process, or a command line for each window.

mod command;
mod request;
mod worker;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

pub use super::protocol::{CameraView, CombineWord, Files, Opened, OpenedLayer};
use super::{error::EngineFault, locate::LocatedEngine, manifest::EngineKind, quarantine};
use command::CommandLine;
pub use request::SceneRequest;
use request::reads;
pub(super) use request::{WindowRequest, Written};
use worker::WorkerSession;

/// An external engine with an open scene.
#[derive(Debug)]
pub struct Session {
    driver: Driver,
    opened: Opened,
}

#[derive(Debug)]
enum Driver {
    Worker(Box<WorkerSession>),
    Command(Box<CommandLine>),
}

impl Session {
    /// Starts an engine and opens a scene.
    ///
    /// # Errors
    /// The engine is quarantined, does not start, refuses the scene, exceeds a limit of its manifest, ends by itself, or
    /// violates the protocol; or its temporary folder or files cannot be written.
    pub fn open(engine: &Arc<LocatedEngine>, request: &SceneRequest) -> Result<Self, EngineFault> {
        quarantine::check(engine)?;
        match engine.manifest().kind {
            EngineKind::Worker => {
                let mut worker = WorkerSession::start(engine, request.reads())?;
                let opened = worker.open(request)?;
                Ok(Self { driver: Driver::Worker(Box::new(worker)), opened })
            }
            EngineKind::Command => {
                let (line, opened) = CommandLine::open(engine, request)?;
                Ok(Self { driver: Driver::Command(Box::new(line)), opened })
            }
        }
    }

    /// Opens the scene again with another request, for example in another size.
    ///
    /// # Errors
    /// As for [`Session::open`]; a quarantine only counts if the engine must be started again.
    pub fn reopen(&mut self, engine: &Arc<LocatedEngine>, request: &SceneRequest) -> Result<(), EngineFault> {
        match &mut self.driver {
            // A worker can only read the files of the scene for which it was started.
            Driver::Worker(worker) if worker.reads() == request.reads() => self.opened = worker.open(request)?,
            Driver::Worker(_) | Driver::Command(_) => *self = Self::open(engine, request)?,
        }
        Ok(())
    }

    /// Returns true if it can wait for another picture: a worker can, a command line is started for each window anyway.
    pub(super) fn can_wait(&self) -> bool {
        matches!(self.driver, Driver::Worker(_))
    }

    /// Returns true if its worker may read the files of a scene, and no others.
    pub(super) fn reads_for(&self, request: &SceneRequest) -> bool {
        matches!(&self.driver, Driver::Worker(worker) if worker.reads() == request.reads())
    }

    /// Returns the engine's description of the scene.
    pub fn opened(&self) -> &Opened {
        &self.opened
    }

    /// Renders a window.
    ///
    /// - `on_progress`: receives the rendered fraction in 0..=1, as often as the engine reports it.
    pub(super) fn paint(
        &mut self,
        request: &WindowRequest,
        on_progress: &mut dyn FnMut(f64),
    ) -> Result<Written, EngineFault> {
        match &mut self.driver {
            Driver::Worker(worker) => worker.paint(request, on_progress),
            Driver::Command(line) => line.paint(request, on_progress),
        }
    }
}

/// Starts a worker and returns its list of the files that a scene refers to.
///
/// - `outside`: see [`SceneRequest`].
///
/// # Errors
/// The worker does not start, or cannot list them.
pub(super) fn ask_files(engine: &Arc<LocatedEngine>, scene: &Path, outside: &[PathBuf]) -> Result<Files, EngineFault> {
    WorkerSession::start(engine, reads(scene, outside))?.files(scene)
}

/// The result of starting a worker without a scene, as a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// The time that the start took, in seconds.
    pub seconds: f64,
}

impl Probe {
    /// Starts a worker without a scene and stops it again. Returns the time that the start took.
    ///
    /// # Errors
    /// The worker does not start, reports a failure, exceeds a limit of its manifest, ends by itself, or violates the
    /// protocol; or its temporary folder or files cannot be written.
    pub fn start(engine: &Arc<LocatedEngine>) -> Result<Self, EngineFault> {
        let begun = std::time::Instant::now();
        WorkerSession::start(engine, Vec::new())?;
        Ok(Self { seconds: begun.elapsed().as_secs_f64() })
    }
}
