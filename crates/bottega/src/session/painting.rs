//! A session whose job is running, up to its finished picture.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bottega_denoise::Denoiser;
use bottega_farm::{JobReport, JobSettings, StopSwitch, simulate::Recorder};

use super::{lighting_agents, occupation, painter::Painter, reporter::Reporter};
use crate::{
    denoise,
    error::Error,
    events::{Event, ForecastEvent},
    picture::Picture,
    request::Request,
    tev::TevMirror,
    text::shown,
};

/// A session whose job is running.
pub struct ActiveSession {
    pub(super) request: Request,
    /// The request that is stored in the picture.
    pub(super) submitted: Request,
    pub(super) painter: Painter,
    pub(super) settings: JobSettings,
    pub(super) denoiser: Option<Denoiser>,
    pub(super) reporter: Arc<Reporter>,
    /// The record file, and the recorder of zone times.
    pub(super) recorder: Option<(PathBuf, Arc<Recorder>)>,
    pub(super) journal: Option<PathBuf>,
    /// The timeline file of processors and devices.
    pub(super) timeline: Option<PathBuf>,
    /// The connection to the tev viewer.
    pub(super) tev: Option<Arc<TevMirror>>,
}

impl ActiveSession {
    /// Returns the reporter of the job.
    pub fn reporter(&self) -> &Arc<Reporter> {
        &self.reporter
    }

    /// Returns the journal beside the output; `None`: the session has none.
    pub fn journal(&self) -> Option<&Path> {
        self.journal.as_deref()
    }

    /// Ends the session without a picture, because another machine has completed the job.
    pub fn leave(&self) {
        self.reporter.finish();
    }

    /// Makes the picture from the report of the job: reports statistics, and denoises if requested. Does not write the output.
    ///
    /// # Errors
    /// The picture cannot be denoised, its record cannot be made, or the edges between the zones of two engines cannot be
    /// examined.
    pub fn finish(self, report: JobReport, stop: &StopSwitch) -> Result<Picture, Error> {
        let Self { request, submitted, painter, settings, denoiser, reporter, recorder, journal, timeline, tev } = self;
        reporter.finish();
        if let Some(forecast) = &report.forecast {
            reporter.tell(Event::Forecast(ForecastEvent::new(forecast, report.jobs_learnt)));
        }
        painter.tell(&settings, &report, &reporter)?;
        if let Painter::Own(own) = &painter {
            occupation::tell(own, timeline.as_deref(), &reporter);
        }
        let is_whole = !report.stopped && report.failed.is_empty();
        // Write the record of a complete picture
        if let (Some((path, recorder)), true) = (&recorder, is_whole) {
            let record = recorder.record(&shown(&request.scene.file), &settings, &report);
            let record = record.map_err(|source| Error::Record { path: path.clone(), source })?;
            match std::fs::write(path, record.to_json()) {
                Ok(()) => reporter.tell(Event::Recorded { file: shown(path) }),
                // A lost record must not lose the picture.
                Err(error) => reporter.warn(format!("the record {} is lost: {error}", path.display())),
            }
        }
        // Denoise the picture if requested
        let mut report = report;
        let mut metadata = painter.metadata(&submitted, &report);
        denoise::finish(denoiser.as_ref(), &request, &mut report, &mut metadata, &reporter, stop)?;
        if let Painter::Own(own) = &painter
            && let Some(swarm) = own.engine.lighting_agents()
        {
            lighting_agents::tell(&swarm, &reporter, &mut metadata);
        }
        if let Painter::Own(own) = &painter
            && let Some([photons, all]) = own.engine.zones_by_photons()
        {
            metadata.set("zones_by_photons", format!("{photons} of {all}"));
            let rest = all - photons;
            reporter.tell(Event::Note {
                message: format!("auto: photons rendered {photons} of {all} zones, paths {rest}"),
            });
        }
        if let Some(Err(problem)) = tev.map(|tev| tev.finish(&report.film)) {
            reporter.warn(format!("tev does not show the picture: {problem}"));
        }
        let alpha = painter.hints().is_some_and(|hints| hints.alpha);
        Ok(Picture { request, metadata, settings, report, alpha, reporter, journal })
    }
}
