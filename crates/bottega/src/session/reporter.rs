//! The reporter, which turns messages of the farm and the engine into events.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, mpsc},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bottega_agents::{AgentId, Time};
use bottega_engines::Survey;
use bottega_farm::{AgentRow, FarmMessage, ImportanceMap, Observer, Partition, Progress, RoundSummary, Theft, ZoneRow};

use super::Watcher;
use crate::{
    devices::compiling,
    events::{self, AgentEvent, AuctionEvent, Event, RoundEvent, TheftEvent, Zone, ZoneEvent},
    preview::LivePreview,
};

/// Interval between progress events.
const TELL_EVERY: Duration = Duration::from_millis(500);

/// Period over which the speed is averaged.
const SPEED_OVER: Duration = Duration::from_secs(3);

/// Share of the cost from which the remaining time is estimated from this job alone; below it, estimates of earlier jobs are
/// mixed in.
const SHARE_SEEN: f64 = 0.1;

/// The reports of a session: sends events, progress and previews to a watcher.
pub struct Reporter {
    watcher: Arc<dyn Watcher>,
    pace: Mutex<WorkRate>,
    /// The rounds of the auction, in the order in which they ended.
    rounds: Mutex<Vec<RoundSummary>>,
    thefts: Mutex<Vec<Theft>>,
    watch: OnceLock<EngineWatch>,
    show: OnceLock<PreviewOutput>,
}

/// The preview and the thread that updates it.
struct PreviewOutput {
    show: Arc<LivePreview>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// The thread that polls the engine for progress.
struct EngineWatch {
    stop: mpsc::Sender<()>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// The state of the progress estimate. The farm reports after each zone; between reports the engine's sample count is used.
struct WorkRate {
    begun: Instant,
    /// The last report of the farm.
    said: Option<Progress>,
    /// The time of that report.
    said_at: Instant,
    /// Samples that were kept from an interrupted job, before the engine took any.
    kept: u64,
    /// The share of the predicted cost of those samples, 0 to 1.
    kept_cost: f64,
    /// Time and sample count of the last [`SPEED_OVER`] seconds, oldest first.
    marks: VecDeque<(Instant, u64)>,
}

impl Reporter {
    /// Makes a reporter that sends events to `watcher`.
    pub fn new(watcher: Arc<dyn Watcher>) -> Self {
        let now = Instant::now();
        let pace = Mutex::new(WorkRate {
            begun: now,
            said: None,
            said_at: now,
            kept: 0,
            kept_cost: 0.0,
            marks: VecDeque::new(),
        });
        Self {
            watcher,
            pace,
            rounds: Mutex::default(),
            thefts: Mutex::default(),
            watch: OnceLock::new(),
            show: OnceLock::new(),
        }
    }

    /// Returns the watcher that receives the events.
    pub fn watcher(&self) -> &Arc<dyn Watcher> {
        &self.watcher
    }

    /// Reports a message to the user, as [`Event::Note`].
    pub fn say(&self, message: &str) {
        self.tell(Event::Note { message: message.to_owned() });
    }

    /// Reports a warning to the user, as [`Event::Warning`].
    pub fn warn(&self, message: String) {
        self.tell(Event::Warning { message });
    }

    /// Sends an event to the watcher.
    pub fn tell(&self, event: Event) {
        self.watcher.event(event);
    }

    /// Starts progress events, from the farm's reports and the number of samples that the engine has taken.
    pub(crate) fn watch(self: &Arc<Self>, samples_done: impl Fn() -> u64 + Send + 'static) {
        let (stop, stopped) = mpsc::channel();
        let reporter = Arc::downgrade(self);
        let thread = thread::spawn(move || {
            while stopped.recv_timeout(TELL_EVERY) == Err(mpsc::RecvTimeoutError::Timeout) {
                let Some(reporter) = reporter.upgrade() else { return };
                reporter.tell_progress(samples_done());
                for (device, time) in compiling() {
                    reporter.tell(Event::Compiling { device, seconds: time.as_secs_f64() });
                }
            }
        });
        // The first call wins: `watch` is called once per job.
        let _ = self.watch.set(EngineWatch { stop, thread: Mutex::new(Some(thread)) });
    }

    /// Starts updating the preview `show`. Each preview event has the time since loading ended, `loaded`.
    pub(crate) fn show(self: &Arc<Self>, show: &Arc<LivePreview>, loaded: Instant) {
        let (reporter, showing) = (Arc::downgrade(self), Arc::clone(show));
        let thread = thread::spawn(move || {
            let renewed = |number| {
                let Some(reporter) = reporter.upgrade() else { return };
                reporter.tell(Event::Preview { number, seconds: loaded.elapsed().as_secs_f64() });
            };
            if let (Err(error), Some(reporter)) = (showing.keep_fresh(renewed), reporter.upgrade()) {
                reporter.warn(format!("cannot update the preview any more: {error}"));
            }
        });
        // The first call wins: `show` is called once per job.
        let _ = self.show.set(PreviewOutput { show: Arc::clone(show), thread: Mutex::new(Some(thread)) });
    }

    fn tell_progress(&self, samples_done: u64) {
        let Some((progress, samples_per_second)) = self.pace().present(samples_done) else { return };
        self.tell(Event::Progress(events::Progress {
            zones_done: progress.zones_done,
            zones: progress.zones,
            samples_done: progress.samples_done,
            samples: progress.samples,
            samples_per_second,
            share: progress.cost_done,
            seconds: progress.elapsed.as_secs_f64(),
            seconds_left: progress.left.map(|left| left.as_secs_f64()),
        }));
    }

    /// Stops progress events and completes the preview.
    pub(crate) fn finish(&self) {
        if let Some(watch) = self.watch.get() {
            // The thread may have ended already.
            let _ = watch.stop.send(());
            if let Some(thread) = watch.thread.lock().unwrap_or_else(PoisonError::into_inner).take() {
                let _ = thread.join();
            }
        }
        if let Some(PreviewOutput { show, thread }) = self.show.get() {
            show.end();
            if let Some(thread) = thread.lock().unwrap_or_else(PoisonError::into_inner).take() {
                let _ = thread.join();
            }
        }
        self.watcher.painted();
    }

    /// Reports the totals of the auction, if there was one.
    pub(crate) fn tell_auction(&self) {
        let rounds = self.rounds.lock().unwrap_or_else(PoisonError::into_inner);
        let thefts = self.thefts.lock().unwrap_or_else(PoisonError::into_inner);
        if !rounds.is_empty() || !thefts.is_empty() {
            self.tell(Event::Auction(AuctionEvent::of(&rounds, &thefts)));
        }
    }

    fn pace(&self) -> MutexGuard<'_, WorkRate> {
        self.pace.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl WorkRate {
    /// Returns the current progress, and the recent speed in samples per second. The farm reports when a zone is done; between
    /// reports the cost done is interpolated with the samples taken.
    fn present(&mut self, samples_done: u64) -> Option<(Progress, f64)> {
        let now = Instant::now();
        // Measure the speed over the last seconds
        self.marks.push_back((now, samples_done));
        while self.marks.len() > 2 && now - self.marks[0].0 > SPEED_OVER {
            self.marks.pop_front();
        }
        let (first, before) = self.marks[0];
        let seconds = (now - first).as_secs_f64();
        let speed = if seconds > 0.0 { samples_done.saturating_sub(before) as f64 / seconds } else { 0.0 };

        // Interpolate the cost done since the farm's last report
        let said = self.said.as_ref()?;
        let under_way = (self.kept + samples_done).saturating_sub(said.samples_done);
        let samples_left = said.samples.saturating_sub(said.samples_done).max(1);
        let share = (under_way as f64 / samples_left as f64).min(1.0);
        let cost_done = said.cost_done + (1.0 - said.cost_done) * share;
        // Extrapolate the remaining time from the cost done in this job
        let elapsed = self.begun.elapsed();
        let to_go = elapsed.as_secs_f64() * (1.0 - cost_done) / (cost_done - self.kept_cost);
        let to_go = Some(to_go).filter(|_| cost_done > self.kept_cost);
        // Early in the job, mix in the farm's estimate from earlier jobs
        let known = said.left.map(|left| left.saturating_sub(self.said_at.elapsed()).as_secs_f64());
        let weight = ((cost_done - self.kept_cost) / SHARE_SEEN).clamp(0.0, 1.0);
        let to_go = match (to_go, known) {
            (Some(to_go), Some(known)) => Some(weight * to_go + (1.0 - weight) * known),
            (to_go, known) => to_go.or(known),
        };
        let progress = Progress {
            samples_done: (said.samples_done + under_way).min(said.samples),
            cost_done,
            elapsed,
            left: to_go.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()),
            ..*said
        };
        Some((progress, speed))
    }
}

impl Observer for Reporter {
    fn surveyed(&self, survey: &Arc<Survey>) {
        if let Some(showing) = self.show.get() {
            showing.show.begin(survey);
        }
    }

    fn analyzed(&self, map: &Arc<ImportanceMap>, partition: &Arc<Partition>) {
        let zones = partition.iter().map(|(id, rect)| Zone::new(id.0, &rect, map.complexity_density(&rect))).collect();
        let seconds = self.pace().begun.elapsed().as_secs_f64();
        self.tell(Event::Analyzed { zones, seconds });
    }

    fn zone_changed(&self, row: &ZoneRow) {
        self.tell(Event::Zone(Box::new(ZoneEvent::from(row))));
    }

    fn agent_changed(&self, row: &AgentRow) {
        let seconds = self.pace().begun.elapsed().as_secs_f64();
        self.tell(Event::Agent(AgentEvent::new(row, Some(seconds))));
    }

    fn round_closed(&self, round: &RoundSummary) {
        self.rounds.lock().unwrap_or_else(PoisonError::into_inner).push(*round);
        let seconds = self.pace().begun.elapsed().as_secs_f64();
        self.tell(Event::Round(RoundEvent::new(round, seconds)));
    }

    fn stolen(&self, theft: &Theft) {
        self.thefts.lock().unwrap_or_else(PoisonError::into_inner).push(theft.clone());
        let seconds = self.pace().begun.elapsed().as_secs_f64();
        let (from, to) = (theft.from.to_string(), theft.to.to_string());
        self.tell(Event::Theft(TheftEvent { seconds, from, to, zones: theft.zones }));
    }

    fn progress(&self, progress: &Progress) {
        let mut pace = self.pace();
        if pace.said.is_none() {
            pace.begun = Instant::now();
            pace.kept = progress.samples_done;
            pace.kept_cost = progress.cost_done;
        }
        (pace.said, pace.said_at) = (Some(*progress), Instant::now());
    }

    fn message(&self, now: Time, message: &FarmMessage) {
        self.watcher.message(now, message);
    }

    fn left_out(&self, agent: &AgentId, reason: &str) {
        self.warn(format!("{agent} is left out: {reason}"));
    }

    fn too_few(&self, present: usize, needed: usize) {
        self.warn(format!(
            "cannot compare the results of machines: {present} of {needed} machines are present; zones wait for `bottega join`"
        ));
    }

    fn store_failed(&self, error: &std::io::Error) {
        self.warn(format!("cannot store the work for --resume: {error}"));
    }
}
