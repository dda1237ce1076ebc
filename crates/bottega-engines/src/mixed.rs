//! Several engines that paint one picture of a scene which all of them read.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use crate::{EngineDescription, EngineError, Painted, RenderEngine, Survey, ZoneTask};

/// How much of what was known of an engine's speed stays when a zone is done.
const MEMORY: f64 = 0.7;

/// Hands each zone to the engine that will have it soonest, and to another where one fails.
pub struct MixedEngine {
    engines: Vec<Arc<dyn RenderEngine>>,
    load: Arc<Mutex<Vec<Load>>>,
}

/// What an engine has to do.
#[derive(Clone, Copy, Debug)]
struct Load {
    /// Samples of pixels under way.
    under_way: f64,
    /// Samples of pixels a second; `None`: it has not painted yet.
    speed: Option<f64>,
    /// Zones done.
    zones: u64,
}

type Done = Box<dyn FnOnce(Result<Painted, EngineError>) + Send>;

impl MixedEngine {
    /// - `engines`: at least one. The first makes the survey.
    pub fn new(engines: Vec<Arc<dyn RenderEngine>>) -> Self {
        assert!(!engines.is_empty(), "somebody must paint");
        let idle = Load { under_way: 0.0, speed: None, zones: 0 };
        let load = Arc::new(Mutex::new(vec![idle; engines.len()]));
        Self { engines, load }
    }

    /// By name, how many zones or passes of zones each has painted.
    pub fn zones_by_engine(&self) -> Vec<(String, u64)> {
        let names = self.engines.iter().map(|engine| engine.describe().name);
        names.zip(loads(&self.load).iter().map(|load| load.zones)).collect()
    }
}

fn loads(load: &Mutex<Vec<Load>>) -> MutexGuard<'_, Vec<Load>> {
    load.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Who will have so much more done soonest. One that has painted nothing yet is tried first.
fn soonest(loads: &[Load], wanted: f64) -> usize {
    let seconds = |load: &Load| match load.speed {
        Some(speed) => (load.under_way + wanted) / speed.max(1e-9),
        None => load.under_way * 1e-12,
    };
    let by_time = |a: &usize, b: &usize| seconds(&loads[*a]).total_cmp(&seconds(&loads[*b]));
    (0..loads.len()).min_by(by_time).unwrap_or(0)
}

fn hand(engines: &[Arc<dyn RenderEngine>], load: &Arc<Mutex<Vec<Load>>>, chosen: usize, task: ZoneTask, done: Done) {
    let samples = task.rect.area() as f64 * f64::from(task.samples.end.saturating_sub(task.samples.start));
    loads(load)[chosen].under_way += samples;
    let (all, shared, again, begun) = (engines.to_vec(), Arc::clone(load), task.clone(), Instant::now());
    let finished = move |painted: Result<Painted, EngineError>| {
        {
            let mut loads = loads(&shared);
            let load = &mut loads[chosen];
            load.under_way = (load.under_way - samples).max(0.0);
            if painted.as_ref().is_ok_and(|painted| painted.complete) {
                let speed = samples / begun.elapsed().as_secs_f64().max(1e-6);
                load.speed = Some(load.speed.map_or(speed, |before| MEMORY * before + (1.0 - MEMORY) * speed));
                load.zones += 1;
            }
        }
        match painted {
            Err(error) if chosen + 1 < all.len() || chosen > 0 => {
                tracing::warn!(%error, "another engine paints the zone");
                let other = if chosen + 1 < all.len() { chosen + 1 } else { 0 };
                // Whoever takes over is asked last.
                let last = vec![Arc::clone(&all[other])];
                let alone = Arc::new(Mutex::new(vec![loads(&shared)[other]]));
                hand(&last, &alone, 0, again, done);
            }
            painted => done(painted),
        }
    };
    engines[chosen].start(task, Box::new(finished));
}

impl RenderEngine for MixedEngine {
    fn describe(&self) -> EngineDescription {
        let all: Vec<EngineDescription> = self.engines.iter().map(|engine| engine.describe()).collect();
        EngineDescription {
            name: all.iter().map(|engine| engine.name.as_str()).collect::<Vec<_>>().join("+"),
            has_max_depth: all.iter().all(|engine| engine.has_max_depth),
            has_light_samples: all.iter().all(|engine| engine.has_light_samples),
            resumes_samples: all.iter().all(|engine| engine.resumes_samples),
            exact_by_pixel: false,
        }
    }

    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError> {
        let mut survey = self.engines[0].survey(width, height)?;
        // Each has its share of the zones.
        survey.zones_max = None;
        Ok(survey)
    }

    fn prepare(&self) -> Result<(), EngineError> {
        self.engines.iter().try_for_each(|engine| engine.prepare())
    }

    fn start(&self, task: ZoneTask, done: Done) {
        let samples = task.rect.area() as f64 * f64::from(task.samples.end.saturating_sub(task.samples.start));
        let chosen = soonest(&loads(&self.load), samples);
        hand(&self.engines, &self.load, chosen, task, done);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_faster_one_gets_more_and_the_new_one_is_tried() {
        let load = |under_way, speed| Load { under_way, speed, zones: 0 };
        assert_eq!(soonest(&[load(0.0, Some(10.0)), load(0.0, None)], 5.0), 1);
        assert_eq!(soonest(&[load(0.0, Some(10.0)), load(0.0, Some(1.0))], 5.0), 0);
        assert_eq!(soonest(&[load(100.0, Some(10.0)), load(0.0, Some(1.0))], 5.0), 1);
    }
}
