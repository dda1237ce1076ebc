//! An external engine as a [`RenderEngine`].

use std::{
    collections::VecDeque,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError,
        atomic::{AtomicU64, Ordering},
        mpsc,
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bottega_image::{Layout, Rect, Tile};
use bottega_kernels::SplitMix64;

use super::{
    error::EngineFault,
    idle,
    locate::LocatedEngine,
    manifest::{Determinism, EngineKind},
    picture, quarantine,
    session::{SceneRequest, Session, WindowRequest},
    tiny,
};
use crate::{CancelSwitch, EngineDescription, EngineError, Painted, RenderEngine, Survey, ZoneCallback, ZoneTask};

/// The number of failures in a row after which an engine is quarantined.
const FAILURES_MAX: u32 = 3;
/// The windows per zone: a small one for its profile, and the rest.
const WINDOWS_OF_ZONE: f64 = 2.0;
/// The cost of a window in seconds, as declared in the manifest, from which zones are not profiled.
const WINDOW_DEAR: f64 = 0.1;
/// Seeds of engines are often signed 32-bit integers.
const SEED_MASK: u64 = (1 << 31) - 1;
/// Radiance that counts as black: less than 16-bit files distinguish from it.
const BLACK: f32 = 1e-6;

/// A function that surveys the scene with the given number of columns and rows. `None`: it cannot, and the engine
/// renders the survey.
pub type Surveyor = Box<dyn Fn(u32, u32) -> Option<Survey> + Send + Sync>;

/// The options of an external engine.
pub struct ExternalOptions {
    /// The scene, with the size of the picture.
    pub request: SceneRequest,
    /// The seed of the noise.
    pub seed: u64,
    /// Samples of the whole picture, over all pixels.
    pub samples: u64,
    /// The values kept per pixel.
    pub layout: Layout,
    /// The depth that stands for that of the scene file: a zone with this depth gets no depth setting, and the engine uses
    /// that of the file. `None`: every zone gets its depth, and the farm may choose it.
    pub scene_depth: Option<u32>,
    /// The number of light samples that stands for that of the scene file, likewise. `None`: every zone gets its number.
    pub scene_light_samples: Option<u32>,
    /// `true`: the number of zones is limited so that the fixed cost of a render window stays small compared to its samples;
    /// `false`: the user sets the number.
    pub bounds_zones: bool,
    /// The time limit of the picture, if any. Then zones are always profiled, to know their times in advance.
    pub time: Option<Duration>,
    /// A function that renders the survey in place of the engine; `None`: Bottega cannot read the scene, and the engine
    /// renders it.
    pub surveyor: Option<Surveyor>,
}

/// A survey, and the cost of windows if it was measured.
type Looked = (Survey, Option<tiny::WindowCost>);
type TileWatcher = Box<dyn Fn(&Tile) + Send + Sync>;
type FaultWatcher = Box<dyn Fn(&str) + Send + Sync>;

enum Work {
    Zone(ZoneTask, ZoneCallback),
    Survey(u32, u32, Option<tiny::WindowCost>, mpsc::Sender<Result<Looked, EngineFault>>),
    Pace(bool, mpsc::Sender<Result<Option<tiny::WindowCost>, EngineFault>>),
}

#[derive(Default)]
struct Queue {
    work: VecDeque<Work>,
    closed: bool,
}

/// The recent failures on this machine.
#[derive(Debug, Default)]
struct Health {
    failures: u32,
    last: String,
}

struct EngineState {
    located: Arc<LocatedEngine>,
    options: ExternalOptions,
    wanted: picture::ExtraChannels,
    lanes: usize,
    queue: Mutex<Queue>,
    woken: Condvar,
    /// Cancelled when the engine is dropped, to end running work.
    closing: CancelSwitch,
    health: Mutex<Health>,
    surveyed: OnceLock<Survey>,
    /// The time at which the first zone was started.
    begun: OnceLock<Instant>,
    samples_done: AtomicU64,
    dropped_count: AtomicU64,
    watcher: OnceLock<TileWatcher>,
    fault_watcher: OnceLock<FaultWatcher>,
}

/// An external engine with a scene, running on this machine.
pub struct ExternalEngine {
    shared: Arc<EngineState>,
    lanes: Vec<JoinHandle<()>>,
}

impl ExternalEngine {
    /// Returns an engine that renders with `session`, and with more such processes if the manifest allows parallel ones.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub fn new(located: Arc<LocatedEngine>, options: ExternalOptions, session: Session) -> Result<Self, EngineFault> {
        let lane_count = if located.manifest().cost.parallel { options.request.threads.max(1) } else { 1 };
        let shared = Arc::new(EngineState {
            located,
            wanted: picture::ExtraChannels::of(&options.layout),
            options,
            lanes: lane_count,
            queue: Mutex::default(),
            woken: Condvar::new(),
            closing: CancelSwitch::default(),
            health: Mutex::default(),
            surveyed: OnceLock::new(),
            begun: OnceLock::new(),
            samples_done: AtomicU64::new(0),
            dropped_count: AtomicU64::new(0),
            watcher: OnceLock::new(),
            fault_watcher: OnceLock::new(),
        });
        let mut sessions = vec![Some(session)];
        sessions.resize_with(lane_count, || None);
        let mut engine = Self { shared: Arc::clone(&shared), lanes: Vec::new() };
        for session in sessions {
            let mut lane = EngineProcess { shared: Arc::clone(&shared), session, is_warm: false };
            let thread = thread::Builder::new().name("engine".to_owned()).spawn(move || lane.run());
            engine.lanes.push(thread.map_err(|source| EngineFault::Start { program: "a thread".to_owned(), source })?);
        }
        Ok(engine)
    }

    /// Returns the number of samples taken so far, over all pixels.
    pub fn samples_done(&self) -> u64 {
        self.shared.samples_done.load(Ordering::Relaxed)
    }

    /// Returns the number of pixels so far with non-finite values, which count as black.
    pub fn dropped_count(&self) -> u64 {
        self.shared.dropped_count.load(Ordering::Relaxed)
    }

    /// Passes the running sums of each window to `watcher` when it is rendered, on a thread of the engine. Only the
    /// first call has an effect.
    pub fn watch(&self, watcher: impl Fn(&Tile) + Send + Sync + 'static) {
        let _ = self.shared.watcher.set(Box::new(watcher));
    }

    /// Passes the text of each failure to `watcher`, on a thread of the engine; cancellation is not a failure. Only the
    /// first call has an effect.
    pub fn watch_faults(&self, watcher: impl Fn(&str) + Send + Sync + 'static) {
        let _ = self.shared.fault_watcher.set(Box::new(watcher));
    }

    /// Returns [`EngineFault::Quarantined`], with the last failure, if this engine has failed three times in a row; `None`:
    /// it has not. Quarantines that earlier processes stored do not count.
    pub fn quarantine(&self) -> Option<EngineFault> {
        self.shared.quarantine()
    }

    /// Returns the number of processes that render in parallel.
    pub fn lanes(&self) -> usize {
        self.shared.lanes
    }

    /// Returns true if zones are profiled: always with a time limit, or else if samples add up and windows are cheap.
    fn is_profiled(&self) -> bool {
        let manifest = self.shared.located.manifest();
        self.shared.options.time.is_some() || manifest.adds_up() && manifest.cost.window_seconds < WINDOW_DEAR
    }

    /// Measures the cost of windows and samples.
    ///
    /// - `will_look`: a survey follows, which measures it if the engine itself reports the cost of windows.
    fn pace(&self, will_look: bool) -> Option<tiny::WindowCost> {
        let (sender, answer) = mpsc::channel();
        self.shared.submit(Work::Pace(will_look, sender));
        let pace = answer.recv().unwrap_or(Err(EngineFault::Cancelled));
        // A lasting failure will show again with the zones.
        pace.inspect_err(|fault| tracing::debug!(%fault, "the pace of the engine is not known")).ok().flatten()
    }
}

impl RenderEngine for ExternalEngine {
    fn describe(&self) -> EngineDescription {
        let manifest = self.shared.located.manifest();
        EngineDescription {
            name: manifest.name.clone(),
            // If only the scene knows its depth, a share of it cannot be computed.
            has_max_depth: manifest.tunables.max_depth.is_some() && self.shared.options.scene_depth.is_none(),
            has_light_samples: manifest.tunables.light_samples.is_some(),
            resumes_samples: manifest.adds_up(),
            is_profiled: self.is_profiled(),
            exact_by_pixel: manifest.determinism == Determinism::Frame,
        }
    }

    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError> {
        let survey_of_builtin = self.shared.options.surveyor.as_ref().and_then(|look| look(width, height));
        let options = &self.shared.options;
        // Measure while the session has the picture open, not the survey.
        let pace = options.bounds_zones.then(|| self.pace(survey_of_builtin.is_none())).flatten();
        let (mut survey, pace) = match survey_of_builtin {
            Some(survey) => (survey, pace),
            None => {
                let (sender, answer) = mpsc::channel();
                self.shared.submit(Work::Survey(width, height, pace, sender));
                let outcome = answer.recv().unwrap_or(Err(EngineFault::Cancelled));
                outcome.map_err(|fault| EngineError::Survey { engine: self.shared.name(), reason: fault.report() })?
            }
        };
        let windows = if self.is_profiled() { WINDOWS_OF_ZONE } else { 1.0 };
        tracing::debug!(?pace, "what windows cost");
        let bounding = pace.filter(|_| options.bounds_zones);
        survey.zones_max = bounding.map(|pace| pace.zones_max(options.samples, windows));
        let _ = self.shared.surveyed.set(survey.clone());
        Ok(survey)
    }

    fn start(&self, task: ZoneTask, done: ZoneCallback) {
        self.shared.begun.get_or_init(Instant::now);
        self.shared.submit(Work::Zone(task, done));
    }
}

impl Drop for ExternalEngine {
    fn drop(&mut self) {
        self.shared.closing.cancel();
        let waiting = {
            let mut queue = self.shared.queue();
            queue.closed = true;
            std::mem::take(&mut queue.work)
        };
        self.shared.woken.notify_all();
        for work in waiting {
            if let Work::Zone(task, done) = work {
                done(Ok(unpainted(task, &self.shared.options.layout)));
            }
        }
        for lane in self.lanes.drain(..).filter(|lane| lane.thread().id() != thread::current().id()) {
            // The thread has reported a panic itself.
            let _ = lane.join();
        }
    }
}

impl EngineState {
    fn name(&self) -> String {
        self.located.manifest().name.clone()
    }

    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn health(&self) -> MutexGuard<'_, Health> {
        self.health.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn submit(&self, work: Work) {
        self.queue().work.push_back(work);
        self.woken.notify_one();
    }

    fn next(&self) -> Option<Work> {
        let queue = self.queue();
        let idle = |queue: &mut Queue| queue.work.is_empty() && !queue.closed;
        self.woken.wait_while(queue, idle).unwrap_or_else(PoisonError::into_inner).work.pop_front()
    }

    /// Returns the rest of the picture's time in seconds.
    fn seconds_left(&self) -> Option<f64> {
        let spent = self.begun.get().map_or(Duration::ZERO, Instant::elapsed);
        self.options.time.map(|time| time.saturating_sub(spent).as_secs_f64())
    }

    fn quarantine(&self) -> Option<EngineFault> {
        let health = self.health();
        let is_out = health.failures >= FAILURES_MAX;
        is_out.then(|| EngineFault::Quarantined { failures: health.failures, last: health.last.clone(), name: None })
    }

    /// Records a success or failure.
    fn note(&self, outcome: Result<(), &EngineFault>) {
        match outcome {
            Ok(()) => *self.health() = Health::default(),
            Err(EngineFault::Cancelled | EngineFault::Quarantined { .. }) => {}
            Err(fault) => {
                let report = fault.report();
                if let Some(watcher) = self.fault_watcher.get() {
                    watcher(&report);
                }
                let mut health = self.health();
                health.failures += 1;
                health.last.clone_from(&report);
                // A refusal is due to the scene; other failures are due to the engine.
                let is_its_own = !matches!(fault, EngineFault::Refused { .. });
                if health.failures >= FAILURES_MAX && is_its_own {
                    quarantine::put(&self.located, health.failures, &report);
                }
            }
        }
    }

    /// Returns true if the survey shows light in the window.
    fn expects_light(&self, window: Rect) -> bool {
        let (Some(survey), Some((width, height))) = (self.surveyed.get(), self.options.request.size) else {
            return false;
        };
        let frame = Rect::of_size(width, height);
        let cell = |x: u32, y: u32| {
            let column = u64::from(x) * u64::from(survey.width) / u64::from(frame.width());
            let row = u64::from(y) * u64::from(survey.height) / u64::from(frame.height());
            survey.pixels.get((row * u64::from(survey.width) + column) as usize)
        };
        // Require light in most cells: those at the edge may hold the light of their neighbours.
        let mut cells = 0;
        let mut lit = 0;
        for (x, y) in window.pixels().step_by(7) {
            cells += 1;
            lit += u32::from(cell(x, y).is_some_and(|pixel| pixel.color.iter().any(|value| *value > BLACK)));
        }
        cells > 0 && lit * 2 > cells
    }
}

/// Returns the result of a task that was cancelled before it started.
fn unpainted(task: ZoneTask, layout: &Layout) -> Painted {
    let tile = task.tile.unwrap_or_else(|| Tile::new(task.rect, layout.clone()));
    Painted { tile, busy: Duration::ZERO, is_warm: false, parts: Vec::new(), complete: false }
}

/// A process of the engine, and the thread that drives it.
struct EngineProcess {
    shared: Arc<EngineState>,
    session: Option<Session>,
    /// True if the session has rendered a window: many engines build or compile with the first one what all of them need.
    is_warm: bool,
}

impl EngineProcess {
    fn run(&mut self) {
        while let Some(work) = self.shared.next() {
            match work {
                Work::Survey(width, height, pace, answer) => {
                    let mut survey = self.survey(width, height, pace);
                    self.settle(survey.as_ref().map(drop));
                    if survey.as_ref().is_err_and(EngineFault::ends_process) && !self.shared.closing.is_cancelled() {
                        // Retry once after a crash, as for zones.
                        survey = self.survey(width, height, pace);
                        self.settle(survey.as_ref().map(drop));
                    }
                    if survey.is_err() {
                        // It has the scene open in another size.
                        self.session = None;
                    }
                    // The receiver may be gone.
                    let _ = answer.send(survey);
                }
                Work::Pace(will_look, answer) => {
                    let pace = self.pace(will_look);
                    self.settle(pace.as_ref().map(drop));
                    let _ = answer.send(pace);
                }
                Work::Zone(task, done) => {
                    let (rect, engine) = (task.rect, self.shared.name());
                    let painted = self.zone(task);
                    self.settle(painted.as_ref().map(drop));
                    done(painted.map_err(|fault| EngineError::Zone { engine, rect, reason: fault.report() }));
                }
            }
        }
        if let Some(session) = self.session.take() {
            idle::keep(&self.shared.located, session);
        }
    }

    /// Records an outcome, and drops a session that must be restarted.
    fn settle(&mut self, outcome: Result<(), &EngineFault>) {
        if outcome.is_err_and(EngineFault::ends_process) {
            self.session = None;
        }
        self.shared.note(outcome);
    }

    fn session(&mut self) -> Result<&mut Session, EngineFault> {
        if let Some(fault) = self.shared.quarantine() {
            return Err(fault);
        }
        let session = match self.session.take() {
            Some(session) => session,
            None => {
                self.is_warm = false;
                Session::open(&self.shared.located, &self.request())?
            }
        };
        Ok(self.session.insert(session))
    }

    /// Returns the scene request for a process of this lane.
    fn request(&self) -> SceneRequest {
        let request = self.shared.options.request.clone();
        SceneRequest { threads: (request.threads / self.shared.lanes).max(1), ..request }
    }

    /// Returns a window request for a survey or measurement.
    fn look(&self, width: u32, height: u32, samples: u32) -> WindowRequest {
        let tunables = &self.shared.located.manifest().tunables;
        WindowRequest {
            window: Rect::of_size(width, height),
            samples: tunables.samples.map_or(samples, |range| range.fit(samples)),
            first_sample: 0,
            seed: (self.shared.options.seed & SEED_MASK) as u32,
            max_depth: None,
            light_samples: None,
            seconds: None,
            cancel: self.shared.closing.clone(),
        }
    }

    fn pace(&mut self, will_look: bool) -> Result<Option<tiny::WindowCost>, EngineFault> {
        let (width, height) = self.shared.options.request.size.unwrap_or((1, 1));
        let window = self.look(width, height, 1);
        let session = self.session()?;
        if will_look && session.opened().window_seconds().is_some() {
            return Ok(None);
        }
        tiny::WindowCost::measure(session, &window).map(Some)
    }

    fn survey(&mut self, width: u32, height: u32, pace: Option<tiny::WindowCost>) -> Result<Looked, EngineFault> {
        let (request, located) = (self.request(), Arc::clone(&self.shared.located));
        let window = self.look(width, height, tiny::SAMPLES);
        let samples = self.shared.options.samples;
        let session = self.session()?;
        session.reopen(&located, &SceneRequest { size: Some((width, height)), ..request.clone() })?;
        let looked = tiny::survey(session, &window, pace, samples)?;
        // Zones need the scene open in the picture's size.
        session.reopen(&located, &request)?;
        Ok(looked)
    }

    fn zone(&mut self, task: ZoneTask) -> Result<Painted, EngineFault> {
        let shared = Arc::clone(&self.shared);
        if task.cancel.is_cancelled() || shared.closing.is_cancelled() {
            return Ok(unpainted(task, &shared.options.layout));
        }
        // Continue the tile if passes add up, or else start again
        let adds_up = shared.located.manifest().adds_up();
        let kept = task.tile.filter(|_| adds_up);
        let first = if kept.is_some() { task.samples.start } else { 0 };
        let count = task.samples.end.saturating_sub(first).max(1);
        let area = task.rect.area();
        // Starting an engine and opening a scene do not count as rendering.
        self.session()?;
        let begun = Instant::now();
        // Render the window
        let request = self.window_request(task.rect, first, count, &task.tunables, task.cancel.clone());
        let mut reported = 0;
        let mut tell = |share: f64| {
            let done = (area as f64 * f64::from(count) * share.clamp(0.0, 1.0)) as u64;
            let new_samples = done.saturating_sub(reported);
            reported += new_samples;
            task.progress.add(new_samples);
            shared.samples_done.fetch_add(new_samples, Ordering::Relaxed);
        };
        let written = match self.session()?.paint(&request, &mut tell) {
            Err(EngineFault::Cancelled) => {
                // The process still works on the cancelled window.
                self.session = None;
                let tile = kept.unwrap_or_else(|| Tile::new(task.rect, shared.options.layout.clone()));
                let busy = self.busy(begun);
                return Ok(Painted { tile, busy, is_warm: false, parts: Vec::new(), complete: false });
            }
            written => written?,
        };
        // Read and validate the output
        let window = picture::read_wanted(&written, task.rect, &shared.wanted)?;
        if window.is_black() && shared.expects_light(task.rect) {
            return Err(EngineFault::Black { window: task.rect });
        }
        tell(1.0);
        shared.dropped_count.fetch_add(window.dropped as u64, Ordering::Relaxed);
        // Add the samples to the tile
        let mut tile = kept.unwrap_or_else(|| Tile::new(task.rect, shared.options.layout.clone()));
        // With a time limit it may have ended before its last sample.
        let taken = written.samples.filter(|taken| request.seconds.is_some() && *taken < request.samples);
        window.add_to(&mut tile, taken.map_or(count, |taken| taken.clamp(1, count)));
        if let Some(watcher) = shared.watcher.get() {
            watcher(&tile);
        }
        // A command line is started for each window: each costs as much as the first.
        let starts_again = shared.located.manifest().kind == EngineKind::Command;
        let is_warm = std::mem::replace(&mut self.is_warm, true) || starts_again;
        Ok(Painted { tile, busy: self.busy(begun), is_warm, parts: Vec::new(), complete: true })
    }

    /// Returns the time of all processors of this lane.
    fn busy(&self, begun: Instant) -> Duration {
        begun.elapsed() * self.request().threads as u32
    }

    fn window_request(
        &self,
        window: Rect,
        first_sample: u32,
        samples: u32,
        tunables: &crate::Tunables,
        cancel: CancelSwitch,
    ) -> WindowRequest {
        let options = &self.shared.options;
        let manifest = self.shared.located.manifest();
        let ranges = &manifest.tunables;
        let unless_of_scene = |value: u32, of_scene: Option<u32>| (of_scene != Some(value)).then_some(value);
        // Our depth 0 is emitted light; the protocol's is direct light.
        let bounces = unless_of_scene(tunables.max_depth, options.scene_depth).map(|depth| depth.saturating_sub(1));
        let fit = |range: Option<super::manifest::Range>, value: Option<u32>| Some(range?.fit(value?));
        // Whole seconds: a window without time left still renders something.
        let seconds = self.shared.seconds_left().map(|left| left.ceil() as u32);
        // Windows of the same size must have different noise, unless they are parts of one frame.
        let seed = match manifest.determinism {
            Determinism::Frame => options.seed,
            Determinism::Window | Determinism::Statistics => mixed(options.seed, window),
        };
        WindowRequest {
            window,
            samples: ranges.samples.map_or(samples, |range| range.fit(samples)),
            first_sample,
            seed: (seed & SEED_MASK) as u32,
            max_depth: fit(ranges.max_depth, bounces),
            light_samples: fit(
                ranges.light_samples,
                unless_of_scene(tunables.light_samples, options.scene_light_samples),
            ),
            seconds: fit(ranges.time, seconds.or(ranges.time.and_then(|range| range.default))),
            cancel,
        }
    }
}

/// Returns a seed for a window.
fn mixed(seed: u64, window: Rect) -> u64 {
    let mut state = seed;
    for word in [window.x0, window.y0, window.x1, window.y1] {
        state = SplitMix64::new(state.wrapping_add(u64::from(word))).bits();
    }
    state
}
