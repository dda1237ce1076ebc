//! What is told while the work goes on: a progress bar, JSON lines, the dashboard, the trace of messages.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::Path,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use bottega_agents::Time;
use bottega_farm::{FarmMessage, ImportanceMap, Observer, Partition, Progress, ZoneRow, ZoneState};
use bottega_web::{
    Dashboard,
    wire::{self, Event},
};
use indicatif::{ProgressBar, ProgressStyle};

use crate::error::CliError;

/// Progress is told at most so often, so that a script's log stays readable.
const PROGRESS_EVERY: Duration = Duration::from_millis(500);

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
}

struct Pace {
    begun: Instant,
    told: Option<Instant>,
    /// Samples at a moment some seconds ago, for the present speed.
    mark: (Instant, u64),
    samples_per_second: f64,
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
        let now = Instant::now();
        let pace = Mutex::new(Pace { begun: now, told: None, mark: (now, 0), samples_per_second: 0.0 });
        Ok(Self { voice, bar, dashboard, trace, pace })
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

    /// No progress is shown from now on.
    pub(crate) fn finish(&self) {
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
    /// Whether it is time to tell progress again; takes the present speed.
    fn is_due(&mut self, samples_done: u64, is_last: bool) -> bool {
        let now = Instant::now();
        let since_mark = (now - self.mark.0).as_secs_f64();
        if since_mark > 2.0 || self.samples_per_second == 0.0 && since_mark > 0.2 {
            self.samples_per_second = samples_done.saturating_sub(self.mark.1) as f64 / since_mark;
            self.mark = (now, samples_done);
        }
        let is_due = is_last || self.told.is_none_or(|told| now - told >= PROGRESS_EVERY);
        if is_due {
            self.told = Some(now);
        }
        is_due
    }
}

impl Observer for Reporter {
    fn analyzed(&self, map: &Arc<ImportanceMap>, partition: &Arc<Partition>) {
        let zones = partition.iter().map(|(id, rect)| zone(id.0, rect, map.density(&rect))).collect();
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
        });
    }

    fn progress(&self, progress: &Progress) {
        let is_last = progress.zones > 0 && progress.zones_done == progress.zones;
        let mut pace = self.pace();
        if !pace.is_due(progress.samples_done, is_last) {
            return;
        }
        let samples_per_second = pace.samples_per_second;
        drop(pace);
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

    fn not_kept(&self, error: &std::io::Error) {
        self.warn(format!("the work cannot be kept for --resume: {error}"));
    }
}

/// A zone for programs.
pub(crate) fn zone(id: u32, rect: bottega_image::Rect, complexity: f64) -> wire::Zone {
    wire::Zone { id, rect: [rect.x0, rect.y0, rect.x1, rect.y1], complexity }
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
