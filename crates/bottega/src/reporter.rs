//! What is told while the work goes on: a progress bar, JSON lines, the dashboard, the trace of messages.

use std::{
    collections::VecDeque,
    fs::File,
    io::{BufWriter, Write},
    path::Path,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, mpsc},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bottega_agents::{AgentId, Time};
use bottega_engines::Survey;
use bottega_farm::{FarmMessage, ImportanceMap, Observer, Partition, Progress, ZoneRow, ZoneState};
use bottega_web::{
    Dashboard,
    wire::{self, Event},
};
use indicatif::{ProgressBar, ProgressStyle};

use crate::{error::CliError, farm::bytes_said, preview::Show};

/// How often progress is told.
const TELL_EVERY: Duration = Duration::from_millis(500);

/// The speed shown is that of the last so many seconds.
const SPEED_OVER: Duration = Duration::from_secs(3);

/// Steps of the progress bar.
const BAR_STEPS: u64 = 1000;

/// In which form people or programs are told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Voice {
    /// A progress bar on standard error.
    Bar,
    /// One JSON object a line on standard output.
    Json,
    /// Errors only.
    Quiet,
}

/// Tells everybody who wants to know.
pub(crate) struct Reporter {
    voice: Voice,
    bar: ProgressBar,
    dashboard: Option<Dashboard>,
    trace: Option<Mutex<BufWriter<File>>>,
    pace: Mutex<Pace>,
    watch: OnceLock<Watch>,
    show: OnceLock<Showing>,
}

/// Shows the picture while it is painted.
struct Showing {
    show: Arc<Show>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// Looks at the engine while zones are under way.
struct Watch {
    stop: mpsc::Sender<()>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// How the work goes on: the farm speaks when a zone is done, the engine is looked at in between.
struct Pace {
    begun: Instant,
    /// The farm's last word.
    said: Option<Progress>,
    /// Samples that were there before the engine took any.
    kept: u64,
    /// Their share of the predicted cost.
    kept_cost: f64,
    /// Samples at some moments of the last seconds, oldest first.
    marks: VecDeque<(Instant, u64)>,
}

impl Reporter {
    pub(crate) fn new(voice: Voice, dashboard: Option<Dashboard>, trace: Option<&Path>) -> Result<Self, CliError> {
        let bar = if voice == Voice::Bar { ProgressBar::new(BAR_STEPS) } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("{bar:40.cyan/dim} {percent:>3}% {msg}") {
            bar.set_style(style);
        }
        let trace = trace
            .map(|path| {
                let file = File::create(path).map_err(|source| CliError::Write { path: path.to_owned(), source })?;
                Ok::<_, CliError>(Mutex::new(BufWriter::new(file)))
            })
            .transpose()?;
        let pace =
            Mutex::new(Pace { begun: Instant::now(), said: None, kept: 0, kept_cost: 0.0, marks: VecDeque::new() });
        Ok(Self { voice, bar, dashboard, trace, pace, watch: OnceLock::new(), show: OnceLock::new() })
    }

    /// Says something to people only.
    pub(crate) fn say(&self, text: &str) {
        if self.voice == Voice::Bar {
            self.bar.suspend(|| eprintln!("{text}"));
        }
    }

    pub(crate) fn warn(&self, message: String) {
        self.say(&format!("warning: {message}"));
        self.tell(Event::Warning { message });
    }

    /// Tells programs.
    pub(crate) fn tell(&self, event: Event) {
        if self.voice == Voice::Json {
            println!("{}", event.to_json());
        }
        if let Some(dashboard) = &self.dashboard {
            dashboard.publish(event);
        }
    }

    /// From now on tells progress, by the farm's words and the samples that the engine has taken.
    pub(crate) fn watch(self: &Arc<Self>, samples_done: impl Fn() -> u64 + Send + 'static) {
        let (stop, stopped) = mpsc::channel();
        let reporter = Arc::downgrade(self);
        let thread = thread::spawn(move || {
            while stopped.recv_timeout(TELL_EVERY) == Err(mpsc::RecvTimeoutError::Timeout) {
                let Some(reporter) = reporter.upgrade() else { return };
                reporter.tell_progress(samples_done());
            }
        });
        // A second watch would tell everything twice; there is none.
        let _ = self.watch.set(Watch { stop, thread: Mutex::new(Some(thread)) });
    }

    /// From now on keeps `show` fresh, and tells how long after the end of loading, `loaded`, it was.
    pub(crate) fn show(self: &Arc<Self>, show: &Arc<Show>, loaded: Instant) {
        let (reporter, showing) = (Arc::downgrade(self), Arc::clone(show));
        let thread = thread::spawn(move || {
            let renewed = |number| {
                let Some(reporter) = reporter.upgrade() else { return };
                let since = loaded.elapsed();
                if number == 1 {
                    reporter.say(&format!("first preview {} after loading", duration(since)));
                }
                reporter.tell(Event::Preview { number, seconds: since.as_secs_f64() });
            };
            if let (Err(error), Some(reporter)) = (showing.keep_fresh(renewed), reporter.upgrade()) {
                reporter.warn(format!("the preview is not shown any more: {error}"));
            }
        });
        // As above.
        let _ = self.show.set(Showing { show: Arc::clone(show), thread: Mutex::new(Some(thread)) });
    }

    fn tell_progress(&self, samples_done: u64) {
        let Some((progress, samples_per_second)) = self.pace().present(samples_done) else { return };
        let left = progress.left.map_or("–".to_owned(), duration);
        self.bar.set_position((progress.cost_done * BAR_STEPS as f64) as u64);
        self.bar.set_message(format!(
            "zone {} of {}, {:.2} M samples/s, {} so far, {left} left",
            progress.zones_done,
            progress.zones,
            samples_per_second / 1e6,
            duration(progress.elapsed),
        ));
        self.tell(Event::Progress(wire::Progress {
            zones_done: progress.zones_done,
            zones: progress.zones,
            samples_done: progress.samples_done,
            samples: progress.samples,
            samples_per_second,
            seconds: progress.elapsed.as_secs_f64(),
            seconds_left: progress.left.map(|left| left.as_secs_f64()),
        }));
    }

    /// Tells how much of a scene is sent to a farm.
    ///
    /// - `is_due`: say it, too, where no progress bar is seen.
    pub(crate) fn tell_sent(&self, sent: u64, bytes: u64, since: Duration, is_due: bool) {
        let (share, seconds) = (sent as f64 / bytes.max(1) as f64, since.as_secs_f64());
        let left = Duration::try_from_secs_f64(seconds * (1.0 - share) / share).ok();
        let text = format!(
            "sending the scene: {} of {}, {:.0} %, {} left",
            bytes_said(sent),
            bytes_said(bytes),
            100.0 * share,
            left.map_or("–".to_owned(), duration)
        );
        if self.bar.is_finished() {
            self.bar.reset();
        }
        self.bar.set_position((share * BAR_STEPS as f64) as u64);
        if self.bar.is_hidden() && is_due {
            self.say(&text);
        }
        self.bar.set_message(text);
        let seconds_left = left.map(|left| left.as_secs_f64());
        self.tell(Event::Sending { bytes_sent: sent, bytes, seconds, seconds_left });
    }

    /// Tells how far a step is that comes after the painting.
    pub(crate) fn tell_step(&self, name: &'static str, share: f64) {
        if self.bar.is_finished() {
            self.bar.reset();
        }
        self.bar.set_position((share * BAR_STEPS as f64) as u64);
        self.bar.set_message(name);
    }

    /// The step is done.
    pub(crate) fn end_step(&self) {
        self.bar.finish_and_clear();
    }

    /// No progress is shown from now on; the preview is what was painted last.
    pub(crate) fn finish(&self) {
        if let Some(watch) = self.watch.get() {
            // When it is gone already there is nobody to tell.
            let _ = watch.stop.send(());
            if let Some(thread) = watch.thread.lock().unwrap_or_else(PoisonError::into_inner).take() {
                let _ = thread.join();
            }
        }
        if let Some(Showing { show, thread }) = self.show.get() {
            show.end();
            if let Some(thread) = thread.lock().unwrap_or_else(PoisonError::into_inner).take() {
                let _ = thread.join();
            }
        }
        self.bar.finish_and_clear();
        if let Some(trace) = &self.trace {
            // A trace that cannot be completed is no reason to lose a picture.
            let _ = trace.lock().unwrap_or_else(PoisonError::into_inner).flush();
        }
    }

    fn pace(&self) -> MutexGuard<'_, Pace> {
        self.pace.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Pace {
    /// How far the work is now, and how many samples a second it has taken lately. The farm speaks when a zone is done;
    /// in between, what is left shrinks with the samples taken.
    fn present(&mut self, samples_done: u64) -> Option<(Progress, f64)> {
        let now = Instant::now();
        self.marks.push_back((now, samples_done));
        while self.marks.len() > 2 && now - self.marks[0].0 > SPEED_OVER {
            self.marks.pop_front();
        }
        let (first, before) = self.marks[0];
        let seconds = (now - first).as_secs_f64();
        let speed = if seconds > 0.0 { samples_done.saturating_sub(before) as f64 / seconds } else { 0.0 };

        let said = self.said.as_ref()?;
        let under_way = (self.kept + samples_done).saturating_sub(said.samples_done);
        let left = said.samples.saturating_sub(said.samples_done).max(1);
        let share = (under_way as f64 / left as f64).min(1.0);
        let cost_done = said.cost_done + (1.0 - said.cost_done) * share;
        let elapsed = self.begun.elapsed();
        let to_go = elapsed.as_secs_f64() * (1.0 - cost_done) / (cost_done - self.kept_cost);
        let progress = Progress {
            samples_done: (said.samples_done + under_way).min(said.samples),
            cost_done,
            elapsed,
            left: Duration::try_from_secs_f64(to_go).ok().filter(|_| cost_done > self.kept_cost),
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
        let zones = partition.iter().map(|(id, rect)| zone(id.0, rect, map.complexity_density(&rect))).collect();
        let seconds = self.pace().begun.elapsed().as_secs_f64();
        self.tell(Event::Analyzed { zones, seconds });
    }

    fn zone_changed(&self, row: &ZoneRow) {
        self.tell(Event::Zone {
            id: row.zone.0,
            state: state_name(row.state).to_owned(),
            agent: row.agent.as_ref().map(ToString::to_string),
            seconds_estimated: row.time_estimated.map(|time| time.as_secs_f64()),
            seconds_measured: row.time_measured.map(|time| time.as_secs_f64()),
            samples: row.samples_done(),
            error: row.error,
        });
    }

    fn progress(&self, progress: &Progress) {
        let mut pace = self.pace();
        if pace.said.is_none() {
            pace.begun = Instant::now();
            pace.kept = progress.samples_done;
            pace.kept_cost = progress.cost_done;
        }
        pace.said = Some(*progress);
    }

    fn message(&self, now: Time, message: &FarmMessage) {
        let Some(trace) = &self.trace else { return };
        let mut trace = trace.lock().unwrap_or_else(PoisonError::into_inner);
        let receivers: Vec<String> = message.receivers.iter().map(ToString::to_string).collect();
        // As above: the picture comes first.
        let _ = writeln!(
            trace,
            "{:10.6} {} -> {} {:?} {} #{} {:?}",
            now.elapsed().as_secs_f64(),
            message.sender,
            receivers.join(","),
            message.performative,
            message.protocol,
            message.conversation_id,
            message.content,
        );
    }

    fn left_out(&self, agent: &AgentId, reason: &str) {
        self.warn(format!("{agent} is left out: {reason}"));
    }

    fn too_few(&self, present: usize, needed: usize) {
        self.warn(format!(
            "what machines paint cannot be compared: {present} are there, {needed} are needed; zones wait for `bottega join`"
        ));
    }

    fn not_kept(&self, error: &std::io::Error) {
        self.warn(format!("the work cannot be kept for --resume: {error}"));
    }
}

/// A zone for programs.
pub(crate) fn zone(id: u32, rect: bottega_image::Rect, complexity_density: f64) -> wire::Zone {
    wire::Zone { id, rect: [rect.x0, rect.y0, rect.x1, rect.y1], complexity_density }
}

fn state_name(state: ZoneState) -> &'static str {
    match state {
        ZoneState::Open => "open",
        ZoneState::Profiling => "profiling",
        ZoneState::Profiled => "profiled",
        ZoneState::Awarded => "awarded",
        ZoneState::Done => "done",
        ZoneState::Failed => "failed",
    }
}

/// A length of time as people say it.
pub(crate) fn duration(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    match seconds {
        ..10.0 => format!("{seconds:.1} s"),
        ..90.0 => format!("{seconds:.0} s"),
        ..5400.0 => format!("{}:{:02} min", time.as_secs() / 60, time.as_secs() % 60),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}
