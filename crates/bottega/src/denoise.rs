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

/// Name of the metadata entry that names the denoiser of a picture.
pub const KEY: &str = "denoised";

/// Loads and returns the denoiser if the request asks for one. Called before rendering, so that a missing library is found early.
/// `None`: the request asks for none.
///
/// # Errors
/// Open Image Denoise is not installed, or too old.
pub fn ready(request: &Request) -> Result<Option<Denoiser>, Error> {
    Ok(request.film.denoise.then(Denoiser::load).transpose()?)
}

/// Denoises a finished picture and reports progress. An unfinished picture stays as it is; so does one whose denoising the user
/// stops.
///
/// - `denoiser`: the denoiser; `None`: the request asks for none, and nothing is done.
///
/// # Errors
/// The denoiser fails.
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
    let mut progress = |share: f64| {
        reporter.tell(Event::Step { name: "denoising".to_owned(), share });
        if stop.is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let done = denoise(denoiser, request, report, metadata, &mut progress);
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

/// Denoises a picture in `report`, and names the denoiser in `metadata`. Returns the time it took.
///
/// - `progress`: called with the share that is done, 0 to 1; `Break` stops denoising.
///
/// # Errors
/// The denoiser fails, or `progress` has stopped it; the picture then stays noisy.
pub fn denoise(
    denoiser: &Denoiser,
    request: &Request,
    report: &mut JobReport,
    metadata: &mut Metadata,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Duration, DenoiseError> {
    let begun = Instant::now();
    let Denoised { film, guides } = denoiser.denoise(&report.film, GuideUse::Denoised, threads(request), progress)?;
    report.film = film;
    let helped: Vec<&str> = std::iter::once("color").chain(guides.into_iter().map(Aov::name)).collect();
    metadata.set(KEY, format!("Open Image Denoise {} of {}", denoiser.version(), helped.join(", ")));
    Ok(begun.elapsed())
}

/// Denoises a complete picture whose job this machine has led for others, if the request asks for it. A partial picture stays as
/// it is.
///
/// # Errors
/// As for [`ready`]; or the denoiser fails.
pub fn here(request: &Request, report: &mut JobReport, metadata: &mut Metadata) -> Result<(), Error> {
    let Some(denoiser) = ready(request)?.filter(|_| !report.stopped && report.failed.is_empty()) else { return Ok(()) };
    denoise(&denoiser, request, report, metadata, &mut |_| ControlFlow::Continue(()))?;
    Ok(())
}

/// Returns a warning if a picture completed by another machine should be denoised and is not, or cannot be read; `None`: it is
/// denoised, or need not be.
///
/// - `output`: file name of the picture; its extension gives the format.
/// - `picture`: the file's bytes.
pub fn lacking(request: &Request, output: &Path, picture: &[u8]) -> Option<String> {
    let is_denoised = || {
        let file = read_image_bytes(output, picture, ReadLimits { max_pixels: u64::MAX }).ok()?;
        file.metadata.get(KEY).map(drop)
    };
    let is_lacking = request.film.denoise && is_denoised().is_none();
    is_lacking.then(|| "the picture is not denoised: the machine that led the job has no Open Image Denoise".to_owned())
}
