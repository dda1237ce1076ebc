//! A watcher of this process's job: it forwards events, and notifies subscribers of the end or a stall.

use std::{
    collections::BTreeMap,
    process::ExitCode,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bottega::{Event, Watcher};
use bottega_agents::Time;
use bottega_cluster::{JobBoard, names::host_name, unix_seconds, view::JobView};
use bottega_farm::FarmMessage;

use super::{
    args::NotificationArgs,
    farm_watch::{FarmWatch, StallClock, facts, stall_reason},
    message::{JobFacts, Notification},
    notifier::Notifier,
    target::WorkEvent,
};
use crate::error::CliError;

/// The interval at which stalls are checked.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// A watcher that also sends notifications.
pub(crate) struct PictureWatch {
    inner: Arc<dyn Watcher>,
    /// The farm that paints the job, if any.
    board: Option<JobBoard>,
    begun: Instant,
    state: Arc<Mutex<PaintingState>>,
    notifier: Arc<Notifier>,
    is_over: Arc<AtomicBool>,
    ticker: Option<JoinHandle<()>>,
}

/// The state known from events.
#[derive(Default)]
struct PaintingState {
    facts: JobFacts,
    /// The zones seen in events; `true`: done.
    zones: BTreeMap<u32, bool>,
    /// The stall clock; `None` before painting starts.
    clock: Option<StallClock>,
}

impl PaintingState {
    fn take(&mut self, event: &Event) {
        match event {
            Event::Submitted { job, last_job } => (self.facts.job, self.facts.last_job) = (Some(*job), *last_job),
            Event::Started { scene, output, .. } => {
                (self.facts.scene, self.facts.output) = (scene.clone(), output.clone());
                self.zones.clear();
                (self.facts.zones_done, self.facts.zones) = (0, 0);
                self.clock = Some(StallClock::new(Instant::now()));
            }
            Event::Analyzed { zones, .. } => {
                zones.iter().for_each(|zone| self.take_zone(zone.id, false));
            }
            Event::Zone(zone) => self.take_zone(zone.id, zone.state == "done"),
            // The steps after painting have no zones.
            Event::Step { .. } | Event::Finished { .. } | Event::Interrupted { .. } => self.clock = None,
            _ => {}
        }
    }

    fn take_zone(&mut self, id: u32, is_done: bool) {
        let was_done = self.zones.insert(id, is_done).unwrap_or(false);
        self.facts.zones = self.zones.len();
        self.facts.zones_done = self.facts.zones_done + usize::from(is_done) - usize::from(was_done);
    }
}

impl PictureWatch {
    /// Starts to watch a picture.
    ///
    /// - `inner`: the watcher that gets the events.
    /// - `board`: the farm that paints the job, if any.
    /// - `names`: scene and output file, as the user named them.
    pub(crate) fn start(
        args: &NotificationArgs,
        inner: Arc<dyn Watcher>,
        board: Option<JobBoard>,
        names: [String; 2],
    ) -> Result<Self, CliError> {
        let loss = Arc::clone(&inner);
        let tell_loss = Arc::new(move |message: String| loss.event(Event::Warning { message }));
        let notifier = Arc::new(Notifier::start(args.subscriptions(), args.secret()?, tell_loss)?);
        let [scene, output] = names;
        let facts = JobFacts { scene, output, from: host_name(), ..JobFacts::default() };
        let state = Arc::new(Mutex::new(PaintingState { facts, ..PaintingState::default() }));
        let is_over = Arc::new(AtomicBool::new(false));
        let ticker = StallTicker {
            begun: Instant::now(),
            after: args.stalled_after(),
            watch: board.clone().map(|board| (board, FarmWatch::new(args.stalled_after()))),
            state: Arc::clone(&state),
            notifier: Arc::clone(&notifier),
            is_over: Arc::clone(&is_over),
        };
        let begun = ticker.begun;
        let ticker = thread::Builder::new().name("stall-watch".to_owned()).spawn(move || ticker.run());
        let ticker = ticker.map_err(|error| {
            CliError::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once")
        })?;
        Ok(Self { inner, board, begun, state, notifier, is_over, ticker: Some(ticker) })
    }

    /// Notifies subscribers of the end, except for a stop by the user or a usage error.
    pub(crate) fn end(&self, result: &Result<ExitCode, CliError>) {
        let (event, reason) = match result {
            Ok(code) if *code == ExitCode::SUCCESS => (WorkEvent::Done, None),
            Err(error) if !error.is_usage() => (WorkEvent::Failed, Some(bottega::error::error_chain(error))),
            _ => return,
        };
        let known = lock(&self.state).facts.clone();
        // Another machine may have finished the job, and divided its zones.
        let zones = self.board.as_ref().and_then(|board| farm_zones(board, &known));
        let (zones_done, zones) = zones.unwrap_or((known.zones_done, known.zones));
        let facts = JobFacts { reason, seconds: self.begun.elapsed().as_secs_f64(), zones_done, zones, ..known };
        self.notifier.send(Notification::new(event, facts, unix_seconds()));
    }
}

impl Drop for PictureWatch {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(ticker) = self.ticker.take() {
            // The thread has already reported its panic.
            _ = ticker.join();
        }
    }
}

impl Watcher for PictureWatch {
    fn event(&self, event: Event) {
        lock(&self.state).take(&event);
        self.inner.event(event);
    }

    fn message(&self, now: Time, message: &FarmMessage) {
        self.inner.message(now, message);
    }

    fn previewed(&self, png: Vec<u8>) {
        self.inner.previewed(png);
    }

    fn painted(&self) {
        lock(&self.state).clock = None;
        self.inner.painted();
    }
}

fn lock(state: &Mutex<PaintingState>) -> MutexGuard<'_, PaintingState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the finished and total zones of this process's jobs in the farm; `None`: unknown.
fn farm_zones(board: &JobBoard, facts: &JobFacts) -> Option<(usize, usize)> {
    let first = facts.job?;
    let numbers = first..=facts.last_job.unwrap_or(first);
    if !board.uplink.is_connected() {
        return None;
    }
    let jobs = JobView::all(board).into_iter().filter(|job| numbers.contains(&job.number));
    let sum = jobs.fold((0, 0), |(done, all), job| (done + job.zones_done, all + job.zones));
    (sum.1 > 0).then_some(sum)
}

/// A periodic check for stalls.
struct StallTicker {
    begun: Instant,
    after: Duration,
    /// With a farm, its state is used, which includes the work of other machines.
    watch: Option<(JobBoard, FarmWatch)>,
    state: Arc<Mutex<PaintingState>>,
    notifier: Arc<Notifier>,
    is_over: Arc<AtomicBool>,
}

impl StallTicker {
    fn run(mut self) {
        while !self.is_over.load(Ordering::Relaxed) {
            for facts in self.stalled() {
                self.notifier.send(Notification::new(WorkEvent::Stalled, facts, unix_seconds()));
            }
            thread::sleep(LOOK_EVERY);
        }
    }

    fn stalled(&mut self) -> Vec<JobFacts> {
        let mut state = lock(&self.state);
        let now = Instant::now();
        let Some((board, watch)) = &mut self.watch else {
            let PaintingState { facts, clock, .. } = &mut *state;
            let is_stalled = clock.as_mut().is_some_and(|clock| clock.look(now, facts.zones_done, self.after));
            let (seconds, reason) = (self.begun.elapsed().as_secs_f64(), Some(stall_reason(self.after, 1)));
            return is_stalled.then(|| JobFacts { seconds, reason, ..facts.clone() }).into_iter().collect();
        };
        let Some(first) = state.facts.job else { return Vec::new() };
        let numbers = first..=state.facts.last_job.unwrap_or(first);
        drop(state);
        if !board.uplink.is_connected() {
            return Vec::new();
        }
        let jobs: Vec<JobView> = JobView::all(board).into_iter().filter(|job| numbers.contains(&job.number)).collect();
        let events = watch.look(now, &jobs);
        let stalled = events.iter().filter(|(event, _)| *event == WorkEvent::Stalled);
        let of = |number: u32| jobs.iter().find(|job| job.number == number);
        stalled
            .filter_map(|(_, number)| of(*number))
            .map(|job| facts(job, Some(stall_reason(self.after, job.machines))))
            .collect()
    }
}
