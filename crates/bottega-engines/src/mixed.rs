//! Several engines that render one picture of the same scene.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use crate::{EngineDescription, EngineError, Painted, RenderEngine, Survey, ZoneCallback, ZoneTask};

/// The weight of the previous estimate of an engine's speed when a zone is done.
const MEMORY: f64 = 0.7;

/// An engine that distributes zones over several engines: each free engine takes the zone that suits it best, and a zone
/// that fails on one engine goes to another.
pub struct MixedEngine {
    shared: Arc<MixedState>,
    /// The index of the engine that renders the survey.
    surveyor: usize,
}

struct MixedState {
    engines: Vec<Arc<dyn RenderEngine>>,
    desk: Mutex<WorkQueue>,
}

/// The waiting zones, and the load of each engine.
struct WorkQueue {
    loads: Vec<Load>,
    /// The waiting zones, in the order of arrival.
    waiting: Vec<Waiting>,
}

/// The load of an engine.
#[derive(Clone, Copy, Debug)]
struct Load {
    /// The most zones that the engine may run at a time.
    most: usize,
    /// The zones that the engine runs.
    running: usize,
    /// Samples in progress, over all pixels.
    under_way: f64,
    /// Samples per second, over all pixels; `None`: it has not rendered yet.
    speed: Option<f64>,
    /// Number of finished zones.
    zones: u64,
}

/// A zone that waits for an engine.
struct Waiting {
    task: ZoneTask,
    done: ZoneCallback,
    /// The engines that failed on it.
    failed: Vec<usize>,
}

impl MixedEngine {
    /// Returns the combined engine.
    ///
    /// - `engines`: at least one, each with the number of zones that it renders at a time. The rules of the job may prefer
    ///   the first for simple zones and the last for complex ones.
    /// - `surveyor`: the index of the engine that renders the survey.
    ///
    /// # Panics
    /// There is no engine with the index `surveyor`.
    pub fn new(engines: Vec<(Arc<dyn RenderEngine>, usize)>, surveyor: usize) -> Self {
        assert!(surveyor < engines.len(), "somebody must look at the scene");
        let idle = |most: usize| Load { most: most.max(1), running: 0, under_way: 0.0, speed: None, zones: 0 };
        let loads = engines.iter().map(|(_, most)| idle(*most)).collect();
        let engines = engines.into_iter().map(|(engine, _)| engine).collect();
        let desk = Mutex::new(WorkQueue { loads, waiting: Vec::new() });
        Self { shared: Arc::new(MixedState { engines, desk }), surveyor }
    }

    /// Returns the name of each engine with the number of zones, or passes of zones, that it has rendered so far, in
    /// the order in which the engines were given.
    pub fn zones_by_engine(&self) -> Vec<(String, u64)> {
        let names = self.shared.engines.iter().map(|engine| engine.describe().name);
        names.zip(self.shared.desk().loads.iter().map(|load| load.zones)).collect()
    }
}

fn samples_of(task: &ZoneTask) -> f64 {
    task.rect.area() as f64 * f64::from(task.samples.end.saturating_sub(task.samples.start))
}

impl WorkQueue {
    /// Removes the zone to start next. Returns it with its engine.
    fn next(&mut self) -> Option<(usize, Waiting)> {
        // Collect pairs of a free engine and a zone that it may render
        let free = |engine: &usize| self.loads[*engine].running < self.loads[*engine].most;
        let pairs = (0..self.loads.len()).filter(free).flat_map(|engine| {
            let may = move |(_, waiting): &(usize, &Waiting)| !waiting.failed.contains(&engine);
            self.waiting.iter().enumerate().filter(may).map(move |(index, _)| (engine, index))
        });
        let pairs = pairs.filter(|&(engine, index)| !self.leaves(engine, &self.waiting[index]));
        // Of equal pairs, take the first, so that no zone waits forever.
        let best = pairs.fold(None, |best: Option<(f64, usize, usize)>, (engine, index)| {
            let suits = self.suits(engine, &self.waiting[index].task);
            if best.is_some_and(|(most, ..)| most >= suits) { best } else { Some((suits, engine, index)) }
        });
        // Assign the best pair
        let (_, engine, index) = best?;
        let waiting = self.waiting.remove(index);
        let load = &mut self.loads[engine];
        load.running += 1;
        load.under_way += samples_of(&waiting.task);
        Some((engine, waiting))
    }

    /// Returns how well a zone suits an engine, from −1 to 1.
    fn suits(&self, engine: usize, task: &ZoneTask) -> f64 {
        let last = self.loads.len().saturating_sub(1).max(1);
        let place = 2.0 * engine as f64 / last as f64 - 1.0;
        place * f64::from(task.preference.get())
    }

    /// Returns true if an engine leaves a zone to another one that is so much faster that it will finish everything that waits
    /// sooner.
    fn leaves(&self, engine: usize, waiting: &Waiting) -> bool {
        let Some(own) = self.loads[engine].speed else { return false };
        let all: f64 = self.waiting.iter().map(|waiting| samples_of(&waiting.task)).sum();
        let is_sooner = |(other, load): (usize, &Load)| {
            let may = other != engine && !waiting.failed.contains(&other);
            may && load.speed.is_some_and(|speed| (load.under_way + all) * own < samples_of(&waiting.task) * speed)
        };
        self.loads.iter().enumerate().any(is_sooner)
    }

    /// Records the end of a zone.
    ///
    /// - `seconds`: the time that it took; `None`: not a valid measurement.
    fn settle(&mut self, engine: usize, samples: f64, seconds: Option<f64>, is_complete: bool) {
        let load = &mut self.loads[engine];
        load.running -= 1;
        load.under_way = (load.under_way - samples).max(0.0);
        load.zones += u64::from(is_complete);
        if let Some(seconds) = seconds.filter(|_| is_complete) {
            let speed = samples / seconds.max(1e-6);
            load.speed = Some(load.speed.map_or(speed, |before| MEMORY * before + (1.0 - MEMORY) * speed));
        }
    }
}

impl MixedState {
    fn desk(&self) -> MutexGuard<'_, WorkQueue> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts as many zones as possible.
    fn go_on(self: &Arc<Self>) {
        loop {
            // Not in the condition of the loop: the lock must be released before an engine is started.
            let next = self.desk().next();
            let Some((engine, waiting)) = next else { break };
            self.begin(engine, waiting);
        }
    }

    fn begin(self: &Arc<Self>, engine: usize, waiting: Waiting) {
        let Waiting { task, done, mut failed } = waiting;
        let (shared, again, begun) = (Arc::clone(self), task.clone(), Instant::now());
        let finished = move |painted: Result<Painted, EngineError>| {
            let is_complete = painted.as_ref().is_ok_and(|painted| painted.complete);
            let is_warm = painted.as_ref().is_ok_and(|painted| painted.is_warm);
            let seconds = is_warm.then(|| begun.elapsed().as_secs_f64());
            shared.desk().settle(engine, samples_of(&again), seconds, is_complete);
            match painted {
                Err(error) if failed.len() + 1 < shared.engines.len() => {
                    tracing::warn!(%error, "another engine paints the zone");
                    failed.push(engine);
                    shared.desk().waiting.insert(0, Waiting { task: again, done, failed });
                }
                painted => done(painted),
            }
            shared.go_on();
        };
        self.engines[engine].start(task, Box::new(finished));
    }
}

impl RenderEngine for MixedEngine {
    fn describe(&self) -> EngineDescription {
        let all: Vec<EngineDescription> = self.shared.engines.iter().map(|engine| engine.describe()).collect();
        EngineDescription {
            name: all.iter().map(|engine| engine.name.as_str()).collect::<Vec<_>>().join("+"),
            has_max_depth: all.iter().all(|engine| engine.has_max_depth),
            has_light_samples: all.iter().all(|engine| engine.has_light_samples),
            resumes_samples: all.iter().all(|engine| engine.resumes_samples),
            is_profiled: all.iter().all(|engine| engine.is_profiled),
            exact_by_pixel: false,
        }
    }

    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError> {
        let mut survey = self.shared.engines[self.surveyor].survey(width, height)?;
        // No limit: each engine renders only its share of the zones.
        survey.zones_max = None;
        Ok(survey)
    }

    fn prepare(&self) -> Result<(), EngineError> {
        self.shared.engines.iter().try_for_each(|engine| engine.prepare())
    }

    fn start(&self, task: ZoneTask, done: ZoneCallback) {
        self.shared.desk().waiting.push(Waiting { task, done, failed: Vec::new() });
        self.shared.go_on();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use bottega_image::{AovSet, Layout, Rect, Tile};

    use super::*;
    use crate::{CancelSwitch, EnginePreference, TaskProgress, Tunables};

    /// An engine that renders at once, or never.
    struct ToyEngine(&'static str, bool);

    impl RenderEngine for ToyEngine {
        fn describe(&self) -> EngineDescription {
            EngineDescription {
                name: self.0.to_owned(),
                has_max_depth: true,
                has_light_samples: true,
                resumes_samples: true,
                is_profiled: true,
                exact_by_pixel: true,
            }
        }

        fn survey(&self, _: u32, _: u32) -> Result<Survey, EngineError> {
            Ok(Survey::default())
        }

        fn start(&self, task: ZoneTask, done: ZoneCallback) {
            let tile = Tile::new(task.rect, Layout::new(AovSet::NONE));
            let busy = std::time::Duration::from_millis(1);
            let painted = Painted { tile, busy, is_warm: true, parts: Vec::new(), complete: true };
            let failed = EngineError::Zone { engine: self.0.to_owned(), rect: task.rect, reason: "no".to_owned() };
            let outcome = if self.1 { Ok(painted) } else { Err(failed) };
            std::thread::spawn(move || done(outcome));
        }
    }

    fn task(side: u32, preference: f32) -> ZoneTask {
        ZoneTask {
            rect: Rect::of_size(side, 1),
            samples: 0..1,
            tunables: Tunables { max_depth: 1, light_samples: 1 },
            preference: EnginePreference::new(preference),
            tile: None,
            parts: None,
            cancel: CancelSwitch::default(),
            progress: TaskProgress::default(),
        }
    }

    fn waiting(side: u32, preference: f32) -> Waiting {
        Waiting { task: task(side, preference), done: Box::new(drop), failed: Vec::new() }
    }

    fn load(running: usize, under_way: f64, speed: Option<f64>) -> Load {
        Load { most: 1, running, under_way, speed, zones: 0 }
    }

    /// Returns which engine starts which zone, identified by its width.
    fn begun(loads: &[Load], zones: Vec<Waiting>) -> Vec<(usize, u32)> {
        let mut desk = WorkQueue { loads: loads.to_vec(), waiting: zones };
        std::iter::from_fn(|| desk.next().map(|(engine, waiting)| (engine, waiting.task.rect.width()))).collect()
    }

    #[test]
    fn each_engine_takes_what_suits_it_and_none_is_idle() {
        let idle = [load(0, 0.0, None), load(0, 0.0, None)];
        let three = || vec![waiting(7, 0.2), waiting(8, 0.9), waiting(9, -0.8)];
        assert_eq!(begun(&idle, three()), [(1, 8), (0, 9)]);
        // A free engine also renders zones that suit the other one better.
        assert_eq!(begun(&[load(0, 0.0, None), load(1, 5.0, None)], vec![waiting(7, 1.0)]), [(0, 7)]);
        // Without preferences, zones start in order of arrival.
        assert_eq!(begun(&idle, vec![waiting(7, 0.0), waiting(8, 0.0)]), [(0, 7), (1, 8)]);
    }

    #[test]
    fn a_zone_is_left_to_an_engine_that_has_all_of_them_before() {
        let loads = [load(0, 0.0, Some(1.0)), load(1, 10.0, Some(10.0))];
        assert_eq!(begun(&loads, vec![waiting(10, 0.0)]), []);
        assert_eq!(begun(&loads, (0..9).map(|_| waiting(10, 0.0)).collect()), [(0, 10)]);
        // Except a zone on which that engine has failed.
        let failed = Waiting { failed: vec![1], ..waiting(10, 0.0) };
        assert_eq!(begun(&loads, vec![failed]), [(0, 10)]);
    }

    #[test]
    fn zones_of_an_engine_that_fails_are_painted_and_counted_by_the_other() {
        for (bad, good) in [(0, 1), (1, 0)] {
            let toy =
                |index: usize| (Arc::new(ToyEngine(["a", "b"][index], index == good)) as Arc<dyn RenderEngine>, 1);
            let mixed = MixedEngine::new(vec![toy(0), toy(1)], 0);
            let (sender, answers) = mpsc::channel();
            for _ in 0..20 {
                let sender = sender.clone();
                mixed.start(task(4, 0.0), Box::new(move |painted| sender.send(painted.is_ok()).expect("heard")));
            }
            assert!((0..20).all(|_| answers.recv().is_ok_and(|is_painted| is_painted)));
            let zones = mixed.zones_by_engine();
            assert_eq!((zones[bad].1, zones[good].1), (0, 20));
        }
    }

    #[test]
    fn a_zone_that_all_engines_fail_on_is_reported_once() {
        let toys = ["a", "b"].map(|name| (Arc::new(ToyEngine(name, false)) as Arc<dyn RenderEngine>, 1));
        let mixed = MixedEngine::new(toys.to_vec(), 0);
        let (sender, answers) = mpsc::channel();
        mixed.start(task(4, 0.0), Box::new(move |painted| sender.send(painted.is_err()).expect("heard")));
        assert_eq!(answers.recv(), Ok(true));
        assert!(answers.recv().is_err());
    }
}
