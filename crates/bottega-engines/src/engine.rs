//! The interface between the farm and an engine.

use std::{
    ops::Range,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc,
    },
    time::Duration,
};

use bottega_image::{Rect, Tile};

use crate::{Sharing, Survey};

/// The render settings that the farm may choose per zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Tunables {
    /// The largest number of bounces of a path (the paper's Recursion Level). 0: only directly visible emission; 1:
    /// direct light; and so on.
    pub max_depth: u32,
    /// Light samples per path vertex (the paper's Light Samples).
    pub light_samples: u32,
}

/// The preference for one of several engines for a zone, from −1 (the first) to 1 (the last); 0 is neutral. It selects the
/// engine, and does not affect how it renders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnginePreference(f32);

impl EnginePreference {
    /// Returns a preference, clamped to −1..=1; NaN counts as 0.
    pub fn new(preference: f32) -> Self {
        Self(if preference.is_nan() { 0.0 } else { preference.clamp(-1.0, 1.0) })
    }

    /// Returns the value, from −1 to 1.
    pub fn get(self) -> f32 {
        self.0
    }
}

/// The description of an engine and the tunables that it supports.
#[derive(Clone, Debug, PartialEq)]
pub struct EngineDescription {
    /// The short name: `builtin`, `cycles`, …
    pub name: String,
    /// True if the farm may choose [`Tunables::max_depth`]: the engine obeys it, and the depth of the picture is known.
    pub has_max_depth: bool,
    /// True if the engine obeys [`Tunables::light_samples`].
    pub has_light_samples: bool,
    /// True if the engine can add samples to a tile later: earlier samples are kept, and the result is as good as that of one
    /// pass.
    pub resumes_samples: bool,
    /// True if a zone's first samples are worth rendering separately, to predict its time: not if starting a window is
    /// expensive.
    pub is_profiled: bool,
    /// True if a pixel is bit-identical whatever region it was rendered in.
    pub exact_by_pixel: bool,
}

/// A switch that ends one task early. Clones share the switch.
#[derive(Clone, Debug, Default)]
pub struct CancelSwitch(Arc<AtomicBool>);

impl CancelSwitch {
    /// Requests the task to end soon; its result may then have fewer samples.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns true if the task was cancelled.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// The progress of a task. Clones share the counter.
#[derive(Clone, Debug, Default)]
pub struct TaskProgress(Arc<AtomicU64>);

impl TaskProgress {
    /// Adds a number of rendered samples, counted over all pixels.
    pub fn add(&self, samples: u64) {
        self.0.fetch_add(samples, Ordering::Relaxed);
    }

    /// Returns the number of samples rendered so far, counted over all pixels.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// A zone to render, or some of its samples.
#[derive(Clone, Debug)]
pub struct ZoneTask {
    /// The rectangle of pixels.
    pub rect: Rect,
    /// The range of samples per pixel. It continues those in `tile`.
    pub samples: Range<u32>,
    /// The render settings.
    pub tunables: Tunables,
    /// The preference for one of several engines.
    pub preference: EnginePreference,
    /// The running sums of the samples before; `None`: `samples` starts at 0.
    pub tile: Option<Tile>,
    /// Disjoint parts of the rectangle to render; `None`: all of it. Engines that render whole windows may render all
    /// pixels: the caller only uses the parts.
    pub parts: Option<Vec<Rect>>,
    /// The switch to end the task early.
    pub cancel: CancelSwitch,
    /// The counter of rendered samples, updated by the engine as it proceeds.
    pub progress: TaskProgress,
}

impl ZoneTask {
    /// Returns a task for all pixels of a rectangle, without earlier samples and for any engine.
    ///
    /// - `samples`: the indices of the samples of each pixel.
    pub fn new(rect: Rect, samples: Range<u32>, tunables: Tunables) -> Self {
        Self {
            rect,
            samples,
            tunables,
            preference: EnginePreference::default(),
            tile: None,
            parts: None,
            cancel: CancelSwitch::default(),
            progress: TaskProgress::default(),
        }
    }
}

/// The result of a [`ZoneTask`].
#[derive(Clone, Debug)]
pub struct Painted {
    /// The running sums of all samples so far. After cancellation, the pixels may have different counts.
    pub tile: Tile,
    /// Time spent on the task, summed over all processors and devices.
    pub busy: Duration,
    /// True if `busy` measures only rendering: false if loading, compiling or starting may be part of it.
    pub is_warm: bool,
    /// The time per part: disjoint parts of the rectangle. Empty if the engine does not know.
    pub parts: Vec<(Rect, Duration)>,
    /// True if all samples were rendered; false if the task was cancelled.
    pub complete: bool,
}

/// The error of an engine.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// The zone could not be rendered.
    #[error("engine `{engine}` failed on zone {rect}: {reason}")]
    Zone {
        /// The name of the engine.
        engine: String,
        /// The rectangle of the zone.
        rect: Rect,
        /// The cause, as reported by the engine.
        reason: String,
    },
    /// The survey could not be rendered, or the picture could not be prepared.
    #[error("engine `{engine}` could not survey the scene: {reason}")]
    Survey {
        /// The name of the engine.
        engine: String,
        /// The cause, as reported by the engine.
        reason: String,
    },
}

/// A callback for the result of a zone, called once: on a thread of the engine, or on the one that drops the engine.
pub type ZoneCallback = Box<dyn FnOnce(Result<Painted, EngineError>) + Send>;

/// An engine that renders rectangles of one picture of one scene.
pub trait RenderEngine: Send + Sync {
    /// Returns the description of the engine.
    fn describe(&self) -> EngineDescription;

    /// Renders a fast, low-resolution survey of the whole picture (or of the crop window). Blocks.
    ///
    /// - `width`, `height`: columns and rows of the survey.
    ///
    /// # Errors
    /// The engine fails.
    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError>;

    /// Computes what all zones need, before the first is started, such as learned light distributions. Blocks. Optional.
    /// Without it the first zone's measured time includes this; pixels are the same.
    ///
    /// # Errors
    /// The engine fails.
    fn prepare(&self) -> Result<(), EngineError> {
        Ok(())
    }

    /// Computes the part of the [preparation](Self::prepare) that the machines of a picture can share. Blocks.
    ///
    /// - `_others`: distributes the parts among the machines, and collects their results.
    ///
    /// # Errors
    /// As for [`prepare`](Self::prepare); or it was stopped early, and is computed when it is needed.
    fn prepare_with(&self, _others: &dyn Sharing) -> Result<(), EngineError> {
        Ok(())
    }

    /// Returns what [`prepare`](Self::prepare) has learned, in the engine's own format, for engines of other machines that
    /// render the same picture; `None`: nothing yet, or nothing that can be shared.
    fn learnt(&self) -> Option<Vec<u8>> {
        None
    }

    /// Loads what another instance has [learned](Self::learnt) about the same picture, instead of learning it here.
    /// Engines that cannot share it do nothing.
    ///
    /// # Errors
    /// The bytes have another format.
    fn learn_from(&self, _bytes: &[u8]) -> Result<(), EngineError> {
        Ok(())
    }

    /// Starts a zone and returns at once; `done` is called exactly once. If the engine is dropped first, the result is
    /// incomplete.
    fn start(&self, task: ZoneTask, done: ZoneCallback);

    /// Renders a zone and returns its result. Blocks.
    ///
    /// # Errors
    /// The engine fails, or ends without a report.
    fn paint(&self, task: ZoneTask) -> Result<Painted, EngineError> {
        let rect = task.rect;
        let (sender, receiver) = mpsc::channel();
        // The receiver outlives the engine's report.
        self.start(task, Box::new(move |painted| drop(sender.send(painted))));
        let reason = || "it did not report".to_owned();
        let lost = |_| EngineError::Zone { engine: self.describe().name, rect, reason: reason() };
        receiver.recv().map_err(lost)?
    }
}
