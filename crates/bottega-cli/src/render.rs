//! `bottega render`: renders a request.

use std::{
    process::ExitCode,
    sync::{Arc, mpsc},
    thread,
    time::Duration,
};

use bottega::{
    Request, Session, SessionOptions, StopSwitch, Watcher, devices::compiling, events::Event, journal::journal_of,
    picture::is_done, text::shown,
};
use bottega_cluster::{
    FarmAddress, JobBoard,
    animation::{render_frames, submit_frames},
    client::{self, RenderOutcome},
};
use bottega_engines::external::KeptEngines;
use bottega_web::Dashboard;

use crate::{
    cli::RenderArgs,
    config,
    console_watcher::{ConsoleWatcher, OutputForm},
    error::CliError,
    notifications::PictureWatch,
    process_start::process_start,
    signals::{EndAtOnce, interrupted, stop_on_signal},
};

/// The interval at which devices are checked while a scene is prepared.
const LOOK_EVERY: Duration = Duration::from_millis(500);

pub(crate) fn run(args: &RenderArgs) -> Result<ExitCode, CliError> {
    let request = args.to_request()?;
    if args.request.dry_run {
        print!("{}\n", request.to_json().map_err(unwritable)?);
        return Ok(ExitCode::SUCCESS);
    }
    let stop = StopSwitch::new();
    stop_on_signal(&stop)?;
    let voice: Arc<dyn Watcher> = Arc::new(voice(args, &request, &stop)?);
    if args.notifications.is_empty() {
        return paint(args, &request, &voice, &stop);
    }
    let board = args.farm.as_ref().map(|_| args.login.link(named_farm(args))).transpose()?;
    let board = board.map(|link| JobBoard { uplink: link.uplink });
    let names = [shown(&request.scene.file), request.output.file.as_deref().map(shown).unwrap_or_default()];
    let watch = Arc::new(PictureWatch::start(&args.notifications, voice, board, names)?);
    let result = paint(args, &request, &(Arc::clone(&watch) as _), &stop);
    watch.end(&result);
    result
}

/// Renders the request, locally or in a farm.
fn paint(
    args: &RenderArgs,
    request: &Request,
    voice: &Arc<dyn Watcher>,
    stop: &StopSwitch,
) -> Result<ExitCode, CliError> {
    if args.farm.is_some() {
        return in_farm(args, request, voice, stop);
    }
    if request.frames.is_none() {
        // For an animation, the time limit applies to each frame.
        return one(request, SessionOptions { begun: Some(process_start()), ..options(args) }, voice, stop);
    }
    // Other engines keep their scene between frames.
    let _engines = KeptEngines::begin();
    for frame in request.missing_frames(args.resume)? {
        let request = request.at_frame(frame)?;
        // With `--resume`, frames without a journal start from the beginning.
        let is_begun = request.output.file.as_deref().is_some_and(|file| journal_of(file).is_file());
        let options = SessionOptions { resume: args.resume && is_begun, ..options(args) };
        let code = one(&request, options, voice, stop)?;
        if stop.is_requested() {
            return Ok(code);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Renders one image.
fn one(
    request: &Request,
    options: SessionOptions,
    voice: &Arc<dyn Watcher>,
    stop: &StopSwitch,
) -> Result<ExitCode, CliError> {
    let is_begun = request.output.file.as_deref().is_some_and(|file| journal_of(file).is_file());
    if options.resume && !is_begun && is_done(request) {
        let file = request.output.file.as_deref().map(shown).unwrap_or_default();
        voice.event(Event::Note { message: format!("{file} is complete: nothing is left to paint") });
        return Ok(ExitCode::SUCCESS);
    }
    let session = opened(request, options, voice)?;
    let picture = session.render(Arc::clone(voice), stop)?;
    Ok(if picture.is_whole() { ExitCode::SUCCESS } else { interrupted() })
}

/// Reads and prepares a scene. Meanwhile a signal ends the process at once, because there is nothing to keep. Reports devices
/// that are compiling.
fn opened(request: &Request, options: SessionOptions, voice: &Arc<dyn Watcher>) -> Result<Session, CliError> {
    let _at_once = EndAtOnce::begin();
    let (done, is_done) = mpsc::channel::<()>();
    thread::scope(|scope| {
        scope.spawn(move || {
            while is_done.recv_timeout(LOOK_EVERY) == Err(mpsc::RecvTimeoutError::Timeout) {
                for (device, time) in compiling() {
                    voice.event(Event::Compiling { device, seconds: time.as_secs_f64() });
                }
            }
        });
        let session = Session::open_with(request, options);
        drop(done);
        Ok(session?)
    })
}

/// Returns the farm named by the option.
fn named_farm(args: &RenderArgs) -> Option<&FarmAddress> {
    args.farm.as_ref().and_then(Option::as_ref)
}

/// Submits the request to a farm, and paints with it unless detached.
fn in_farm(
    args: &RenderArgs,
    request: &Request,
    voice: &Arc<dyn Watcher>,
    stop: &StopSwitch,
) -> Result<ExitCode, CliError> {
    let named = named_farm(args);
    let of_file = named.is_none().then(config::farm_address).flatten();
    let farm = named.or(of_file.as_ref());
    let (credentials, watcher) = (args.login.credentials(named), Arc::clone(voice));
    match (request.frames.is_some(), args.detach) {
        (true, true) => submit_frames(farm, &credentials, request, args.resume, watcher, stop)?,
        (true, false) => render_frames(farm, &credentials, request, args.resume, watcher, stop)?,
        (false, true) => _ = client::submit(farm, &credentials, request, watcher, stop)?,
        (false, false) => match client::render(farm, &credentials, request, options(args), watcher, stop)? {
            RenderOutcome::Local(picture) if !picture.is_whole() => return Ok(interrupted()),
            RenderOutcome::Local(_) | RenderOutcome::Remote(_) => return Ok(ExitCode::SUCCESS),
        },
    }
    Ok(if stop.is_requested() { interrupted() } else { ExitCode::SUCCESS })
}

fn options(args: &RenderArgs) -> SessionOptions {
    SessionOptions {
        resume: args.resume,
        preview: args.preview.clone(),
        shows: args.dashboard.is_some(),
        record: args.record.clone(),
        timeline: args.timeline.clone(),
        tev: args.tev.clone(),
        ..SessionOptions::default()
    }
}

/// Returns the watcher for the chosen form of output, with the dashboard and the trace.
fn voice(args: &RenderArgs, request: &Request, stop: &StopSwitch) -> Result<ConsoleWatcher, CliError> {
    let form = match (args.scene.json, args.quiet, args.verbose) {
        (true, ..) => OutputForm::Json,
        (_, true, _) => OutputForm::Quiet,
        (.., true) => OutputForm::Verbose,
        _ => OutputForm::Text,
    };
    let dashboard = args.dashboard.map(|address| Dashboard::serve(address, stop)).transpose()?;
    if let (Some(dashboard), None, None) = (&dashboard, &request.frames, &args.farm) {
        dashboard.show_request(request);
    }
    ConsoleWatcher::new(form, dashboard, args.trace.as_deref(), args.detach)
}

fn unwritable(source: bottega::RequestError) -> CliError {
    bottega::Error::Request { origin: "the options".to_owned(), source }.into()
}
