//! The console's watcher of a render: a progress bar, lines of text or JSON, the dashboard, the trace of messages.

use std::{
    fs::File,
    io::{LineWriter, Write},
    path::Path,
    sync::{Mutex, OnceLock, PoisonError},
    time::{Duration, Instant},
};

use bottega::{
    Watcher,
    events::{AuctionEvent, CableTraffic, Event, ForecastEvent, LightingAgents, Progress, ResourceUse},
    text::duration,
};
use bottega_agents::Time;
use bottega_cluster::{
    messages::{MessageEvent, content_text},
    room::bytes_said,
};
use bottega_farm::FarmMessage;
use bottega_image::printable;
use bottega_web::Dashboard;
use indicatif::{ProgressBar, ProgressStyle};

use crate::{error::CliError, signals::say_if_ended_at_once};

/// The number of steps of the progress bar.
const BAR_STEPS: u64 = 1000;
/// The interval between progress messages where there is no progress bar.
const SAY_EVERY: Duration = Duration::from_secs(5);

/// The form of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OutputForm {
    /// A progress bar and lines of text on standard error: the scene, warnings, the file and the time that it took.
    Text,
    /// Like `Text`, with details of the distribution of work: first preview, auction, expected times, processors and devices.
    Verbose,
    /// One JSON object per line on standard output.
    Json,
    /// Print errors only.
    Quiet,
}

impl OutputForm {
    /// Returns true if the output is for people.
    fn is_text(self) -> bool {
        matches!(self, Self::Text | Self::Verbose)
    }
}

/// A watcher that prints events, and passes them to the dashboard and the trace.
pub(crate) struct ConsoleWatcher {
    form: OutputForm,
    bar: ProgressBar,
    dashboard: Option<Dashboard>,
    trace: Option<Mutex<LineWriter<File>>>,
    /// The reason why the trace is incomplete, if it is.
    trace_lost: OnceLock<String>,
    /// True if the process does not wait for the farm's result.
    is_detached: bool,
    said: Mutex<Option<Instant>>,
}

impl ConsoleWatcher {
    /// Makes a watcher that prints to this terminal.
    ///
    /// - `trace`: a file for every message between the agents.
    /// - `is_detached`: `true` if the process does not wait for the farm's result.
    pub(crate) fn new(
        form: OutputForm,
        dashboard: Option<Dashboard>,
        trace: Option<&Path>,
        is_detached: bool,
    ) -> Result<Self, CliError> {
        let bar = if form.is_text() { ProgressBar::new(BAR_STEPS) } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("{bar:40.cyan/dim} {percent:>3}% {msg}") {
            bar.set_style(style);
        }
        let trace = trace
            .map(|path| File::create(path).map_err(|source| CliError::write(path.to_owned(), source)))
            .transpose()?
            .map(|file| Mutex::new(LineWriter::new(file)));
        let voice =
            Self { form, bar, dashboard, trace, trace_lost: OnceLock::new(), is_detached, said: Mutex::new(None) };
        if let Some(dashboard) = &voice.dashboard {
            voice.say(&format!("live view: {}", dashboard.url()));
        }
        Ok(voice)
    }

    /// Prints a line for people, unless the output is JSON or quiet.
    fn say(&self, text: &str) {
        if self.form.is_text() {
            self.bar.suspend(|| eprintln!("{text}"));
        }
    }

    /// Prints or shows an event.
    fn show(&self, event: &Event) {
        match event {
            Event::Progress(progress) => self.show_progress(progress),
            Event::Sending { bytes_sent, bytes, seconds_left, .. } => {
                self.show_sending(*bytes_sent, *bytes, *seconds_left);
            }
            Event::Step { name, share } => self.show_share(*share, name),
            Event::Compiling { device, seconds } => self.show_compiling(device, *seconds),
            _ => {
                if matches!(event, Event::Submitted { .. } | Event::Denoised { .. }) {
                    self.bar.finish_and_clear();
                }
                lines(event, self.is_detached).iter().for_each(|line| self.say(line));
                if self.form == OutputForm::Verbose {
                    details(event).iter().for_each(|line| self.say(line));
                }
            }
        }
    }

    fn show_share(&self, share: f64, message: &str) {
        if self.bar.is_finished() {
            self.bar.reset();
        }
        self.bar.set_position((share * BAR_STEPS as f64) as u64);
        self.bar.set_message(printable(message).into_owned());
    }

    fn show_progress(&self, progress: &Progress) {
        let message = format!(
            "zone {} of {}, {:.2} M samples/s, {} so far, {} left",
            progress.zones_done,
            progress.zones,
            progress.samples_per_second / 1e6,
            length(progress.seconds),
            progress.seconds_left.map_or("–".to_owned(), length),
        );
        self.show_share(progress.share, &message);
    }

    /// Shows that a device is still compiling, next to the progress of other devices.
    fn show_compiling(&self, device: &str, seconds: f64) {
        let text = format!("{device} compiles its kernels for this scene, {} so far", length(seconds));
        self.say_now_and_then(&text);
        if self.bar.position() == 0 {
            self.show_share(0.0, &text);
        }
    }

    /// Prints a message at most every few seconds, where there is no progress bar.
    fn say_now_and_then(&self, text: &str) {
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        if self.bar.is_hidden() && said.is_none_or(|said| said.elapsed() > SAY_EVERY) {
            *said = Some(Instant::now());
            self.say(text);
        }
    }

    fn show_sending(&self, sent: u64, bytes: u64, seconds_left: Option<f64>) {
        let share = sent as f64 / bytes.max(1) as f64;
        let text = format!(
            "sending the scene: {} of {}, {:.0} %, {} left",
            bytes_said(sent),
            bytes_said(bytes),
            100.0 * share,
            seconds_left.map_or("–".to_owned(), length)
        );
        self.say_now_and_then(&text);
        self.show_share(share, &text);
    }
}

impl Watcher for ConsoleWatcher {
    fn event(&self, event: Event) {
        match self.form {
            OutputForm::Text | OutputForm::Verbose => self.show(&event),
            OutputForm::Json => println!("{}", event.to_json()),
            OutputForm::Quiet => {}
        }
        if let Event::Submitted { job, last_job } = &event {
            say_if_ended_at_once(Some(parting(*job, *last_job)));
        }
        if let Some(dashboard) = &self.dashboard {
            dashboard.publish(&event);
        }
    }

    fn message(&self, now: Time, message: &FarmMessage) {
        if let Some(dashboard) = &self.dashboard {
            dashboard.show_message(MessageEvent::new(now, message));
        }
        let Some(trace) = &self.trace else { return };
        let mut trace = trace.lock().unwrap_or_else(PoisonError::into_inner);
        let receivers: Vec<String> = message.receivers.iter().map(ToString::to_string).collect();
        // A trace that cannot be written must not stop the render.
        let written = writeln!(
            trace,
            "{:10.6} {} -> {} {:?} {} #{} {:?}",
            now.elapsed().as_secs_f64(),
            message.sender,
            receivers.join(","),
            message.performative,
            message.protocol,
            message.conversation_id,
            content_text(message),
        );
        if let Err(error) = written {
            self.trace_lost.get_or_init(|| error.to_string());
        }
    }

    fn previewed(&self, png: Vec<u8>) {
        if let Some(dashboard) = &self.dashboard {
            dashboard.set_preview(png);
        }
    }

    fn painted(&self) {
        self.bar.finish_and_clear();
        if let Some(trace) = &self.trace {
            let flushed = trace.lock().unwrap_or_else(PoisonError::into_inner).flush();
            let lost = flushed.err().map(|error| self.trace_lost.get_or_init(|| error.to_string()));
            if let Some(reason) = lost.or_else(|| self.trace_lost.get()) {
                self.event(Event::Warning { message: format!("the trace of messages is incomplete: {reason}") });
            }
        }
    }
}

impl Drop for ConsoleWatcher {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
        say_if_ended_at_once(None);
    }
}

/// Returns the lines for an event.
fn lines(event: &Event, is_detached: bool) -> Vec<String> {
    match event {
        Event::Started { .. } => vec![started(event)],
        Event::Note { message } => vec![message.clone()],
        Event::Warning { message } => vec![format!("warning: {message}")],
        Event::Submitted { job, last_job } => vec![submitted(*job, *last_job, is_detached)],
        Event::Frame { output, done, all } => vec![format!("{output} ({done} of {all})")],
        Event::Recorded { file } => vec![recorded(file)],
        Event::Timeline { file } => vec![format!("timeline of processors and devices: {file}")],
        Event::Fetched { output } => vec![format!("{output}: completed by another machine")],
        Event::Finished { output, seconds, .. } => vec![format!("{output} in {}", length(*seconds))],
        Event::Interrupted { output, .. } => {
            vec![format!("stopped; {output} holds what is painted. Continue with the same command and --resume.")]
        }
        Event::Analyzed { .. }
        | Event::Zone(_)
        | Event::Agent(_)
        | Event::Round(_)
        | Event::Theft(_)
        | Event::Auction(_)
        | Event::Forecast(_)
        | Event::Progress(_)
        | Event::Preview { .. }
        | Event::LightingAgents(_)
        | Event::Sending { .. }
        | Event::Compiling { .. }
        | Event::Step { .. }
        | Event::Mixed { .. }
        | Event::Resources { .. }
        | Event::Denoised { .. } => Vec::new(),
    }
}

/// Returns the additional lines of `--verbose`: the distribution of work, and the times of its parts.
fn details(event: &Event) -> Vec<String> {
    match event {
        Event::Started { agents, .. } => {
            let plural = if *agents == 1 { "" } else { "s" };
            vec![format!("{agents} Render Agent{plural}")]
        }
        Event::Preview { number: 1, seconds } => {
            vec![format!("survey: the first preview came {} after loading", length(*seconds))]
        }
        Event::LightingAgents(agents) => lighting_agents(agents),
        Event::Mixed { engines, seams_z, seams_p } => {
            let zones: Vec<String> =
                engines.iter().map(|share| format!("{} by {}", share.zones, share.engine)).collect();
            vec![format!("passes of zones: {}; seams z = {seams_z:.2}, p = {seams_p:.3}", zones.join(", "))]
        }
        Event::Resources { .. } => vec![at_work(event)],
        Event::Denoised { by, seconds } => vec![format!("denoised in {} by {by}", length(*seconds))],
        Event::Auction(auction) => vec![auction_line(auction)],
        Event::Forecast(forecast) => vec![forecast_line(forecast)],
        Event::Finished { .. } => painted(event),
        _ => Vec::new(),
    }
}

/// Returns a line about the start: scene, image size, goal, and painters.
fn started(event: &Event) -> String {
    let Event::Started { scene, crop: [x0, y0, x1, y1], triangles, method, painters, .. } = event else {
        return String::new();
    };
    let (width, height, goal) = (x1 - x0, y1 - y0, goal(event));
    match triangles {
        Some(triangles) => {
            format!("{scene}: {triangles} triangles; {width}x{height} pixels, {goal} by {method} on {painters}")
        }
        None => format!("{scene}: {width}x{height} pixels, {goal} by {painters}"),
    }
}

/// Describes the goal. With an error or a time limit, the samples are an upper bound that few pixels reach.
fn goal(event: &Event) -> String {
    match event {
        Event::Started { error: Some(error), .. } => format!("to an estimated error of {error}"),
        Event::Started { time: Some(time), .. } => format!("the best in {}", length(*time)),
        Event::Started { samples_per_pixel, .. } => format!("{samples_per_pixel} samples each"),
        _ => String::new(),
    }
}

fn submitted(job: u32, last: Option<u32>, is_detached: bool) -> String {
    match last {
        Some(last) if last == job => format!("1 frame is job {job} of the farm"),
        Some(last) => format!("{} frames are jobs {job} to {last} of the farm", last - job + 1),
        None if is_detached => format!("job {job}: the farm paints it; see `bottega jobs show {job}`"),
        None => format!("job {job}: the machines of the farm take part"),
    }
}

/// Returns the message when a user ends the process at once.
fn parting(job: u32, last: Option<u32>) -> String {
    match last {
        Some(last) => format!(
            "jobs {job} to {last} stay with the farm: `bottega jobs list` shows them, `bottega jobs fetch N` gets a finished picture, `bottega jobs cancel N` cancels a job"
        ),
        None => format!(
            "job {job} stays with the farm: `bottega jobs fetch {job}` gets its picture when it is done, `bottega jobs cancel {job}` cancels it"
        ),
    }
}

/// Returns a message with the path of a record, and the command that replays it.
pub(crate) fn recorded(file: &str) -> String {
    format!("recorded in {file}; try: bottega simulate {file} --agents 8")
}

/// Summarizes the auction in one line.
fn auction_line(auction: &AuctionEvent) -> String {
    let AuctionEvent { rounds, contested, outbid, credit_decided, bidders, bids, awards, thefts, stolen, .. } = auction;
    if *rounds == 0 {
        return format!("stealing: {stolen} zones changed hands in {thefts} thefts");
    }
    format!(
        "auction: {awards} awards in {rounds} rounds, {contested} with several bidders, {outbid} zones outbid, \
         {credit_decided} rounds decided by credit; \
         {:.1} bidders and {:.1} bids a round",
        *bidders as f64 / *rounds as f64,
        *bids as f64 / *rounds as f64,
    )
}

fn forecast_line(forecast: &ForecastEvent) -> String {
    let ForecastEvent { zones, rank_correlation, median_error, jobs_learnt, .. } = forecast;
    let ranks = rank_correlation.map_or(String::new(), |ranks| format!(", rank correlation {ranks:.2}"));
    let from = match jobs_learnt {
        0 => "from the survey alone".to_owned(),
        1 => "learnt in 1 job".to_owned(),
        jobs => format!("learnt in {jobs} jobs"),
    };
    format!(
        "times of zones, expected before painting, {from}: {zones} zones, off by {:.0} % in the median{ranks}",
        100.0 * median_error
    )
}

/// Summarizes the utilization of resources in one line.
fn at_work(event: &Event) -> String {
    let Event::Resources { resources, bin_waiting, bin_capacity, bin_full, bin_empty, expired, .. } = event else {
        return String::new();
    };
    let (processors, devices): (Vec<_>, Vec<_>) =
        resources.iter().partition(|resource| resource.name.starts_with("cpu"));
    let mean = processors.iter().map(|resource| resource.occupation).sum::<f64>() / processors.len().max(1) as f64;
    let least = processors.iter().map(|resource| resource.occupation).fold(1.0, f64::min);
    let mut parts = Vec::new();
    if !processors.is_empty() {
        let packets: u64 = processors.iter().map(|resource| resource.packets).sum();
        let units: u64 = processors.iter().map(|resource| resource.units).sum();
        parts.push(format!(
            "processors {:.1} % at work (the least {:.1} %), {units} units in {packets} packets",
            100.0 * mean,
            100.0 * least,
        ));
    }
    parts.extend(devices.into_iter().map(|device| {
        let memory = match (device.sent_bytes, device.resident_bytes) {
            (Some(sent), Some(there)) => {
                format!(", {:.1} MB of scenes sent, {:.1} MB there", sent as f64 / 1e6, there as f64 / 1e6)
            }
            _ => String::new(),
        };
        let cable = device.cable.as_ref().map_or_else(String::new, cable_text);
        let tuning = tuning_text(device);
        format!("{} {:.1} %{tuning}{memory}{cable}", device.name, 100.0 * device.occupation)
    }));
    let expired = if *expired > 0 { format!("; {expired} units past their life time") } else { String::new() };
    format!(
        "{}; work bin of {bin_capacity} units: {bin_waiting:.1} wait on average, full {:.0} %, empty {:.0} % of the \
         time{expired}",
        parts.join("; "),
        100.0 * bin_full,
        100.0 * bin_empty
    )
}

/// Summarizes the packets of a device: what tuning chose.
fn tuning_text(device: &ResourceUse) -> String {
    let ResourceUse { units, packets, packet_largest, window, round_trip, .. } = device;
    let round_trip = round_trip.map_or_else(String::new, |seconds| format!(", answered in {:.1} ms", 1e3 * seconds));
    format!(
        ", {packets} packets of {:.1} units (at most {packet_largest}), {window} at a time{round_trip}",
        *units as f64 / (*packets).max(1) as f64
    )
}

/// Summarizes the traffic on a board's cable.
fn cable_text(cable: &CableTraffic) -> String {
    let rate = |bandwidth: Option<f64>| bandwidth.map_or("?".to_owned(), |bytes| format!("{:.3}", bytes / 1e6));
    let packets = cable.packet_seconds.map_or(String::new(), |seconds| {
        let bytes = cable.sent_bytes as f64 / cable.packets.max(1) as f64;
        format!(", {} packets of {:.1} kB that took {:.1} ms each", cable.packets, bytes / 1e3, 1e3 * seconds)
    });
    format!(
        ", {:.1} MB sent at {} MB/s, {:.1} MB back at {} MB/s{packets}",
        cable.sent_bytes as f64 / 1e6,
        rate(cable.bandwidth_there),
        cable.received_bytes as f64 / 1e6,
        rate(cable.bandwidth_back),
    )
}

/// Returns lines about the speed of the render, and the cost of bands and composition.
fn painted(event: &Event) -> Vec<String> {
    let Event::Finished { seconds, samples, utilization, bands, composition, .. } = event else {
        return Vec::new();
    };
    let bands = (*bands > 0.0).then(|| {
        format!(
            "interpolation bands: {:.1} % of all painted pixels; composition {:.1} % of the time",
            100.0 * bands,
            100.0 * composition,
        )
    });
    let speed = format!(
        "{:.2} M samples/s, {:.1} % of the processors' time spent painting",
        *samples as f64 / seconds / 1e6,
        100.0 * utilization,
    );
    bands.into_iter().chain([speed]).collect()
}

/// Returns lines about the lighting agents: their number, cost and savings.
fn lighting_agents(agents: &LightingAgents) -> Vec<String> {
    let [geometry, proximity, penumbra, irradiance] = agents.sensors;
    let (traced, spared) = (agents.shadow_rays_traced, agents.shadow_rays_spared);
    let lookouts = agents.caustics_seen.map(|[blind, sent]| {
        let [blind, sent] = [blind, sent].map(|share| 100.0 * share);
        format!("lookouts: the camera sees {sent:.0} % of the photons for caustics ({blind:.0} % without them)")
    });
    let swarm = [
        format!(
            "lighting agents: {} cast, {} stored ({} clones), {:.1} MB; cast in {}, {penumbra} penumbra, {irradiance} \
             irradiance, {geometry} geometry and {proximity} proximity sensors in {}",
            agents.cast,
            agents.agents,
            agents.clones,
            agents.map_bytes as f64 / 1e6,
            length(agents.casting_seconds),
            length(agents.sensing_seconds),
        ),
        format!(
            "shadow rays: {traced} traced, {spared} spared ({:.1} % traced); indirect light: {} times gathered, {} times \
             interpolated",
            100.0 * traced as f64 / (traced + spared).max(1) as f64,
            agents.irradiance_computed,
            agents.irradiance_interpolated,
        ),
    ];
    swarm.into_iter().chain(lookouts).collect()
}

fn length(seconds: f64) -> String {
    Duration::try_from_secs_f64(seconds).map_or("–".to_owned(), duration)
}
