//! Denoising of a finished picture.

use std::{
    ops::ControlFlow,
    path::Path,
    time::{Duration, Instant},
};

use bottega_denoise::{DenoiseError, Denoised, Denoiser, GuideUse};
use bottega_farm::{JobReport, StopSwitch};
use bottega_image::{Aov, Metadata, ReadLimits, read_image_bytes};

use crate::{devices::threads, error::Error, events::Event, request::Request, session::Reporter};

/// Under which name a picture says by what it was denoised.
pub const KEY: &str = "denoised";

/// The denoiser, where one is asked for: found before anything is painted.
pub fn ready(request: &Request) -> Result<Option<Denoiser>, Error> {
    Ok(request.film.denoise.then(Denoiser::load).transpose()?)
}

/// Denoises a finished picture, and tells how far it is. One that is not finished stays as it is; one that the user stops
/// meanwhile, too.
pub(crate) fn finish(
    denoiser: Option<&Denoiser>,
    request: &Request,
    report: &mut JobReport,
    metadata: &mut Metadata,
    reporter: &Reporter,
    stop: &StopSwitch,
) -> Result<(), Error> {
    let Some(denoiser) = denoiser else { return Ok(()) };
    if report.stopped || !report.failed.is_empty() {
        return Ok(());
    }
    let mut told = |share: f64| {
        reporter.tell(Event::Step { name: "denoising".to_owned(), share });
        if stop.is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let done = denoise(denoiser, request, report, metadata, &mut told);
    match done {
        Ok(took) => {
            let by = metadata.get(KEY).unwrap_or_default().to_owned();
            reporter.tell(Event::Denoised { by, seconds: took.as_secs_f64() });
            Ok(())
        }
        Err(DenoiseError::Cancelled) => {
            report.stopped = true;
            metadata.set("complete", "false");
            Ok(())
        }
        Err(error) => Err(error.into()),
    }
}

/// Denoises a picture, and has its metadata say so. How long it took.
pub fn denoise(
    denoiser: &Denoiser,
    request: &Request,
    report: &mut JobReport,
    metadata: &mut Metadata,
    told: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Duration, DenoiseError> {
    let begun = Instant::now();
    let Denoised { film, guides } = denoiser.denoise(&report.film, GuideUse::Denoised, threads(request), told)?;
    report.film = film;
    let helped: Vec<&str> = std::iter::once("color").chain(guides.into_iter().map(Aov::name)).collect();
    metadata.set(KEY, format!("Open Image Denoise {} of {}", denoiser.version(), helped.join(", ")));
    Ok(begun.elapsed())
}

/// Denoises a picture that this machine has led for others, if they have asked for that.
pub fn here(request: &Request, report: &mut JobReport, metadata: &mut Metadata) -> Result<(), Error> {
    let Some(denoiser) = ready(request)?.filter(|_| !report.stopped && report.failed.is_empty()) else { return Ok(()) };
    denoise(&denoiser, request, report, metadata, &mut |_| ControlFlow::Continue(()))?;
    Ok(())
}

/// What is to be told of a picture that another machine has led to its end, and that should be denoised and is not.
///
/// - `picture`: the file's bytes.
/// - `output`: its name.
pub fn lacking(request: &Request, output: &Path, picture: &[u8]) -> Option<String> {
    let is_denoised = || {
        let file = read_image_bytes(output, picture, ReadLimits { max_pixels: u64::MAX }).ok()?;
        file.metadata.get(KEY).map(drop)
    };
    let is_lacking = request.film.denoise && is_denoised().is_none();
    is_lacking
        .then(|| "the machine that led it to its end has no Open Image Denoise: the picture keeps its noise".to_owned())
}
