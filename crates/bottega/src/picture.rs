//! Rendered pictures: pixels, metadata, report, and their files.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_farm::{Goal, JobReport, JobSettings};
use bottega_image::{
    Aov, Film, Metadata, OutputFormat, PngOptions, ReadLimits, Rect, SampleValues, Tile, write_exr, write_png,
};
use bottega_scene::RenderHints;

use crate::{
    brightness::brightness_warning,
    error::Error,
    events::Event,
    request::{PIXELS_MAX, Request},
    session::Reporter,
    settings::{encoding, exr_options, tone},
    text::shown,
};

/// Name of the metadata entry that holds the request of a picture.
pub const REQUEST_KEY: &str = "request";

/// A picture, complete or partial, with its metadata and the report of its job.
pub struct Picture {
    pub(crate) request: Request,
    pub(crate) metadata: Metadata,
    pub(crate) settings: JobSettings,
    pub(crate) report: JobReport,
    /// True if the scene file asks for alpha in a PNG.
    pub(crate) alpha: bool,
    pub(crate) reporter: Arc<Reporter>,
    pub(crate) journal: Option<PathBuf>,
}

impl Picture {
    /// Returns the request of the picture.
    pub fn request(&self) -> &Request {
        &self.request
    }

    /// Returns the pixels with all layers, in linear light.
    pub fn film(&self) -> &Film {
        &self.report.film
    }

    /// Returns the metadata: how the picture was made.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Returns the report of the job: rows of all zones, times, number of messages.
    pub fn report(&self) -> &JobReport {
        &self.report
    }

    /// Returns the settings of the job.
    pub fn settings(&self) -> &JobSettings {
        &self.settings
    }

    /// Returns true if the picture is complete: all zones are painted, and the user has stopped neither rendering nor denoising.
    pub fn is_whole(&self) -> bool {
        !self.report.stopped && self.report.failed.is_empty()
    }

    /// Writes the picture to a file, .exr or .png, with the output settings of its request.
    ///
    /// # Errors
    /// The extension is neither of these, or the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let hints = RenderHints { alpha: self.alpha, ..RenderHints::default() };
        write(&self.request, Some(&hints), path.as_ref(), &self.report.film, &self.metadata)
    }

    /// Returns the picture as the bytes of a PNG file, with the output settings of its request.
    ///
    /// # Errors
    /// The picture has no pixels.
    pub fn to_png(&self) -> Result<Vec<u8>, Error> {
        let options = png_options(&self.request, self.alpha);
        Ok(bottega_image::png_bytes(&self.report.film, &options, &self.metadata)?)
    }

    /// Writes the picture to the output of its request, if any.
    ///
    /// # Errors
    /// Those of [`Self::save`].
    pub fn write(&self) -> Result<(), Error> {
        self.request.output.file.as_deref().map_or(Ok(()), |file| self.save(file))
    }

    /// Writes the picture like [`Self::write`], then closes it like [`Self::close`]. Returns it.
    ///
    /// # Errors
    /// The picture cannot be written, or zones could not be painted.
    pub fn deliver(self) -> Result<Self, Error> {
        self.write()?;
        self.close()
    }

    /// Reports the end of the job, and removes the journal if the picture is complete. Returns the picture. For callers that must
    /// inform others of a written picture first; [`Self::deliver`] does everything.
    ///
    /// # Errors
    /// Zones could not be painted.
    pub fn close(self) -> Result<Self, Error> {
        let Self { report, settings, reporter, .. } = &self;
        let seconds = report.times.total.as_secs_f64();
        let output = self.request.output.file.as_deref().map(shown).unwrap_or_default();
        let samples = samples_taken(report, settings);
        if report.stopped {
            let wanted = settings.crop.area() * u64::from(settings.samples);
            reporter.tell(Event::Interrupted { output, seconds, done: samples as f64 / wanted as f64 });
            return Ok(self);
        }
        if !report.failed.is_empty() {
            let output = if output.is_empty() { "the picture".to_owned() } else { output };
            return Err(Error::failed(
                format!("{} zones could not be painted; {output} lacks them", report.failed.len()),
                "see the messages above; --resume tries them again",
            ));
        }
        // Remove the journal; if that fails, the picture is still good.
        if let Some(journal) = &self.journal
            && let Err(error) = fs::remove_file(journal)
        {
            reporter.warn(format!("cannot remove {}: {error}", journal.display()));
        }
        self.warn_of_brightness();
        let painting = report.times.painting.as_secs_f64() / settings.processors as f64;
        let overhead = (1.0 - painting / seconds).max(0.0);
        reporter.tell_auction();
        reporter.tell(Event::Finished {
            output,
            seconds,
            samples,
            utilization: 1.0 - overhead,
            overhead,
            bands: report.band_share(&settings.crop),
            composition: report.times.composition.as_secs_f64() / seconds,
        });
        Ok(self)
    }

    /// Warns of a PNG that appears nearly black or white.
    fn warn_of_brightness(&self) {
        let Some(file) = &self.request.output.file else { return };
        if let Some(problem) = wrong_brightness(&self.request, file, self.film()) {
            self.reporter.warn(format!("{} {problem}", shown(file)));
        }
    }
}

/// Returns a warning about the brightness of a picture; `None`: it is fine, or the file is not a PNG.
pub(crate) fn wrong_brightness(request: &Request, file: &Path, film: &Film) -> Option<String> {
    let is_for_screens = matches!(OutputFormat::of(file), Ok(OutputFormat::Png));
    if is_for_screens { brightness_warning(film, request.output.exposure) } else { None }
}

/// Returns the number of samples over all pixels. With a goal of error or time only the film knows the number per pixel.
fn samples_taken(report: &JobReport, settings: &JobSettings) -> u64 {
    if settings.goal != Goal::Samples {
        let film = &report.film;
        return film.rect().pixels().map(|(x, y)| film.aov(Aov::SampleCount, x, y)[0] as u64).sum();
    }
    report.rows.iter().map(|row| row.size() * u64::from(row.samples_done())).sum()
}

/// Estimates the time for denoising and encoding the picture, from the measured time for a small one under the present load.
///
/// - `denoises`: true if the picture will be denoised; the time for that is a constant per pixel.
pub(crate) fn finishing(request: &Request, settings: &JobSettings, denoises: bool) -> Duration {
    /// Side of the small picture, in pixels.
    const SIDE: u32 = 64;
    /// Time to denoise one pixel on one processor.
    const DENOISING: Duration = Duration::from_nanos(4_000);
    /// Fixed time per picture: joining threads, opening files.
    const LEAST: Duration = Duration::from_millis(30);
    let begun = Instant::now();
    let small = Rect::of_size(SIDE, SIDE);
    let mut tile = Tile::new(small, settings.layout.clone());
    for (x, y) in small.pixels() {
        // Neighbors differ, as in a noisy picture.
        let radiance = [x, y, x ^ y].map(|place| (place.wrapping_mul(0x9e37_79b9) >> 16) as f32 / 65536.0);
        tile.add(x, y, &SampleValues { radiance, alpha: 1.0, ..SampleValues::default() });
    }
    let mut film = Film::new(small, settings.layout.clone());
    film.add_tile(&tile, |_, _| 1.0);
    // An error of encoding is reported when the picture is written.
    let _ = bottega_image::png_bytes(&film, &png_options(request, false), &Metadata::new());
    let measured = begun.elapsed().as_secs_f64() / small.area() as f64;
    let denoising = if denoises { DENOISING.as_secs_f64() / settings.processors.max(1) as f64 } else { 0.0 };
    LEAST + Duration::from_secs_f64((measured + denoising) * settings.crop.area() as f64)
}

/// Writes a picture as .exr or .png, by the extension of `path`.
///
/// - `hints`: render hints of the scene file; `None` with an external engine.
pub(crate) fn write(
    request: &Request,
    hints: Option<&RenderHints>,
    path: &Path,
    film: &Film,
    metadata: &Metadata,
) -> Result<(), Error> {
    let output = &request.output;
    match OutputFormat::of(path)? {
        OutputFormat::Exr => {
            write_exr(path, film, metadata, exr_options(output))?;
        }
        OutputFormat::Png => {
            write_png(path, film, &png_options(request, hints.is_some_and(|hints| hints.alpha)), metadata)?;
        }
    }
    Ok(())
}

/// Returns the PNG options of a request.
///
/// - `alpha`: true if the scene file asks for alpha.
fn png_options(request: &Request, alpha: bool) -> PngOptions {
    let output = &request.output;
    PngOptions {
        exposure_stops: output.exposure,
        tone: tone(output.tonemap),
        encoding: encoding(output.encoding),
        alpha: output.alpha || alpha,
        ..PngOptions::default()
    }
}

/// Returns true if the output file exists, is complete and was made from an equal request, so that nothing is left to render.
pub fn is_done(request: &Request) -> bool {
    let Some(file) = request.output.file.as_deref().filter(|file| file.is_file()) else { return false };
    let Ok(picture) = bottega_image::read_image(file, ReadLimits { max_pixels: PIXELS_MAX }) else { return false };
    let is_whole = picture.metadata.get("complete").is_some_and(|complete| complete == "true");
    let held = picture.metadata.get(REQUEST_KEY).and_then(|line| Request::from_json(line.as_bytes()).ok());
    is_whole && held == Some(request.by_engine_of_scene())
}

/// Reads the request from the metadata of a picture file, and returns it.
///
/// # Errors
/// The file cannot be read, is not a picture, or holds no valid request.
pub fn request_of(path: &Path) -> Result<Request, Error> {
    let file = bottega_image::read_image(path, ReadLimits { max_pixels: PIXELS_MAX })?;
    let Some(line) = file.metadata.get(REQUEST_KEY) else {
        return Err(Error::usage(
            format!("`{}` does not contain its request", path.display()),
            "it was made by another program or an older version: give a scene or a request",
        ));
    };
    Request::from_json(line.as_bytes())
        .map_err(|source| Error::Request { origin: format!("the picture `{}`", path.display()), source })
}
