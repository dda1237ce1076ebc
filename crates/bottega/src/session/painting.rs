//! A picture while it is painted, and what is made of it in the end.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bottega_farm::{Goal, JobReport, JobSettings, StopSwitch, simulate::Recorder};
use bottega_image::Aov;

use super::{Reporter, Session, hand::Hand, lighting_agents};
use crate::{denoise, error::Error, events::Event, picture::Picture, text::shown};

/// A session whose picture is being painted.
pub struct Painting {
    pub(super) session: Session,
    pub(super) reporter: Arc<Reporter>,
    pub(super) recorder: Option<Arc<Recorder>>,
    pub(super) journal: Option<PathBuf>,
}

impl Painting {
    /// Who is told.
    pub fn reporter(&self) -> &Arc<Reporter> {
        &self.reporter
    }

    /// The session.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The journal beside the output, where what is painted is kept.
    pub fn journal(&self) -> Option<&Path> {
        self.journal.as_deref()
    }

    /// Nothing is painted here any more: another machine has led the picture to its end.
    pub fn leave(&self) {
        self.reporter.finish();
    }

    /// Makes the picture of what the agents came to: tells of it, denoises it where that is asked for, and writes it.
    ///
    /// # Errors
    /// The picture cannot be denoised, recorded or written.
    pub fn finish(self, report: JobReport, stop: &StopSwitch) -> Result<Picture, Error> {
        let Self { session, reporter, recorder, journal } = self;
        reporter.finish();
        session.hand.tell(&session.settings, &report, &reporter)?;
        let is_whole = !report.stopped && report.failed.is_empty();
        if let (Some(path), Some(recorder), true) = (&session.options.record, recorder, is_whole) {
            let record = recorder.record(&shown(&session.request.scene.file), &session.settings, &report);
            let record = record.map_err(|source| Error::Record { path: path.clone(), source })?;
            std::fs::write(path, record.to_json()).map_err(|source| Error::Write { path: path.clone(), source })?;
            reporter.tell(Event::Recorded { file: shown(path) });
        }
        let mut report = report;
        let mut metadata = session.hand.metadata(&session.asked, &report);
        denoise::finish(session.denoiser.as_ref(), &session.request, &mut report, &mut metadata, &reporter, stop)?;
        if let Hand::Own(own) = &session.hand
            && let Some(swarm) = own.engine.lighting_agents()
        {
            lighting_agents::tell(&swarm, &reporter, &mut metadata);
        }
        let alpha = session.hand.hints().is_some_and(|hints| hints.alpha);
        let Session { request, settings, .. } = session;
        let picture = Picture { request, metadata, settings, report, alpha, reporter, journal };
        picture.write()?;
        Ok(picture)
    }
}

/// Samples of all pixels. Where cells stop by their error only the film knows them.
pub(crate) fn samples_taken(report: &JobReport, settings: &JobSettings) -> u64 {
    if matches!(settings.goal, Goal::Error(_)) {
        let film = &report.film;
        return film.rect().pixels().map(|(x, y)| film.aov(Aov::SampleCount, x, y)[0] as u64).sum();
    }
    report.rows.iter().map(|row| row.size() * u64::from(row.samples_done())).sum()
}
