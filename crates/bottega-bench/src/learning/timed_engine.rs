//! An engine that paints one zone at a time, and measures the processor time of each.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use bottega_engines::{EngineDescription, EngineError, Painted, RenderEngine, Survey, ZoneTask};
use bottega_platform::processor_time::own_seconds;

/// The callback of a zone.
type Told = Box<dyn FnOnce(Result<Painted, EngineError>) + Send>;

/// An engine that measures zones by processor time, which other programs on the machine hardly affect. Processor time is known
/// only for the whole process, so it paints one zone at a time.
#[derive(Clone)]
pub(super) struct TimedEngine {
    engine: Arc<dyn RenderEngine>,
    queue: Arc<Mutex<ZoneQueue>>,
}

#[derive(Default)]
struct ZoneQueue {
    is_busy: bool,
    waiting: VecDeque<(ZoneTask, Told)>,
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
        drop(queue);
        let Some((task, done)) = next else { return };
        let (timed, begun) = (self.clone(), own_seconds());
        let told = move |painted: Result<Painted, EngineError>| {
            let spent = own_seconds().zip(begun).map(|(now, begun)| Duration::from_secs_f64(now - begun));
            timed.paint_next();
            done(painted.map(|painted| Painted { busy: spent.unwrap_or(painted.busy), ..painted }));
        };
        self.engine.start(task, Box::new(told));
    }
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

    fn start(&self, task: ZoneTask, done: Told) {
        let mut queue = self.queue();
        queue.waiting.push_back((task, done));
        let is_busy = queue.is_busy;
        drop(queue);
        if !is_busy {
            self.paint_next();
        }
    }
}
