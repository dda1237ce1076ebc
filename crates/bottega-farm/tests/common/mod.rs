//! A fake engine: a value depends only on pixel and sample, and threads of its own render the zones.

pub(crate) mod survey;

use std::{
    collections::VecDeque,
    sync::{
        Arc, Condvar, Mutex,
        atomic::{AtomicU64, AtomicUsize, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use bottega_engines::{
    EngineDescription, EngineError, Painted, RenderEngine, Survey, Tunables, ZoneCallback, ZoneTask,
};
use bottega_image::{AovSet, Layout, SampleValues, Tile};

pub(crate) use survey::{survey, tunables};

struct Shared {
    queue: Mutex<(VecDeque<(ZoneTask, ZoneCallback)>, bool)>,
    filled: Condvar,
    /// Number of tasks that will still fail.
    failures: AtomicUsize,
    samples: AtomicU64,
    /// Amount of work per sample, which makes rendering take time.
    weight: u32,
    /// Samples of the tasks that have begun. The task that reaches the given number waits until it is cancelled.
    begun: AtomicU64,
    held_from: AtomicU64,
}

/// Number of checks for the stop, a millisecond apart. A test whose stop never comes fails instead of waiting for ever.
const LOOKS: u32 = 60_000;

impl Shared {
    /// Waits until the task is called off, if enough has begun with it. (The number of painted samples is too late: two
    /// threads may begin the last tasks.)
    fn hold(&self, task: &ZoneTask) {
        let count = task.rect.area() * u64::from(task.samples.end - task.samples.start);
        let begun = self.begun.fetch_add(count, Ordering::Relaxed) + count;
        for _ in 0..LOOKS {
            if begun < self.held_from.load(Ordering::Relaxed) || task.cancel.is_cancelled() {
                return;
            }
            thread::sleep(Duration::from_millis(1));
        }
    }
}

/// The fake engine.
pub(crate) struct FakeEngine {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

pub(crate) fn layout() -> Layout {
    Layout::new(AovSet::NONE)
}

/// The value of a sample of a pixel: a function of these alone.
fn radiance(x: u32, y: u32, sample: u32, tunables: Tunables, weight: u32) -> f32 {
    let mut bits = x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b) ^ sample.wrapping_mul(0xc2b2_ae35);
    for _ in 0..=weight + tunables.max_depth {
        bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d).rotate_left(7);
    }
    (bits >> 8) as f32 / (1 << 24) as f32
}

fn paint(shared: &Shared, task: ZoneTask) -> Painted {
    let mut tile = task.tile.unwrap_or_else(|| Tile::new(task.rect, layout()));
    let mut complete = true;
    let mut count = 0;
    'rows: for y in task.rect.y0..task.rect.y1 {
        for x in task.rect.x0..task.rect.x1 {
            if task.cancel.is_cancelled() {
                complete = false;
                break 'rows;
            }
            for sample in task.samples.clone() {
                let value = radiance(x, y, sample, task.tunables, shared.weight);
                tile.add(
                    x,
                    y,
                    &SampleValues { radiance: [value, value * 0.5, 0.25], alpha: 1.0, ..Default::default() },
                );
                count += 1;
            }
        }
    }
    shared.samples.fetch_add(count, Ordering::Relaxed);
    let busy = Duration::from_nanos(count * u64::from(10 + shared.weight));
    Painted { tile, busy, is_warm: true, parts: Vec::new(), complete }
}

fn work(shared: &Shared) {
    loop {
        let (task, done) = {
            let mut queue = shared.queue.lock().unwrap();
            loop {
                if let Some(next) = queue.0.pop_front() {
                    break next;
                }
                if queue.1 {
                    return;
                }
                queue = shared.filled.wait(queue).unwrap();
            }
        };
        let fails = shared.failures.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1)).is_ok();
        if fails {
            let (rect, reason) = (task.rect, "a failure was requested".to_owned());
            done(Err(EngineError::Zone { engine: "fake".to_owned(), rect, reason }));
        } else {
            shared.hold(&task);
            done(Ok(paint(shared, task)));
        }
    }
}

impl FakeEngine {
    pub(crate) fn new(threads: usize, weight: u32) -> Self {
        let shared = Arc::new(Shared {
            queue: Mutex::default(),
            filled: Condvar::new(),
            failures: AtomicUsize::new(0),
            samples: AtomicU64::new(0),
            weight,
            begun: AtomicU64::new(0),
            held_from: AtomicU64::new(u64::MAX),
        });
        let spawn = |_| {
            let shared = Arc::clone(&shared);
            thread::spawn(move || work(&shared))
        };
        Self { threads: (0..threads).map(spawn).collect(), shared }
    }

    pub(crate) fn fail(self, tasks: usize) -> Self {
        self.shared.failures.store(tasks, Ordering::Relaxed);
        self
    }

    /// The task that reaches this many samples, counted as tasks begin, waits until it is stopped, however late that is.
    pub(crate) fn hold_from(self, samples: u64) -> Self {
        self.shared.held_from.store(samples, Ordering::Relaxed);
        self
    }

    pub(crate) fn samples_painted(&self) -> u64 {
        self.shared.samples.load(Ordering::Relaxed)
    }
}

impl Drop for FakeEngine {
    fn drop(&mut self) {
        self.shared.queue.lock().unwrap().1 = true;
        self.shared.filled.notify_all();
        for thread in self.threads.drain(..) {
            // One of them may drop the last reference.
            if thread.thread().id() != thread::current().id() {
                thread.join().unwrap();
            }
        }
    }
}

impl RenderEngine for FakeEngine {
    fn describe(&self) -> EngineDescription {
        EngineDescription {
            name: "fake".to_owned(),
            has_max_depth: true,
            has_light_samples: true,
            resumes_samples: true,
            is_profiled: true,
            exact_by_pixel: true,
        }
    }

    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError> {
        Ok(survey(width, height))
    }

    fn start(&self, task: ZoneTask, done: ZoneCallback) {
        self.shared.queue.lock().unwrap().0.push_back((task, done));
        self.shared.filled.notify_one();
    }
}
