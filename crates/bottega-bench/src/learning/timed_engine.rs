//! An engine that paints one zone at a time, and measures each by the processor time of a fixed small picture.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use bottega_engines::{EngineDescription, EngineError, Painted, RenderEngine, SpeedProbe, Survey, ZoneTask};
use bottega_platform::processor_time::own_seconds;

/// The callback of a zone.
type ZoneCallback = Box<dyn FnOnce(Result<Painted, EngineError>) + Send>;

/// Processor time of the fixed picture on the reference machine, in seconds.
const PROBE_REFERENCE: f64 = 0.014;

/// An engine that measures zones in time of the reference machine: processor time of the zone over that of a fixed picture,
/// painted just before and after it. So other programs, which slow down both, hardly affect it. Processor time is known only for
/// the whole process, so it paints one zone at a time.
#[derive(Clone)]
pub(super) struct TimedEngine {
    engine: Arc<dyn RenderEngine>,
    queue: Arc<Mutex<ZoneQueue>>,
}

#[derive(Default)]
struct ZoneQueue {
    is_busy: bool,
    /// The last time of the fixed picture, in seconds.
    probed: Option<f64>,
    waiting: VecDeque<(ZoneTask, ZoneCallback)>,
}

impl TimedEngine {
    pub(super) fn new(engine: Arc<dyn RenderEngine>) -> Self {
        Self { engine, queue: Arc::default() }
    }

    fn queue(&self) -> MutexGuard<'_, ZoneQueue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn paint_next(&self) {
        let mut queue = self.queue();
        let next = queue.waiting.pop_front();
        queue.is_busy = next.is_some();
        let before = queue.probed;
        drop(queue);
        let Some((task, done)) = next else { return };
        let timed = self.clone();
        let before = before.or_else(probe);
        let begun = own_seconds();
        let finish = move |painted: Result<Painted, EngineError>| {
            let spent = own_seconds().zip(begun).map(|(now, begun)| now - begun);
            // Compare the zone with the fixed picture, and begin the next zone
            let after = probe();
            let pace = before.zip(after).map(|(before, after)| 0.5 * (before + after) / PROBE_REFERENCE);
            let time = spent.zip(pace).and_then(|(spent, pace)| Duration::try_from_secs_f64(spent / pace).ok());
            timed.queue().probed = after;
            timed.paint_next();
            done(painted.map(|painted| {
                let busy = time.unwrap_or(painted.busy);
                // The parts of the zone keep their shares
                let scale = busy.as_secs_f64() / painted.busy.as_secs_f64().max(1e-9);
                let parts = painted.parts.iter().map(|(rect, time)| (*rect, time.mul_f64(scale))).collect();
                Painted { busy, parts, ..painted }
            }));
        };
        self.engine.start(task, Box::new(finish));
    }
}

/// Returns the processor time of the fixed picture now, in seconds.
fn probe() -> Option<f64> {
    let probe = SpeedProbe::new().ok()?;
    let begun = own_seconds()?;
    std::hint::black_box(probe.paint().ok()?);
    Some(own_seconds()? - begun)
}

impl RenderEngine for TimedEngine {
    fn describe(&self) -> EngineDescription {
        self.engine.describe()
    }

    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError> {
        self.engine.survey(width, height)
    }

    fn prepare(&self) -> Result<(), EngineError> {
        self.engine.prepare()
    }

    fn start(&self, task: ZoneTask, done: ZoneCallback) {
        let mut queue = self.queue();
        queue.waiting.push_back((task, done));
        let is_busy = queue.is_busy;
        drop(queue);
        if !is_busy {
            self.paint_next();
        }
    }
}
