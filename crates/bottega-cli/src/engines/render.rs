//! A picture painted by an engine of other people.

use std::{process::ExitCode, sync::Arc, time::Instant};

use bottega_engines::RenderEngine;
use bottega_farm::{JobReport, Observer, StopSwitch};
use bottega_image::{Rect, check_writable, seams};
use bottega_web::{Dashboard, wire::Event};

use super::{Material, Painter, choice, rules};
use crate::{
    cli::RenderArgs,
    denoise,
    error::CliError,
    farm::{Asked, Painted, Tools},
    journal::Keeping,
    preview::{Look, Show, check_preview},
    render,
    reporter::Reporter,
    rules::{engine_choice, experts},
    scene::shown,
};

/// So small a probability of no seams is none.
const SEAMS_SEEN: f64 = 1e-4;

/// Paints one picture.
pub(crate) fn one(args: &RenderArgs, stop: &StopSwitch) -> Result<ExitCode, CliError> {
    let begun = Instant::now();
    let format = check_writable(&args.output)?;
    args.preview.as_deref().map(check_preview).transpose()?;
    let (experts, notes) = experts(rules(args)?)?;
    let choice = choice(args)?.map(engine_choice).transpose()?;
    let dashboard = args.dashboard.map(Dashboard::serve).transpose()?;
    let reporter = Arc::new(render::reporter(args, dashboard.clone())?);
    notes.into_iter().for_each(|note| reporter.warn(note));
    if let (Some(farm), true) = (&args.farm, args.detach) {
        let number = Asked::submit(farm.as_ref(), args, &Material::gather(args)?, None, stop, &reporter)?.number;
        reporter.say(&format!("job {number}: the farm paints it; see `bottega jobs show {number}`"));
        reporter.tell(Event::Asked { job: number });
        return Ok(ExitCode::SUCCESS);
    }
    let denoiser = denoise::ready(args)?;
    let mut painter = Painter::open(args, experts)?;
    painter.settings.engine_choice = choice;
    painter.settings.goal = render::goal(args, begun)?;
    let name = painter.name(args)?;
    let keeping = Keeping::begin(&args.output, &name, args.resume)?;
    started(&reporter, args, &painter);
    watch(args, dashboard, &painter, &reporter, begun);
    painter.settings.goal = render::goal(args, begun)?;
    let (engine, observer): (Arc<dyn RenderEngine>, Arc<dyn Observer>) = (painter.paints(), Arc::clone(&reporter) as _);
    let settings = painter.settings.clone();
    let tools = Tools { settings, engine, observer, store: Some(keeping.store), kept: keeping.kept };
    let asked = asked(args, &name, stop, &reporter)?;
    let (report, leading) = match render::painted(asked.as_ref(), tools, stop, &reporter)? {
        Painted::Here(report, leading) => (*report, leading),
        Painted::Elsewhere(picture) => return render::had(args, asked.as_ref(), &reporter, &picture, &keeping.path),
    };
    reporter.finish();
    if painter.engine.dropped_count() > 0 {
        reporter.warn(format!("{} pixels had no finite values and count as black", painter.engine.dropped_count()));
    }
    tell_mix(&painter, &report, &reporter)?;
    let mut metadata = painter.metadata(args, &report);
    let mut report = report;
    denoise::finish(denoiser.as_ref(), args, &mut report, &mut metadata, &reporter, stop)?;
    let written = render::write(args, None, &args.output, format, &report.film, &metadata);
    written.map_err(|error| match &asked {
        Some(asked) => asked.unwritten(&error),
        None => error,
    })?;
    if let (Some(asked), Some(leading)) = (&asked, leading)
        && let Err(error) = asked.finish(&leading, report.failed.len(), &reporter)
    {
        reporter.warn(format!("the picture is written, and the farm does not know of it: {error}"));
    }
    render::end(args, &reporter, &painter.settings, &report, &keeping.path)
}

/// Tells who painted how much of a picture of two engines, and whether one sees where.
fn tell_mix(painter: &Painter, report: &JobReport, reporter: &Reporter) -> Result<(), CliError> {
    let Some(mix) = &painter.mix else { return Ok(()) };
    let zones: Vec<String> =
        mix.mixed.zones_by_engine().iter().map(|(name, zones)| format!("{zones} by {name}")).collect();
    let crop = painter.settings.crop;
    // Edges in pixels of the film, which begins at the crop.
    let moved = |rect: Rect| Rect::new(rect.x0 - crop.x0, rect.y0 - crop.y0, rect.x1 - crop.x0, rect.y1 - crop.y0);
    let rects: Vec<Rect> = report.rows.iter().map(|row| moved(row.rect)).collect();
    let found = seams(&report.film.to_picture(), None, &rects)?;
    reporter.say(&format!("passes of zones: {}; seams z = {:.2}, p = {:.3}", zones.join(", "), found.z, found.p()));
    if found.p() < SEAMS_SEEN {
        reporter.warn("the edges of zones can be seen: the engines do not agree on this scene".to_owned());
    }
    Ok(())
}

/// Asks a farm, where one is named.
fn asked(args: &RenderArgs, journal: &str, stop: &StopSwitch, reporter: &Reporter) -> Result<Option<Asked>, CliError> {
    let Some(farm) = &args.farm else { return Ok(None) };
    let material = Material::gather(args)?;
    material.warnings.iter().for_each(|warning| reporter.warn(warning.clone()));
    Asked::submit(farm.as_ref(), args, &material, Some(journal), stop, reporter).map(Some)
}

fn started(reporter: &Reporter, args: &RenderArgs, painter: &Painter) {
    let settings = &painter.settings;
    let crop = settings.crop;
    reporter.say(&format!(
        "{}: {}x{} pixels, {} samples each, by {}",
        shown(&args.scene.file.scene),
        crop.width(),
        crop.height(),
        settings.samples,
        painter.title(),
    ));
    reporter.tell(Event::Started {
        version: 1,
        scene: shown(&args.scene.file.scene),
        output: shown(&args.output),
        width: settings.width,
        height: settings.height,
        crop: [crop.x0, crop.y0, crop.x1, crop.y1],
        samples_per_pixel: settings.samples,
        integrator: painter.title(),
        progressive: false,
        agents: settings.agents,
        threads: settings.processors,
        gpus: Vec::new(),
        seed: args.seed,
    });
}

/// From now on tells what goes wrong and how far it is, and shows what is painted.
fn watch(args: &RenderArgs, dashboard: Option<Dashboard>, painter: &Painter, reporter: &Arc<Reporter>, begun: Instant) {
    reporter.watch(painter.counter());
    let (teller, title) = (Arc::downgrade(reporter), painter.title());
    painter.engine.watch_faults(move |fault| {
        if let Some(reporter) = teller.upgrade() {
            reporter.warn(format!("{title}: {fault}"));
        }
    });
    if args.preview.is_none() && dashboard.is_none() {
        return;
    }
    let frame = bottega_image::Rect::of_size(painter.settings.width, painter.settings.height);
    let look = Look { frame, crop: painter.settings.crop, exposure: args.exposure, tone: render::tone(args.tonemap) };
    let show = Arc::new(Show::new(look, args.preview.clone(), dashboard));
    reporter.show(&show, begun);
    painter.engine.watch(move |tile| show.painted(tile));
}
