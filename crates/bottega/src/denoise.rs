//! `--denoise`: what noise is left in a finished picture is removed.

use std::{
    ops::ControlFlow,
    time::{Duration, Instant},
};

use bottega_denoise::{DenoiseError, Denoised, Denoiser, install_hint};
use bottega_farm::{JobReport, StopSwitch};
use bottega_image::{Aov, Metadata, ReadLimits, read_image_bytes};
use bottega_web::wire::Event;

use crate::{
    cli::RenderArgs,
    error::CliError,
    reporter::{Reporter, duration},
    scene::threads,
};

/// Under which name a picture says by what it was denoised.
pub(crate) const KEY: &str = "denoised";

/// The denoiser, where one is asked for: found before anything is painted.
pub(crate) fn ready(args: &RenderArgs) -> Result<Option<Denoiser>, CliError> {
    args.denoise.then(Denoiser::load).transpose().map_err(CliError::denoise)
}

/// Denoises a finished picture, and tells how far it is. One that is not finished stays as it is; one that the user stops
/// meanwhile, too.
pub(crate) fn finish(
    denoiser: Option<&Denoiser>,
    args: &RenderArgs,
    report: &mut JobReport,
    metadata: &mut Metadata,
    reporter: &Reporter,
    stop: &StopSwitch,
) -> Result<(), CliError> {
    let Some(denoiser) = denoiser else { return Ok(()) };
    if report.stopped || !report.failed.is_empty() {
        return Ok(());
    }
    let mut told = |share: f64| {
        reporter.tell_step("denoising", share);
        if stop.is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let done = denoise(denoiser, args, report, metadata, &mut told);
    reporter.end_step();
    match done {
        Ok(took) => {
            let by = metadata.get(KEY).unwrap_or_default().to_owned();
            reporter.say(&format!("denoised in {} by {by}", duration(took)));
            reporter.tell(Event::Denoised { by, seconds: took.as_secs_f64() });
            Ok(())
        }
        Err(DenoiseError::Cancelled) => {
            report.stopped = true;
            metadata.set("complete", "false");
            Ok(())
        }
        Err(error) => Err(CliError::denoise(error)),
    }
}

/// Denoises a picture, and has its metadata say so. How long it took.
pub(crate) fn denoise(
    denoiser: &Denoiser,
    args: &RenderArgs,
    report: &mut JobReport,
    metadata: &mut Metadata,
    told: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Duration, DenoiseError> {
    let begun = Instant::now();
    let Denoised { film, guides } = denoiser.denoise(&report.film, threads(&args.scene), told)?;
    report.film = film;
    let helped: Vec<&str> = std::iter::once("color").chain(guides.into_iter().map(Aov::name)).collect();
    metadata.set(KEY, format!("Open Image Denoise {} of {}", denoiser.version(), helped.join(", ")));
    Ok(begun.elapsed())
}

/// Denoises a picture that this machine has led for others, if they have asked for that.
pub(crate) fn here(args: &RenderArgs, report: &mut JobReport, metadata: &mut Metadata) -> Result<(), CliError> {
    let Some(denoiser) = ready(args)?.filter(|_| !report.stopped && report.failed.is_empty()) else { return Ok(()) };
    let done = denoise(&denoiser, args, report, metadata, &mut |_| ControlFlow::Continue(()));
    done.map(drop).map_err(CliError::denoise)
}

/// What is to be told of a picture that another machine has led to its end, and that should be denoised and is not.
///
/// - `picture`: the file's bytes.
pub(crate) fn lacking(args: &RenderArgs, picture: &[u8]) -> Option<String> {
    let is_denoised = || {
        let file = read_image_bytes(&args.output, picture, ReadLimits { max_pixels: u64::MAX }).ok()?;
        file.metadata.get(KEY).map(drop)
    };
    let is_lacking = args.denoise && is_denoised().is_none();
    is_lacking
        .then(|| "the machine that led it to its end has no Open Image Denoise: the picture keeps its noise".to_owned())
}

impl CliError {
    fn denoise(source: DenoiseError) -> Self {
        let remedy = match source {
            DenoiseError::NotFound { .. } | DenoiseError::Unfit { .. } => install_hint(),
            _ => "leave out --denoise; what was painted goes on with --resume".to_owned(),
        };
        Self::Denoise { source, remedy }
    }
}
