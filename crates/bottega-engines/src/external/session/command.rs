//! A session with one process per window, controlled by its command line.

use std::{
    fs,
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_image::Rect;

use super::request::{SceneRequest, WindowRequest, Written};
use crate::external::{
    child::{ChildOutput, GuardedChild, Program},
    error::EngineFault,
    locate::{LocatedEngine, run},
    log_tail,
    manifest::{Argument, FirstRow, FramePart, Invocation, Values, limit},
    protocol::Opened,
    scratch::Scratch,
};

/// The default size of a picture.
const DEFAULT_SIZE: (u32, u32) = (1280, 720);
/// The largest width or height of a picture.
const SIDE_MAX: u32 = 1 << 20;

/// A session with a process per window.
#[derive(Debug)]
pub(super) struct CommandLine {
    engine: Arc<LocatedEngine>,
    scratch: Scratch,
    request: SceneRequest,
    size: (u32, u32),
    count: u64,
}

impl CommandLine {
    /// Prepares for a scene. Starts nothing except the query for its size.
    pub(super) fn open(engine: &Arc<LocatedEngine>, request: &SceneRequest) -> Result<(Self, Opened), EngineFault> {
        let scratch = Scratch::new()?;
        engine.entry.unpack(scratch.path())?;
        let mut line =
            Self { engine: Arc::clone(engine), scratch, request: request.clone(), size: DEFAULT_SIZE, count: 0 };
        line.size = match request.size {
            Some(size) => size,
            None => line.ask_size()?,
        };
        let opened = Opened { width: line.size.0, height: line.size.1, camera: true, ..Opened::default() };
        Ok((line, opened))
    }

    fn invocation(&self) -> Result<&Invocation, EngineFault> {
        let command = self.engine.manifest().command.as_ref();
        command.ok_or_else(|| EngineFault::Protocol { problem: "its manifest has no [command]".to_owned() })
    }

    fn ask_size(&self) -> Result<(u32, u32), EngineFault> {
        let invocation = self.invocation()?;
        if invocation.size.is_empty() {
            return Ok(DEFAULT_SIZE);
        }
        let way = self.engine.way();
        let line = Argument::fill_all(&invocation.size, &self.scene_values());
        let time = limit(self.engine.manifest().limits.open_seconds).unwrap_or(Duration::MAX);
        let reads = self.request.reads();
        let (said, _) = run(&line, self.scratch.path(), way, &reads, time)?;
        let numbers = said.lines().rev().map(|line| line.split_whitespace().map(str::parse).collect::<Vec<_>>());
        let size = numbers.into_iter().find_map(|numbers| match *numbers {
            [Ok(width), Ok(height)] if (1..=SIDE_MAX).contains(&width) && (1..=SIDE_MAX).contains(&height) => {
                Some((width, height))
            }
            _ => None,
        });
        size.ok_or(EngineFault::Refused { reason: said, fatal: false })
    }

    fn scene_values(&self) -> Values {
        let folder = self.scratch.path().display().to_string();
        let mut values: Values = [
            ("program", self.engine.program.display().to_string()),
            ("folder", folder.clone()),
            ("scratch", folder),
            ("scene", self.request.scene.display().to_string()),
            ("width", self.size.0.to_string()),
            ("height", self.size.1.to_string()),
            ("threads", self.request.threads.to_string()),
        ]
        .into();
        values.extend(self.request.frame.map(|frame| ("frame", frame.to_string())));
        values
    }

    fn values(&self, request: &WindowRequest, output: &std::path::Path) -> Values {
        let Rect { x0, y0, x1, y1 } = request.window;
        let height = self.size.1;
        let numbers = [
            ("x0", x0),
            ("y0", y0),
            ("x1", x1),
            ("y1", y1),
            ("b0", height.saturating_sub(y1)),
            ("b1", height.saturating_sub(y0)),
            ("w", request.window.width()),
            ("h", request.window.height()),
            ("samples", request.samples),
            ("seed", request.seed),
            ("first_sample", request.first_sample),
        ];
        let mut values = self.scene_values();
        values.insert("output", output.display().to_string());
        values.extend(numbers.map(|(name, number)| (name, number.to_string())));
        values.extend(request.max_depth.map(|depth| ("max_depth", depth.to_string())));
        values.extend(request.light_samples.map(|samples| ("light_samples", samples.to_string())));
        values.extend(request.seconds.map(|seconds| ("time", seconds.to_string())));
        values
    }

    /// Renders a window: starts the process, watches its log and its limits, and returns the file that it wrote.
    pub(super) fn paint(
        &mut self,
        request: &WindowRequest,
        on_progress: &mut dyn FnMut(f64),
    ) -> Result<Written, EngineFault> {
        let engine = Arc::clone(&self.engine);
        let (manifest, way) = (engine.manifest(), engine.way());
        let invocation = self.invocation()?.clone();
        // Use a new folder for each window, so that old output is not mistaken for new.
        self.count += 1;
        let folder = self.scratch.path().join(self.count.to_string());
        fs::create_dir(&folder).map_err(EngineFault::Scratch)?;
        let output = folder.join(&invocation.output);
        let mut values = self.values(request, &output);
        values.insert("scratch", folder.display().to_string());
        let line = Argument::fill_all(&invocation.run, &values);
        // The scripts are in the parent of the window's folder.
        let reads: Vec<PathBuf> = self.request.reads().into_iter().chain([self.scratch.path().to_owned()]).collect();
        let program = Program {
            line: &line,
            scratch: &folder,
            environment: &way.environment,
            inherit: &way.inherit,
            writes: &way.writes,
            reads: &reads,
            limits: manifest.limits,
        };
        let mut child = GuardedChild::spawn(&program)?;
        child.close_stdin();
        let begun = Instant::now();
        let mut last_output = (begun, 0);
        let ended_well = loop {
            match child.listen()? {
                ChildOutput::End if let Some(ended_well) = child.outcome() => break ended_well,
                ChildOutput::End => std::thread::sleep(Duration::from_millis(5)),
                ChildOutput::Line(_) | ChildOutput::Silence => {}
            }
            let written = child.log().written();
            if written != last_output.1 {
                last_output = (Instant::now(), written);
                let share = manifest.progress.as_ref().and_then(|text| text.pattern.share(&child.log().text()));
                share.into_iter().for_each(&mut *on_progress);
            }
            if request.cancel.is_cancelled() {
                return Err(EngineFault::Cancelled);
            }
            let late = limit(manifest.limits.zone_seconds).filter(|time| begun.elapsed() > *time);
            let silent = limit(manifest.limits.silence_seconds).filter(|time| last_output.0.elapsed() > *time);
            if let Some(time) = late.or(silent) {
                let what = if late.is_some() { "a picture" } else { "a word" };
                let log = log_tail(&engine, child.log());
                return Err(EngineFault::TimeOut { seconds: time.as_secs_f64(), what, log });
            }
        };
        if !ended_well {
            let status = child.ended().unwrap_or_default();
            return Err(EngineFault::Ended { status, log: log_tail(&engine, child.log()) });
        }
        if !fs::symlink_metadata(&output).is_ok_and(|found| found.is_file()) {
            return Err(EngineFault::NoPicture { log: log_tail(&engine, child.log()) });
        }
        let shows = match manifest.pixels.window {
            FramePart::Frame => Rect::of_size(self.size.0, self.size.1),
            FramePart::Window => request.window,
        };
        let is_upside_down = manifest.pixels.first_row == FirstRow::Bottom;
        Ok(Written { file: output, shows, is_upside_down, samples: None, once: 0.0 })
    }
}
