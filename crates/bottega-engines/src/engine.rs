//! The contract between the farm and an engine.

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

/// The settings that the farm may choose for a zone, in the farm's own words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Tunables {
    /// Bounces of a path after the first surface's direct light (the paper's Recursion Level).
    pub max_depth: u32,
    /// Light samples a path vertex (the paper's Light Samples).
    pub light_samples: u32,
}

/// Which of several engines suits a zone better, from −1 (the first) to 1 (the last); 0 is no difference. It decides who paints
/// a zone, and nothing of how.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnginePreference(f32);

impl EnginePreference {
    /// What is beyond the ends counts as the end, and what is no number as no difference.
    pub fn new(leaning: f32) -> Self {
        Self(if leaning.is_nan() { 0.0 } else { leaning.clamp(-1.0, 1.0) })
    }

    /// From −1 to 1.
    pub fn get(self) -> f32 {
        self.0
    }
}

/// The description of an engine, with its tunables. An engine is never credited for a tunable that it lacks.
#[derive(Clone, Debug, PartialEq)]
pub struct EngineDescription {
    /// Short name: `builtin`, `cycles`, …
    pub name: String,
    /// Whether it obeys [`Tunables::max_depth`].
    pub has_max_depth: bool,
    /// Whether it obeys [`Tunables::light_samples`].
    pub has_light_samples: bool,
    /// Whether a tile can be gone on with later: the samples of a pass are kept and the picture is the same.
    pub resumes_samples: bool,
    /// Whether a zone's first samples are worth painting by themselves, to learn how long it will take: not where the start of
    /// each painting is dear.
    pub is_profiled: bool,
    /// Whether a pixel has the same bits whatever region it was painted in.
    pub exact_by_pixel: bool,
}

/// Ends one task early. Clones are the same switch.
#[derive(Clone, Debug, Default)]
pub struct CancelSwitch(Arc<AtomicBool>);

impl CancelSwitch {
    /// Ends the task soon; it is reported with what it has.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it was pressed.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// The progress of a task: how much of it is painted. Clones are the same counter.
#[derive(Clone, Debug, Default)]
pub struct TaskProgress(Arc<AtomicU64>);

impl TaskProgress {
    /// So much more is painted, in samples of single pixels.
    pub fn add(&self, samples: u64) {
        self.0.fetch_add(samples, Ordering::Relaxed);
    }

    /// How much is, in samples of single pixels.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// A zone to paint, or some of its samples.
#[derive(Clone, Debug)]
pub struct ZoneTask {
    /// The pixels.
    pub rect: Rect,
    /// Which samples of each pixel. They go on from what `tile` holds.
    pub samples: Range<u32>,
    /// At which settings.
    pub tunables: Tunables,
    /// For which of several engines.
    pub leaning: EnginePreference,
    /// Running sums of the samples before; `None`: `samples` starts at 0.
    pub tile: Option<Tile>,
    /// Disjoint parts of the rectangle that are to have the samples; `None`: all of it. Engines that paint whole windows may
    /// give them to all pixels: whoever asks for parts takes no others.
    pub parts: Option<Vec<Rect>>,
    /// Whoever has this may end it early.
    pub cancel: CancelSwitch,
    /// The engine counts here what it has painted, as often as it knows, before the task is done too.
    pub progress: TaskProgress,
}

impl ZoneTask {
    /// The task of these samples, which go on from none, in the whole rectangle and by any engine.
    pub fn new(rect: Rect, samples: Range<u32>, tunables: Tunables) -> Self {
        Self {
            rect,
            samples,
            tunables,
            leaning: EnginePreference::default(),
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
    /// Running sums of all samples so far. After cancellation pixels may have different counts.
    pub tile: Tile,
    /// Processor time spent on it, summed over processors.
    pub busy: Duration,
    /// Whether that is a measurement of painting alone: not where something was loaded, compiled or started meanwhile.
    pub is_warm: bool,
    /// Where that time went: disjoint parts of the rectangle. Empty where the engine does not know.
    pub parts: Vec<(Rect, Duration)>,
    /// False when it was cancelled before the end.
    pub complete: bool,
}

/// Why an engine could not.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// The zone could not be painted.
    #[error("engine `{engine}` failed on zone {rect}: {reason}")]
    Zone {
        /// Name of the engine.
        engine: String,
        /// The zone.
        rect: Rect,
        /// What it said.
        reason: String,
    },
    /// The survey could not be made.
    #[error("engine `{engine}` could not survey the scene: {reason}")]
    Survey {
        /// Name of the engine.
        engine: String,
        /// What it said.
        reason: String,
    },
}

/// Takes the result of a zone, once, on a thread of the engine's.
pub type ZoneCallback = Box<dyn FnOnce(Result<Painted, EngineError>) + Send>;

/// Something that paints rectangles of one picture of one scene.
pub trait RenderEngine: Send + Sync {
    /// What it is and can.
    fn describe(&self) -> EngineDescription;

    /// A fast, low-resolution look at the whole picture (or the crop window). Blocks.
    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError>;

    /// Makes what all zones need, before the first of them is started: what is learnt of a scene, say. Blocks. Whoever
    /// does not call this gets the same pictures, and the first zone seems dearer than it is.
    fn prepare(&self) -> Result<(), EngineError> {
        Ok(())
    }

    /// Makes that part of it which can be shared out among all who paint the picture. Blocks.
    ///
    /// # Errors
    /// As [`prepare`](Self::prepare); or it was left before its end, and is made when it is needed.
    fn prepare_with(&self, _others: &dyn Sharing) -> Result<(), EngineError> {
        Ok(())
    }

    /// What it has learnt in [`prepare`](Self::prepare), for engines elsewhere that paint the same picture; `None`: nothing
    /// yet, or nothing that could be told.
    fn learnt(&self) -> Option<Vec<u8>> {
        None
    }

    /// Takes what another one like it has [learnt](Self::learnt) of the same picture: it need not learn it itself.
    ///
    /// # Errors
    /// The bytes are nothing of the kind.
    fn learn_from(&self, _bytes: &[u8]) -> Result<(), EngineError> {
        Ok(())
    }

    /// Starts a zone and returns at once; `done` is called exactly once, on a thread of the engine's.
    fn start(&self, task: ZoneTask, done: ZoneCallback);

    /// Paints a zone. Blocks.
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
