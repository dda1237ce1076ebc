//! `bottega render`: a scene in, a picture out.

mod lighting_agents;

use std::{fs, path::Path, process::ExitCode, sync::Arc, time::Instant};

use bottega_engines::{BuiltinEngine, BuiltinOptions, RenderEngine, Tunables};
use bottega_farm::{
    Expert, Goal, JobError, JobReport, JobSettings, Kept, Level, Observer, Optimization, StopSwitch,
    simulate::Recorder, survey_size,
};
use bottega_image::{
    Aov, Encoding, ExrOptions, Film, HalfOrFloat, Layout, Metadata, OutputFormat, PngOptions, Rect, ToneMap,
    check_writable, write_exr, write_png,
};
use bottega_render::{Filter, PathSettings};
use bottega_scene::RenderHints;
use bottega_web::{Dashboard, wire::Event};

use crate::{
    cli::{DEPTH_MAX, EncodingArg, FilterArg, LayersArg, OptimizeArg, RenderArgs, SAMPLES_MAX, ToneArg},
    denoise,
    devices::{Crew, costs, incident_line},
    engines::{self, Material},
    error::CliError,
    farm::{Asked, Painted, Tools, write_picture},
    frames,
    keeping::{Keeping, name_of},
    method::Method,
    parting,
    preview::{Look, Show, check_preview},
    reporter::{Reporter, Voice, duration},
    rules::{experts, rule_texts},
    scene::{Subject, agents, shown, threads},
    simulate::{recorded, write_record},
};

/// Samples of a pixel where nobody says.
const DEFAULT_SAMPLES: u32 = 64;

/// The most samples of a pixel where an error is asked for, or a time, and nobody says.
const MOST_SAMPLES: u32 = 4096;
/// The same with a time: a picture may take all night.
const MOST_SAMPLES_IN_TIME: u32 = 1 << 16;
/// For so many samples the guide is learnt at most where nobody knows how many a pixel will get.
const PLANNED_SAMPLES_MAX: u32 = 256;

/// Bounces where nobody says.
const DEFAULT_DEPTH: u32 = 16;

/// Exit code of a work that the user stopped.
const INTERRUPTED: u8 = 130;

pub(crate) fn run(args: &RenderArgs) -> Result<ExitCode, CliError> {
    let stop = StopSwitch::new();
    stop_on_signal(&stop)?;
    match &args.frames {
        Some(frames) => frames::run(args, frames, &stop),
        None => one(args, &stop),
    }
}

/// Paints one picture.
pub(crate) fn one(args: &RenderArgs, stop: &StopSwitch) -> Result<ExitCode, CliError> {
    if !args.engines.is_builtin() {
        return engines::one(args, stop);
    }
    let begun = Instant::now();
    // Everything that can be wrong is found out before the first sample.
    let format = check_writable(&args.output)?;
    args.guiding.check()?;
    args.preview.as_deref().map(check_preview).transpose()?;
    let (experts, notes) = experts(rule_texts(&args.rules)?)?;
    let dashboard = args.dashboard.map(Dashboard::serve).transpose()?;
    let reporter = Arc::new(reporter(args, dashboard.clone())?);
    let subject = Subject::load(&args.scene)?;
    for warning in notes.into_iter().chain(subject.warnings.iter().map(ToString::to_string)) {
        reporter.warn(warning);
    }
    let method = Method::of(args, &subject, max_depth(args, &subject));
    method.note.iter().for_each(|note| reporter.warn(note.clone()));
    let mut settings = job_settings(args, &subject, experts)?;
    settings.goal = goal(args, begun)?;
    if let (Some(farm), true) = (&args.farm, args.detach) {
        let material = Material::of(args, &subject);
        let asked = Asked::submit(farm.as_ref(), args, &material, None, stop, &reporter)?;
        let number = asked.number;
        reporter.say(&format!("job {number}: the farm paints it; see `bottega jobs show {number}`"));
        reporter.tell(Event::Asked { job: number });
        return Ok(ExitCode::SUCCESS);
    }
    let name = name_of(args, &subject, &settings);
    // Devices and denoisers that are not there are told before anything is written.
    let denoiser = denoise::ready(args)?;
    let (engine, crew) = engine(args, &subject, &settings)?;
    let keeping = Keeping::begin(&args.output, &name, args.resume)?;
    let engine = Arc::new(engine);
    crew.notes.iter().for_each(|note| reporter.warn(note.clone()));
    let has_paths = method.photons.is_none() && subject.prepared.can_learn(subject.view, planned_samples(&settings));
    if args.guiding.asks_for_agents() && !has_paths {
        let why = "--guide ala does nothing here: it is for paths in clear air, pictures of 128 × 128 pixels or more, and \
                   524288 samples or more, all pixels together";
        reporter.warn(why.to_owned());
    }
    started(&reporter, args, &subject, &settings, &crew);

    if args.preview.is_some() || dashboard.is_some() {
        show(args, dashboard, &subject, settings.crop, &engine, &reporter, keeping.kept.as_ref())?;
    }
    let painter = Arc::clone(&engine);
    reporter.watch(move || painter.samples_done());
    settings.goal = goal(args, begun)?;
    let (painter, observer): (Arc<dyn RenderEngine>, Arc<dyn Observer>) =
        (Arc::clone(&engine) as _, Arc::clone(&reporter) as _);
    let recorder = args.record.as_ref().map(|_| Arc::new(Recorder::new(Arc::clone(&painter), Arc::clone(&observer))));
    let (painter, observer) = match &recorder {
        Some(recorder) => (Arc::clone(recorder) as _, Arc::clone(recorder) as _),
        None => (painter, observer),
    };
    let material = Material::of(args, &subject);
    let submit = |farm: &Option<_>| Asked::submit(farm.as_ref(), args, &material, Some(&name), stop, &reporter);
    let asked = args.farm.as_ref().map(submit).transpose()?;
    let tools =
        Tools { settings: settings.clone(), engine: painter, observer, store: Some(keeping.store), kept: keeping.kept };
    let (report, leading) = match painted(asked.as_ref(), tools, stop, &reporter)? {
        Painted::Here(report, leading) => (*report, leading),
        Painted::Elsewhere(picture) => return had(args, asked.as_ref(), &reporter, &picture, &keeping.path),
    };
    reporter.finish();
    devices_did(&engine, &crew, &reporter);
    if engine.dropped_count() > 0 {
        reporter.warn(format!("{} samples had no finite radiance and count as black", engine.dropped_count()));
    }
    if let (Some(path), Some(recorder), false) = (&args.record, recorder, report.stopped || !report.failed.is_empty()) {
        let record = recorder.record(&shown(&args.scene.file.scene), &settings, &report);
        let record = record.map_err(|source| CliError::Record { path: path.clone(), source })?;
        write_record(path, &record)?;
        reporter.say(&recorded(path));
    }
    let mut report = report;
    let mut metadata = metadata(args, &subject, &settings, &crew, &report);
    denoise::finish(denoiser.as_ref(), args, &mut report, &mut metadata, &reporter, stop)?;
    if let Some(swarm) = engine.lighting_agents() {
        lighting_agents::tell(&swarm, &reporter, &mut metadata);
    }
    let written = write(args, Some(&subject.hints), &args.output, format, &report.film, &metadata);
    written.map_err(|error| match &asked {
        Some(asked) => asked.unwritten(&error),
        None => error,
    })?;
    if let (Some(asked), Some(leading)) = (&asked, leading)
        && let Err(error) = asked.finish(&leading, report.failed.len(), &reporter)
    {
        reporter.warn(format!("the picture is written, and the farm does not know of it: {error}"));
    }
    end(args, &reporter, &settings, &report, &keeping.path)
}

/// Paints alone, or with the machines of a farm.
pub(crate) fn painted(
    asked: Option<&Asked>,
    tools: Tools,
    stop: &StopSwitch,
    reporter: &Reporter,
) -> Result<Painted, CliError> {
    let Some(asked) = asked else {
        let Tools { settings, engine, observer, store, kept } = tools;
        let report = bottega_farm::run(&settings, engine, observer, stop, store, kept).map_err(failed)?;
        return Ok(Painted::Here(Box::new(report), None));
    };
    reporter.say(&format!("job {}: the machines of the farm take part", asked.number));
    reporter.tell(Event::Asked { job: asked.number });
    asked.paint(tools, reporter)
}

/// The picture was led to its end by another machine.
pub(crate) fn had(
    args: &RenderArgs,
    asked: Option<&Asked>,
    reporter: &Reporter,
    picture: &[u8],
    journal: &Path,
) -> Result<ExitCode, CliError> {
    reporter.finish();
    let written = write_picture(&args.output, picture);
    written.map_err(|error| match asked {
        Some(asked) => asked.unfetched(&error),
        None => error,
    })?;
    if let Some(lacking) = denoise::lacking(args, picture) {
        reporter.warn(lacking);
    }
    if let Err(error) = fs::remove_file(journal) {
        reporter.warn(format!("cannot remove {}: {error}", journal.display()));
    }
    reporter.say(&format!("{}: led to its end by another machine", shown(&args.output)));
    Ok(ExitCode::SUCCESS)
}

/// Which voice, dashboard and trace.
pub(crate) fn reporter(args: &RenderArgs, dashboard: Option<Dashboard>) -> Result<Reporter, CliError> {
    let voice = match (args.scene.json, args.quiet) {
        (true, _) => Voice::Json,
        (_, true) => Voice::Quiet,
        _ => Voice::Bar,
    };
    let reporter = Reporter::new(voice, dashboard.clone(), args.trace.as_deref())?;
    if let Some(dashboard) = dashboard {
        reporter.say(&format!("live view: http://{}", dashboard.address()));
    }
    Ok(reporter)
}

/// From now on shows what is painted. What is kept of it is shown at once, amid what a look at the picture gives.
fn show(
    args: &RenderArgs,
    dashboard: Option<Dashboard>,
    subject: &Subject,
    crop: Rect,
    engine: &BuiltinEngine,
    reporter: &Arc<Reporter>,
    kept: Option<&Kept>,
) -> Result<(), CliError> {
    let look = Look { frame: subject.frame(), crop, exposure: args.exposure, tone: tone(args.tonemap) };
    let show = Arc::new(Show::new(look, args.preview.clone(), dashboard));
    if let Some(kept) = kept {
        let (columns, rows) = survey_size(&look.frame);
        show.begin(&engine.survey(columns, rows)?);
        kept.tiles.values().for_each(|tile| show.painted(tile));
    }
    reporter.show(&show, subject.loaded);
    engine.watch(move |tile| show.painted(tile));
    Ok(())
}

pub(crate) fn job_settings(
    args: &RenderArgs,
    subject: &Subject,
    experts: Vec<Expert>,
) -> Result<JobSettings, CliError> {
    let frame = subject.frame();
    let crop = args.crop.or_else(|| hinted_crop(subject)).unwrap_or(frame);
    if !frame.encloses(&crop) {
        return Err(CliError::usage(
            format!("the crop {crop} is not within the picture of {}x{}", frame.width(), frame.height()),
            "x1 and y1 may be at most the picture's width and height",
        ));
    }
    let threads = threads(&args.scene);
    let tunables = Tunables { max_depth: max_depth(args, subject), light_samples: args.light_samples };
    let hinted = subject.hints.samples.filter(|_| args.error.is_none() && args.time.is_none());
    let samples = args.spp.or(hinted).unwrap_or_else(|| samples_unasked(args, DEFAULT_SAMPLES)).clamp(1, SAMPLES_MAX);
    let layout = Layout::new(LayersArg::of_own_engine(args.aov.as_ref(), args.denoise)?);
    Ok(JobSettings {
        crop,
        level: level(args.scene.level),
        optimization: optimization(args.optimize),
        agents: agents(args.agents, threads),
        experts,
        processors: threads,
        importance: args.scene.importance_function(),
        zones: args.zones,
        verify: args.verify.unwrap_or(1),
        ..JobSettings::new(frame.width(), frame.height(), samples, tunables, layout)
    })
}

/// Samples of a pixel where nobody says: `usual`, or as many as may be of use where an error or a time ends the picture.
pub(crate) fn samples_unasked(args: &RenderArgs, usual: u32) -> u32 {
    match (args.error, args.time) {
        (Some(_), _) => MOST_SAMPLES.max(usual),
        (_, Some(_)) => MOST_SAMPLES_IN_TIME.max(usual),
        _ => usual,
    }
}

/// When a zone is finished, for one who paints with others: their Master keeps the time.
pub(crate) fn asked_goal(args: &RenderArgs) -> Goal {
    args.error.map_or(Goal::Samples, Goal::Error)
}

/// When a zone is finished. Loading is a part of the time that was asked for.
pub(crate) fn goal(args: &RenderArgs, begun: Instant) -> Result<Goal, CliError> {
    match (args.error, args.time) {
        (Some(error), _) => Ok(Goal::Error(error)),
        (None, Some(time)) => match time.checked_sub(begun.elapsed()) {
            Some(left) if !left.is_zero() => Ok(Goal::Time(left)),
            _ => Err(CliError::failed(
                format!("reading the scene took {}, no less than --time allows", duration(begun.elapsed())),
                "give it more time",
            )),
        },
        (None, None) => Ok(Goal::Samples),
    }
}

/// The engine, and who paints for it.
pub(crate) fn engine(
    args: &RenderArgs,
    subject: &Subject,
    job: &JobSettings,
) -> Result<(BuiltinEngine, Crew), CliError> {
    let photons = Method::of(args, subject, max_depth(args, subject)).photons;
    let settings = PathSettings {
        seed: args.seed,
        max_depth: max_depth(args, subject),
        light_samples: args.light_samples,
        filter: filter(args, subject),
        guiding: args.guiding.directions(),
        agents: args.guiding.agents(),
        planned_samples: planned_samples(job),
        photons,
        ..PathSettings::default()
    };
    let choice = args.devices.exactly(args.exact)?;
    let mut crew = Crew::gather(&choice, job.processors, &subject.prepared, &job.layout, photons.is_some())?;
    let options = BuiltinOptions { view: subject.view, settings, layout: job.layout.clone(), threads: crew.threads };
    let engine = BuiltinEngine::new(Arc::clone(&subject.prepared), options, std::mem::take(&mut crew.devices));
    Ok((engine, crew))
}

pub(crate) fn level(level: u8) -> Level {
    Level::ALL[usize::from(level).min(Level::ALL.len() - 1)]
}

pub(crate) fn optimization(optimize: OptimizeArg) -> Optimization {
    match optimize {
        OptimizeArg::Off => Optimization::Off,
        OptimizeArg::Vs => Optimization::VerySmall,
        OptimizeArg::S => Optimization::Small,
        OptimizeArg::N => Optimization::Normal,
        OptimizeArg::B => Optimization::Big,
        OptimizeArg::Vb => Optimization::VeryBig,
    }
}

pub(crate) fn filter(args: &RenderArgs, subject: &Subject) -> Filter {
    match args.filter {
        None => subject.hints.filter.unwrap_or_default(),
        Some(FilterArg::BlackmanHarris) => Filter::default(),
        Some(FilterArg::Gaussian) => Filter::Gaussian { radius: 1.5, sigma: 0.5 },
        Some(FilterArg::Tent) => Filter::Tent { radius: 1.0 },
        Some(FilterArg::Mitchell) => Filter::Mitchell { radius: 2.0, b: 1.0 / 3.0, c: 1.0 / 3.0 },
        Some(FilterArg::Box) => Filter::PIXEL,
    }
}

/// Samples a pixel for which it is worth learning.
fn planned_samples(job: &JobSettings) -> u32 {
    match job.goal {
        Goal::Samples => job.samples,
        Goal::Error(_) | Goal::Time(_) => job.samples.min(PLANNED_SAMPLES_MAX),
    }
}

pub(crate) fn max_depth(args: &RenderArgs, subject: &Subject) -> u32 {
    args.max_depth.or(subject.hints.max_depth).map_or(DEFAULT_DEPTH, |depth| depth.min(DEPTH_MAX))
}

/// The part of the picture that the file asks for, as far as it lies within.
fn hinted_crop(subject: &Subject) -> Option<Rect> {
    let [x, y, width, height] = subject.hints.crop?;
    let frame = subject.frame();
    let (x1, y1) = (x.saturating_add(width).min(frame.x1), y.saturating_add(height).min(frame.y1));
    (x < x1 && y < y1).then(|| Rect::new(x, y, x1, y1))
}

/// How a work ends that the user stopped.
pub(crate) fn interrupted() -> ExitCode {
    ExitCode::from(INTERRUPTED)
}

/// Ctrl-C and SIGTERM stop the work and keep it; a second one ends the process at once.
pub(crate) fn stop_on_signal(stop: &StopSwitch) -> Result<(), CliError> {
    let stop = stop.clone();
    ctrlc::set_handler(move || {
        if stop.is_requested() {
            parting::say();
            std::process::exit(i32::from(INTERRUPTED));
        }
        stop.request();
    })
    .map_err(|error| CliError::failed(format!("cannot watch for Ctrl-C: {error}"), "this is unexpected; report it"))
}

fn failed(error: JobError) -> CliError {
    match error {
        JobError::OtherWork => CliError::failed(
            "the interrupted picture was made with other settings",
            "give the same options as then, or leave out --resume to start anew",
        ),
        error => CliError::Job(error),
    }
}

fn started(reporter: &Reporter, args: &RenderArgs, subject: &Subject, settings: &JobSettings, crew: &Crew) {
    let crop = settings.crop;
    let method = Method::of(args, subject, settings.tunables.max_depth);
    reporter.say(&format!(
        "{}: {} triangles; {}x{} pixels, {} samples each by {}, {} agent{} on {}",
        shown(&args.scene.file.scene),
        subject.scene().triangle_count(),
        crop.width(),
        crop.height(),
        settings.samples,
        method.name(),
        settings.agents,
        if settings.agents == 1 { "" } else { "s" },
        crew.names(),
    ));
    reporter.tell(Event::Started {
        version: 1,
        scene: shown(&args.scene.file.scene),
        output: shown(&args.output),
        width: settings.width,
        height: settings.height,
        crop: [crop.x0, crop.y0, crop.x1, crop.y1],
        samples_per_pixel: settings.samples,
        integrator: format!("{:?}", method.integrator).to_lowercase(),
        progressive: method.photons.is_some_and(|photons| photons.progressive),
        agents: settings.agents,
        threads: crew.threads,
        gpus: crew.gpus.clone(),
        seed: args.seed,
    });
}

/// Tells what went wrong with devices, and keeps what was learnt of them.
fn devices_did(engine: &BuiltinEngine, crew: &Crew, reporter: &Reporter) {
    if crew.gpus.is_empty() {
        return;
    }
    let report = engine.report();
    for incident in &report.incidents {
        reporter.warn(format!("{}; its work was done elsewhere", incident_line(&report, incident)));
    }
    costs::keep(&report);
}

/// What a picture says of how it was made.
pub(crate) fn metadata(
    args: &RenderArgs,
    subject: &Subject,
    settings: &JobSettings,
    crew: &Crew,
    report: &JobReport,
) -> Metadata {
    let mut metadata = Metadata::new();
    metadata.set("scene", shown(&args.scene.file.scene));
    metadata.set("scene_digest", &*subject.scene().digest);
    metadata.set("camera", &*subject.scene().cameras[subject.view.camera].name);
    metadata.set("samples_per_pixel", settings.samples.to_string());
    match settings.goal {
        Goal::Samples => {}
        Goal::Error(error) => metadata.set("error_asked", error.to_string()),
        Goal::Time(_) => metadata.set("time_asked", args.time.unwrap_or_default().as_secs_f64().to_string()),
    }
    metadata.set("max_depth", settings.tunables.max_depth.to_string());
    metadata.set("light_samples", args.light_samples.to_string());
    metadata.set("seed", args.seed.to_string());
    let method = Method::of(args, subject, settings.tunables.max_depth);
    metadata.set("integrator", format!("{:?}", method.integrator).to_lowercase());
    if let Some(photons) = &method.photons {
        metadata.set("photons", photons.count.to_string());
        metadata.set("progressive", photons.progressive.to_string());
    }
    if let Some(hint) = &subject.hints.integrator {
        metadata.set("integrator_of_scene", &*hint.name);
    }
    metadata.set("filter", format!("{:?}", filter(args, subject)));
    metadata.set("optimize", settings.optimization.to_string());
    metadata.set("level", args.scene.level.to_string());
    metadata.set("agents", settings.agents.to_string());
    metadata.set("threads", crew.threads.to_string());
    metadata.set("devices", crew.names());
    metadata.set("exact", crew.gpus.is_empty().to_string());
    metadata.set("render_seconds", format!("{:.3}", report.times.total.as_secs_f64()));
    metadata.set("complete", (!report.stopped).to_string());
    metadata
}

pub(crate) fn tone(tone: ToneArg) -> ToneMap {
    match tone {
        ToneArg::Agx => ToneMap::Agx,
        ToneArg::Aces => ToneMap::Aces,
        ToneArg::Linear => ToneMap::Linear,
    }
}

/// Writes the picture.
///
/// - `hints`: what the scene file asks for, where our own engine has read it.
pub(crate) fn write(
    args: &RenderArgs,
    hints: Option<&RenderHints>,
    path: &Path,
    format: OutputFormat,
    film: &Film,
    metadata: &Metadata,
) -> Result<(), CliError> {
    match format {
        OutputFormat::Exr => {
            let depth = if args.half { HalfOrFloat::Half } else { HalfOrFloat::Float };
            write_exr(path, film, metadata, ExrOptions { depth, tiled: args.tiled, ..ExrOptions::default() })?;
        }
        OutputFormat::Png => {
            let encoding = match args.encoding {
                EncodingArg::Srgb => Encoding::Srgb,
                EncodingArg::Linear => Encoding::Linear,
            };
            let options = PngOptions {
                exposure_stops: args.exposure,
                tone: tone(args.tonemap),
                encoding,
                alpha: args.alpha || hints.is_some_and(|hints| hints.alpha),
                ..PngOptions::default()
            };
            write_png(path, film, &options, metadata)?;
        }
    }
    Ok(())
}

/// Samples of all pixels. Where cells stop by their error only the film knows them.
fn samples_taken(report: &JobReport, settings: &JobSettings) -> u64 {
    if matches!(settings.goal, Goal::Error(_)) {
        let film = &report.film;
        return film.rect().pixels().map(|(x, y)| film.aov(Aov::SampleCount, x, y)[0] as u64).sum();
    }
    report.rows.iter().map(|row| row.size() * u64::from(row.samples_done())).sum()
}

/// Tells how it ended. The journal goes only when the picture is complete.
pub(crate) fn end(
    args: &RenderArgs,
    reporter: &Reporter,
    settings: &JobSettings,
    report: &JobReport,
    journal: &Path,
) -> Result<ExitCode, CliError> {
    let total = report.times.total.as_secs_f64();
    let painting = report.times.painting.as_secs_f64() / settings.processors as f64;
    let output = shown(&args.output);
    let samples = samples_taken(report, settings);
    if report.stopped {
        let wanted = settings.crop.area() * u64::from(settings.samples);
        let done = samples as f64 / wanted as f64;
        reporter.say(&format!("stopped; {output} holds what is painted. Go on with the same command and --resume."));
        reporter.tell(Event::Interrupted { output, seconds: total, done });
        return Ok(ExitCode::from(INTERRUPTED));
    }
    if !report.failed.is_empty() {
        return Err(CliError::failed(
            format!("{} zones could not be painted; {output} lacks them", report.failed.len()),
            "see the messages above; --resume tries them again",
        ));
    }
    // Left over it would only mislead; that it cannot be removed does not spoil the picture.
    if let Err(error) = fs::remove_file(journal) {
        reporter.warn(format!("cannot remove {}: {error}", journal.display()));
    }
    let overhead = (1.0 - painting / total).max(0.0);
    let (bands, composition) = (report.band_share(&settings.crop), report.times.composition.as_secs_f64() / total);
    if bands > 0.0 {
        reporter.say(&format!(
            "interpolation bands: {:.1} % of all painted pixels; composition {:.1} % of the time",
            100.0 * bands,
            100.0 * composition,
        ));
    }
    reporter.say(&format!(
        "{output} in {}: {:.2} M samples/s, {:.1} % of the processors' time spent painting",
        duration(report.times.total),
        samples as f64 / total / 1e6,
        100.0 * (1.0 - overhead),
    ));
    let utilization = 1.0 - overhead;
    reporter.tell(Event::Finished { output, seconds: total, samples, utilization, overhead, bands, composition });
    Ok(ExitCode::SUCCESS)
}
