//! A session with a process that keeps a scene open and renders window after window.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_image::{AovSet, Layout, Rect};

use super::request::{SceneRequest, WindowRequest, Written};
use crate::{
    CancelSwitch,
    external::{
        child::{ChildOutput, GuardedChild, Program},
        error::EngineFault,
        locate::{LocatedEngine, module_hint},
        log_tail,
        manifest::{Argument, Limits, Values, limit},
        protocol::{Files, Opened, PaintedFile, Ready, Request, VERSION, WorkerFailure, WorkerReply},
        scratch::Scratch,
    },
};

/// The most malformed answers that are tolerated. (Lines that are not JSON objects belong to the log.)
const WRONG_LINES_MAX: u32 = 100;

/// A session with a worker process.
#[derive(Debug)]
pub(super) struct WorkerSession {
    engine: Arc<LocatedEngine>,
    // Dropped before the folder, so that the process ends first.
    child: GuardedChild,
    scratch: Scratch,
    next_id: u64,
    frame: Option<i32>,
    /// The files that the worker may read in addition to its own.
    reads: Vec<PathBuf>,
    wrong_lines: u32,
}

/// The time limits of an answer.
struct Patience<'a> {
    whole: Option<Duration>,
    silence: Option<Duration>,
    what: &'static str,
    cancel: Option<&'a CancelSwitch>,
    /// The time to wait for the end of a cancelled window: less than a restart takes.
    grace: Duration,
}

impl WorkerSession {
    /// Starts a worker.
    ///
    /// - `reads`: files and folders that it may read in addition to the system's and its installation.
    pub(super) fn start(engine: &Arc<LocatedEngine>, reads: Vec<PathBuf>) -> Result<Self, EngineFault> {
        let scratch = Scratch::new()?;
        engine.entry.unpack(scratch.path())?;
        let manifest = engine.manifest();
        let values: Values = [
            ("program", engine.program.display().to_string()),
            ("folder", scratch.path().display().to_string()),
            ("scratch", scratch.path().display().to_string()),
        ]
        .into();
        let way = engine.way();
        let line = Argument::fill_all(&way.command, &values);
        let program = Program {
            line: &line,
            scratch: scratch.path(),
            environment: &way.environment,
            inherit: &way.inherit,
            writes: &way.writes,
            reads: &reads,
            limits: manifest.limits,
        };
        let child = GuardedChild::spawn(&program)?;
        let mut worker =
            Self { engine: Arc::clone(engine), child, scratch, next_id: 0, frame: None, reads, wrong_lines: 0 };
        let Limits { start_seconds, .. } = manifest.limits;
        let ready = worker.wait(&Patience::plain(start_seconds, "being ready"), &mut |_| {})?;
        match ready {
            WorkerReply::Ready(Ready { protocol: VERSION, version }) => {
                tracing::debug!(engine = manifest.name, version, "a worker is ready");
                Ok(worker)
            }
            WorkerReply::Ready(Ready { protocol, .. }) => {
                Err(protocol_error(format!("it speaks version {protocol}, but {VERSION} is needed")))
            }
            WorkerReply::Failed(failed) => Err(worker.refusal(failed)),
            other => Err(out_of_turn(&other)),
        }
    }

    /// Returns the files that the worker may read in addition to its own.
    pub(super) fn reads(&self) -> &[PathBuf] {
        &self.reads
    }

    /// Opens a scene.
    pub(super) fn open(&mut self, request: &SceneRequest) -> Result<Opened, EngineFault> {
        let scratch = self.scratch.path().to_owned();
        self.frame = request.frame;
        self.say(&Request::Open {
            scene: &request.scene,
            width: request.size.map(|(width, _)| width),
            height: request.size.map(|(_, height)| height),
            frame: request.frame,
            threads: request.threads,
            trust: request.trust,
            scratch: &scratch,
            view: request.view,
            parameters: &request.parameters,
        })?;
        let seconds = self.engine.manifest().limits.open_seconds;
        match self.wait(&Patience::plain(seconds, "opening the scene"), &mut |_| {})? {
            WorkerReply::Opened(opened) if opened.width == 0 || opened.height == 0 => {
                Err(protocol_error(format!("the scene has {}x{} pixels", opened.width, opened.height)))
            }
            WorkerReply::Opened(Opened { filter: Some(filter), .. }) if !filter.is_sound() => {
                Err(protocol_error(format!("the scene's pixel filter is {filter:?}")))
            }
            WorkerReply::Opened(opened) => {
                Layout::with_layers(AovSet::NONE, opened.layers().collect()).map_err(EngineFault::Layers)?;
                Ok(opened)
            }
            WorkerReply::Failed(failed) => Err(self.refusal(failed)),
            other => Err(out_of_turn(&other)),
        }
    }

    /// Asks which files a scene refers to.
    pub(super) fn files(&mut self, scene: &Path) -> Result<Files, EngineFault> {
        self.say(&Request::Files { scene })?;
        let seconds = self.engine.manifest().limits.open_seconds;
        match self.wait(&Patience::plain(seconds, "its list of files"), &mut |_| {})? {
            WorkerReply::Files(files) => Ok(files),
            WorkerReply::Failed(failed) => Err(self.refusal(failed)),
            other => Err(out_of_turn(&other)),
        }
    }

    /// Renders a window. Returns the file that the worker wrote.
    pub(super) fn paint(
        &mut self,
        request: &WindowRequest,
        on_progress: &mut dyn FnMut(f64),
    ) -> Result<Written, EngineFault> {
        let id = self.next_id;
        self.next_id += 1;
        let Rect { x0, y0, x1, y1 } = request.window;
        self.say(&Request::Paint {
            id,
            window: [x0, y0, x1, y1],
            samples: request.samples,
            first_sample: request.first_sample,
            seed: request.seed,
            max_depth: request.max_depth,
            light_samples: request.light_samples,
            time: request.seconds,
            frame: self.frame,
        })?;
        let manifest = self.engine.manifest();
        let patience = Patience {
            whole: limit(manifest.limits.zone_seconds),
            silence: limit(manifest.limits.silence_seconds),
            what: "a picture",
            cancel: Some(&request.cancel),
            grace: Duration::try_from_secs_f64(manifest.cost.start_seconds).unwrap_or_default(),
        };
        let answer = self.wait(&patience, &mut |progress| {
            if let (true, share) = (progress.0 == id, progress.1) {
                on_progress(share);
            }
        })?;
        let PaintedFile { file, window, samples, once, .. } = match answer {
            WorkerReply::Painted(painted) if painted.id == id => painted,
            WorkerReply::Failed(failed) => return Err(self.refusal(failed)),
            other => return Err(out_of_turn(&other)),
        };
        let [x0, y0, x1, y1] = window;
        let shows = Rect { x0, y0, x1, y1 };
        if x0 >= x1 || y0 >= y1 || !shows.encloses(&request.window) {
            return Err(protocol_error(format!("it painted {shows} instead of {}", request.window)));
        }
        self.check_place(&file)?;
        Ok(Written { file, shows, is_upside_down: false, samples, once })
    }

    /// Checks that the file which a worker names is a regular file in its scratch folder.
    fn check_place(&self, file: &Path) -> Result<(), EngineFault> {
        let no_picture = || EngineFault::NoPicture { log: log_tail(&self.engine, self.child.log()) };
        let is_plain = fs::symlink_metadata(file).map_err(|_| no_picture())?.is_file();
        let folder = file.parent().and_then(|folder| folder.canonicalize().ok());
        let ours = self.scratch.path().canonicalize().ok();
        if !is_plain || folder.is_none() || !folder.zip(ours).is_some_and(|(folder, ours)| folder.starts_with(ours)) {
            return Err(protocol_error(format!("it wrote `{}`, which is not in its folder", file.display())));
        }
        Ok(())
    }

    fn say(&mut self, request: &Request<'_>) -> Result<(), EngineFault> {
        let mut line = serde_json::to_vec(request).map_err(|error| protocol_error(error.to_string()))?;
        line.push(b'\n');
        let written = self.child.stdin().map(|stdin| stdin.write_all(&line).and_then(|()| stdin.flush()));
        match written {
            Some(Ok(())) => Ok(()),
            _ => Err(self.ended()),
        }
    }

    fn wait(
        &mut self,
        patience: &Patience<'_>,
        on_progress: &mut dyn FnMut((u64, f64)),
    ) -> Result<WorkerReply, EngineFault> {
        let begun = Instant::now();
        let mut last_output = (begun, self.child.log().written());
        let mut cancelled = None;
        loop {
            match self.child.listen()? {
                ChildOutput::Line(line) => {
                    last_output.0 = Instant::now();
                    match WorkerReply::parse(&line) {
                        Ok(WorkerReply::Progress(progress)) => on_progress((progress.id, progress.share)),
                        Ok(answer) => return Ok(answer),
                        Err(error) if line.starts_with('{') => self.wrong_line(&line, &error)?,
                        Err(_) => {}
                    }
                }
                ChildOutput::End => return Err(self.ended()),
                ChildOutput::Silence => {}
            }
            let written = self.child.log().written();
            if written != last_output.1 {
                last_output = (Instant::now(), written);
            }
            if patience.cancel.is_some_and(CancelSwitch::is_cancelled) {
                let since = *cancelled.get_or_insert_with(Instant::now);
                if since.elapsed() > patience.grace {
                    return Err(EngineFault::Cancelled);
                }
            }
            let late = patience.whole.filter(|whole| begun.elapsed() > *whole);
            let silent = patience.silence.filter(|silence| last_output.0.elapsed() > *silence);
            if let Some(time) = late.or(silent) {
                let what = if late.is_some() { patience.what } else { "a word" };
                let log = log_tail(&self.engine, self.child.log());
                return Err(EngineFault::TimeOut { seconds: time.as_secs_f64(), what, log });
            }
        }
    }

    fn wrong_line(&mut self, line: &str, error: &serde_json::Error) -> Result<(), EngineFault> {
        self.wrong_lines += 1;
        if self.wrong_lines <= WRONG_LINES_MAX && !line.contains("\"painted\"") {
            return Ok(());
        }
        let start: String = line.chars().take(200).collect();
        Err(protocol_error(format!("{error} in {start}")))
    }

    /// Returns a worker's refusal, with install instructions if a Python module is missing.
    fn refusal(&self, WorkerFailure { reason, fatal }: WorkerFailure) -> EngineFault {
        let reason = match module_hint(&self.engine, &reason) {
            Some(hint) => format!("{reason}; {hint}"),
            None => reason,
        };
        EngineFault::Refused { reason, fatal }
    }

    fn ended(&mut self) -> EngineFault {
        let status = self.child.ended().unwrap_or_else(|| "it closed its output".to_owned());
        EngineFault::Ended { status, log: log_tail(&self.engine, self.child.log()) }
    }
}

impl Patience<'_> {
    fn plain(seconds: f64, what: &'static str) -> Self {
        Self { whole: limit(seconds), silence: None, what, cancel: None, grace: Duration::ZERO }
    }
}

fn protocol_error(problem: String) -> EngineFault {
    EngineFault::Protocol { problem }
}

fn out_of_turn(answer: &WorkerReply) -> EngineFault {
    let mut text = format!("{answer:?}");
    text.truncate(text.char_indices().nth(200).map_or(text.len(), |(at, _)| at));
    protocol_error(format!("it sends a message out of turn: {text}"))
}
