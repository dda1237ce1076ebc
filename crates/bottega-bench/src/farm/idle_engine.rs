//! An engine that waits instead of rendering.

use std::{
    sync::{Mutex, PoisonError, mpsc},
    thread,
    time::Duration,
};

use bottega_engines::{
    EngineDescription, EngineError, Painted, RenderEngine, Survey, SurveyPixel, Tunables, ZoneCallback, ZoneTask,
};
use bottega_farm::{AuctionRule, JobSettings};
use bottega_image::{AovSet, Layout, Rect, SampleValues, Tile};

/// Samples per pixel: the first one is the profile.
const SAMPLES: u32 = 16;
/// The side of a zone, in pixels.
const ZONE_SIDE: u32 = 8;

/// An engine with one processor that waits instead of rendering. All samples are equal.
pub(super) struct IdleEngine {
    tasks: Mutex<mpsc::Sender<(ZoneTask, ZoneCallback)>>,
}

impl IdleEngine {
    /// Makes an engine that waits instead of rendering.
    ///
    /// - `zone_time`: mean time of all samples of a zone, over all agents.
    /// - `agent`: the number of the agent.
    ///
    /// # Errors
    /// The operating system cannot start a thread.
    pub(super) fn new(zone_time: Duration, agent: u32) -> std::io::Result<Self> {
        let zone_time = zone_time.div_f64(speed_of(agent));
        let (tasks, given) = mpsc::channel::<(ZoneTask, ZoneCallback)>();
        // The thread ends when the engine is dropped.
        thread::Builder::new().name("engine".to_owned()).spawn(move || {
            for (task, done) in given {
                let time = time_of(&task, zone_time, agent);
                thread::sleep(time);
                done(Ok(paint(task, time)));
            }
        })?;
        Ok(Self { tasks: Mutex::new(tasks) })
    }
}

/// Returns the settings for an image with about this many zones of equal cost.
pub(super) fn settings(zones: u32, auction: AuctionRule) -> JobSettings {
    let side = (f64::from(zones).sqrt().ceil() as u32).max(1) * ZONE_SIDE;
    let settings = JobSettings::new(side, side, SAMPLES, tunables(), Layout::new(AovSet::NONE));
    JobSettings { zones: Some(zones), processors: 1, auction, ..settings }
}

fn tunables() -> Tunables {
    Tunables { max_depth: 1, light_samples: 1 }
}

/// Returns the relative speed of a machine, 0.6 to 1.4. With equal machines all agents become free at the same time, again and
/// again, because large zones go first and zones of equal time have equal size.
fn speed_of(agent: u32) -> f64 {
    // Multiples of the golden ratio are evenly distributed for any count.
    0.6 + 0.8 * (f64::from(agent) * 0.618_033_988_749_895).fract()
}

/// Returns the time of a task's samples: 0.5 to 1.5 times the mean by the zone's position, and up to a tenth more or less by the
/// agent.
fn time_of(task: &ZoneTask, zone_time: Duration, agent: u32) -> Duration {
    let Rect { x0, y0, .. } = task.rect;
    let zone = x0.wrapping_mul(0x9e37_79b9) ^ y0.wrapping_mul(0x85eb_ca6b);
    let weight = (0.5 + share_of(zone)) * (0.9 + 0.2 * share_of(zone ^ agent.wrapping_mul(0xc2b2_ae35)));
    zone_time.mul_f64(weight * f64::from(task.samples.end - task.samples.start) / f64::from(SAMPLES))
}

/// Returns a pseudo-random number in [0, 1).
fn share_of(number: u32) -> f64 {
    let hash = (number ^ (number >> 15)).wrapping_mul(0x2c1b_3c6d);
    let hash = (hash ^ (hash >> 12)).wrapping_mul(0x297a_2d39);
    f64::from((hash ^ (hash >> 15)) >> 8) / f64::from(1 << 24)
}

fn paint(task: ZoneTask, busy: Duration) -> Painted {
    if task.cancel.is_cancelled() {
        let tile = task.tile.unwrap_or_else(|| Tile::new(task.rect, Layout::new(AovSet::NONE)));
        return Painted { tile, busy, is_warm: true, parts: Vec::new(), complete: false };
    }
    let mut tile = task.tile.unwrap_or_else(|| Tile::new(task.rect, Layout::new(AovSet::NONE)));
    let values = SampleValues { radiance: [0.5; 3], alpha: 1.0, ..SampleValues::default() };
    for (x, y) in task.rect.pixels() {
        task.samples.clone().for_each(|_| tile.add(x, y, &values));
    }
    task.progress.add(task.rect.area() * u64::from(task.samples.end - task.samples.start));
    Painted { tile, busy, is_warm: true, parts: Vec::new(), complete: true }
}

impl RenderEngine for IdleEngine {
    fn describe(&self) -> EngineDescription {
        EngineDescription {
            name: "idle".to_owned(),
            has_max_depth: false,
            has_light_samples: false,
            resumes_samples: true,
            is_profiled: true,
            exact_by_pixel: true,
        }
    }

    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError> {
        let pixel = SurveyPixel { steps: 30.0, path_length: 2.0, ..SurveyPixel::default() };
        Ok(Survey { width, height, pixels: vec![pixel; width as usize * height as usize], zones_max: None })
    }

    fn start(&self, task: ZoneTask, done: ZoneCallback) {
        // The thread lives as long as the engine.
        _ = self.tasks.lock().unwrap_or_else(PoisonError::into_inner).send((task, done));
    }
}
