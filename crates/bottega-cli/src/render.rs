//! `bottega render`: options in, a picture out.

use std::{process::ExitCode, sync::Arc};

use bottega::{Request, Session, SessionOptions, StopSwitch, journal::journal_of};
use bottega_cluster::{
    animation::{render_frames, submit_frames},
    client::{self, RenderOutcome},
};
use bottega_web::Dashboard;

use crate::{
    cli::RenderArgs,
    config,
    console_watcher::{ConsoleWatcher, OutputForm},
    error::CliError,
    signals::{interrupted, stop_on_signal},
};

pub(crate) fn run(args: &RenderArgs) -> Result<ExitCode, CliError> {
    let request = args.to_request()?;
    if args.request.dry_run {
        println!("{}", request.to_json().map_err(unwritable)?);
        return Ok(ExitCode::SUCCESS);
    }
    let stop = StopSwitch::new();
    stop_on_signal(&stop)?;
    let voice = Arc::new(voice(args, &stop)?);
    if args.farm.is_some() {
        return in_farm(args, &request, &voice, &stop);
    }
    if request.frames.is_none() {
        return one(&request, options(args), &voice, &stop);
    }
    for frame in request.missing_frames(args.resume)? {
        let request = request.at_frame(frame)?;
        // A frame that nobody has begun is begun.
        let is_begun = request.output.file.as_deref().is_some_and(|file| journal_of(file).is_file());
        let options = SessionOptions { resume: args.resume && is_begun, ..options(args) };
        let code = one(&request, options, &voice, &stop)?;
        if stop.is_requested() {
            return Ok(code);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Paints one picture.
fn one(
    request: &Request,
    options: SessionOptions,
    voice: &Arc<ConsoleWatcher>,
    stop: &StopSwitch,
) -> Result<ExitCode, CliError> {
    let session = Session::open_with(request, options)?;
    let picture = session.render(Arc::clone(voice) as _, stop)?;
    Ok(if picture.is_whole() { ExitCode::SUCCESS } else { interrupted() })
}

/// Asks a farm, and paints with it unless nobody waits for the picture.
fn in_farm(
    args: &RenderArgs,
    request: &Request,
    voice: &Arc<ConsoleWatcher>,
    stop: &StopSwitch,
) -> Result<ExitCode, CliError> {
    let named = args.farm.as_ref().and_then(Option::as_ref);
    let of_file = named.is_none().then(config::farm_address).flatten();
    let farm = named.or(of_file.as_ref());
    let (credentials, watcher) =
        (args.login.credentials(args.farm.as_ref().and_then(Option::as_ref)), Arc::clone(voice) as _);
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
    }
}

/// Who is told: people or programs, the dashboard, the trace.
fn voice(args: &RenderArgs, stop: &StopSwitch) -> Result<ConsoleWatcher, CliError> {
    let form = match (args.scene.json, args.quiet) {
        (true, _) => OutputForm::Json,
        (_, true) => OutputForm::Quiet,
        _ => OutputForm::Text,
    };
    let dashboard = args.dashboard.map(|address| Dashboard::serve(address, stop)).transpose()?;
    ConsoleWatcher::new(form, dashboard, args.trace.as_deref(), args.detach)
}

fn unwritable(source: bottega::RequestError) -> CliError {
    bottega::Error::Request { origin: "the options".to_owned(), source }.into()
}
