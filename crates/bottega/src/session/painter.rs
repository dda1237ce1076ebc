//! The engine of a session: the built-in one or an external one.

use std::sync::Arc;

use bottega_engines::RenderEngine;
use bottega_farm::{JobReport, JobSettings, Optimization, Subject};
use bottega_image::{Metadata, Rect, seams};
use bottega_scene::RenderHints;

use super::Reporter;
use crate::{
    agent_rules::{AgentRules, RuleTexts},
    builtin::BuiltinPainter,
    engines::ExternalPainter,
    error::Error,
    events::{EngineShare, Event, corners},
    loaded_scene::LoadedScene,
    picture::REQUEST_KEY,
    plan::{PicturePart, Plan},
    request::{Request, ViewOptions},
    text::shown,
};

/// The p-value below which the seams between the zones of two engines count as visible.
const SEAMS_SEEN: f64 = 1e-4;

/// The engine of a session, prepared for its picture.
pub(super) enum Painter {
    Own(Box<BuiltinPainter>),
    Other(Box<ExternalPainter>),
}

/// A picture whose engine is prepared.
pub(super) struct OpenedPicture {
    pub(super) painter: Painter,
    /// A text with everything that determines the pixels; `None`: zones of another process's job by an external engine.
    pub(super) name: Option<String>,
    /// The settings of the job.
    pub(super) settings: JobSettings,
    /// The texts of the agents' rules.
    pub(super) rules: RuleTexts,
    /// Warnings, to report before rendering begins.
    pub(super) notes: Vec<String>,
}

/// The values with which rendering begins.
pub(super) struct Beginning {
    /// The event that reports the start.
    pub(super) started: Event,
    pub(super) engine: Arc<dyn RenderEngine>,
    /// Returns the number of samples taken so far, over all pixels.
    pub(super) counter: Box<dyn Fn() -> u64 + Send>,
}

impl Painter {
    /// Loads the scene of a request and makes its engine.
    ///
    /// # Errors
    /// The scene, the rules or the engine of the request cannot be used.
    pub(super) fn open(request: &Request, part: &PicturePart<'_>) -> Result<OpenedPicture, Error> {
        let rules = AgentRules::of(request)?.turned(part.turn());
        if request.engine.is_builtin() {
            return Self::of_scene(request, LoadedScene::load(request)?, rules, part);
        }
        let texts = rules.texts.clone();
        let painter = ExternalPainter::open(request, rules, part)?;
        // A name is for a journal, which zones of another process's job do not have
        let is_whole = matches!(part, PicturePart::Whole { .. });
        let name = is_whole.then(|| painter.name(request)).transpose()?;
        let notes = painter.notes.clone();
        Ok(Self::Other(Box::new(painter)).opened(request, name, texts, notes))
    }

    /// Plans the picture of a loaded scene and makes the built-in engine for it.
    ///
    /// # Errors
    /// The scene cannot be rendered as the request asks.
    pub(super) fn of_scene(
        request: &Request,
        scene: LoadedScene,
        rules: AgentRules,
        part: &PicturePart<'_>,
    ) -> Result<OpenedPicture, Error> {
        let texts = rules.texts.clone();
        let plan = Plan::of(request, &scene, rules, part)?;
        let painter = BuiltinPainter::open(request, plan, scene)?;
        let (name, notes) = (painter.name.clone(), painter.notes.clone());
        Ok(Self::Own(Box::new(painter)).opened(request, Some(name), texts, notes))
    }

    /// Completes the settings of the job by what earlier and later jobs know it by.
    fn opened(self, request: &Request, name: Option<String>, rules: RuleTexts, notes: Vec<String>) -> OpenedPicture {
        let planned = match &self {
            Self::Own(own) => &own.plan.job,
            Self::Other(painter) => &painter.settings,
        };
        let technique = self.technique(planned).into();
        let settings = JobSettings { technique, subject: self.subject(request, planned), ..planned.clone() };
        OpenedPicture { painter: self, name, settings, rules, notes }
    }

    /// Returns the identity of an external engine, the same on all machines that have it; `None`: the built-in engine.
    pub(super) fn identity(&self) -> Option<String> {
        match self {
            Self::Own(_) => None,
            Self::Other(painter) => Some(painter.located.identity()),
        }
    }

    /// Logs the faults of devices and engines on this machine, which has no user.
    pub(super) fn log_faults(&self) {
        match self {
            Self::Own(own) => own.devices.notes.iter().for_each(|note| tracing::warn!("{note}")),
            Self::Other(painter) => painter.engine.watch_faults(|fault| tracing::warn!("{fault}")),
        }
    }

    pub(super) fn engine(&self) -> Arc<dyn RenderEngine> {
        match self {
            Self::Own(own) => Arc::clone(&own.engine) as _,
            Self::Other(painter) => painter.paints(),
        }
    }

    /// Returns the values with which rendering begins.
    pub(super) fn begin(&self, request: &Request, settings: &JobSettings) -> Beginning {
        Beginning { started: self.started(request, settings), engine: self.engine(), counter: self.counter() }
    }

    /// Returns a key of everything but the scene that decides the time per path: engine, integrator, devices. Times are learned
    /// per key.
    fn technique(&self, settings: &JobSettings) -> String {
        let mut technique = match self {
            Self::Own(own) => {
                let progressive = own.plan.method.photons.is_some_and(|photons| photons.progressive);
                let devices = own.devices.gpus.iter().map(|gpu| format!(" on {gpu}")).collect::<String>();
                format!("builtin {}{}{devices}", own.plan.method.word(), if progressive { " progressive" } else { "" })
            }
            Self::Other(painter) => painter.title(),
        };
        if settings.optimization != Optimization::Off {
            technique += &format!(" at {}", settings.optimization);
        }
        if settings.tunables.light_samples > 1 {
            technique += &format!(" with {} light samples", settings.tunables.light_samples);
        }
        technique
    }

    /// Returns the identity of the picture, by which a later job recognizes it; unknown for other engines, whose scene files are
    /// not read here.
    fn subject(&self, request: &Request, settings: &JobSettings) -> Subject {
        let Self::Own(own) = self else { return Subject::default() };
        let loaded = &own.subject;
        let (width, height, crop) = (f64::from(settings.width), f64::from(settings.height), settings.crop);
        // The same part of the picture at another resolution is the same view
        let thousandth = |side: u32, of: f64| (1e3 * f64::from(side) / of).round();
        let part = [
            thousandth(crop.x0, width),
            thousandth(crop.y0, height),
            thousandth(crop.x1, width),
            thousandth(crop.y1, height),
        ];
        let view = format!(
            "{} {:?} {part:?} {:.2} {:?}",
            loaded.camera,
            ViewOptions { camera: None, ..request.view.clone() },
            width / height,
            request.environment.light,
        );
        let digest = |text: &str| blake3::hash(text.as_bytes()).to_hex()[..16].to_owned();
        Subject { scene: digest(&loaded.scene().digest).into(), view: digest(&view).into() }
    }

    pub(super) fn counter(&self) -> Box<dyn Fn() -> u64 + Send> {
        match self {
            Self::Own(own) => {
                let engine = Arc::clone(&own.engine);
                Box::new(move || engine.samples_done())
            }
            Self::Other(painter) => Box::new(painter.counter()),
        }
    }

    /// Returns the render hints of the scene file; `None` with an external engine.
    pub(super) fn hints(&self) -> Option<&RenderHints> {
        match self {
            Self::Own(own) => Some(&own.subject.hints),
            Self::Other(_) => None,
        }
    }

    pub(super) fn metadata(&self, request: &Request, report: &JobReport) -> Metadata {
        let mut metadata = match self {
            Self::Own(own) => own.metadata(request, report),
            Self::Other(painter) => painter.metadata(request, report),
        };
        match request.to_line() {
            Ok(line) => metadata.set(REQUEST_KEY, line),
            // A file name that is not Unicode cannot be written as JSON; the picture then lacks its request.
            Err(error) => tracing::debug!(%error, "the picture does not contain its request"),
        }
        metadata
    }

    fn started(&self, request: &Request, settings: &JobSettings) -> Event {
        let (integrator, method, painters, triangles, threads, gpus, progressive) = match self {
            Self::Own(own) => (
                own.plan.method.word().to_owned(),
                own.plan.method.name().to_owned(),
                own.devices.names(),
                Some(own.subject.scene().triangle_count()),
                own.devices.threads,
                own.devices.gpus.clone(),
                own.plan.method.photons.is_some_and(|photons| photons.progressive),
            ),
            Self::Other(painter) => {
                let title = painter.title();
                (title.clone(), title.clone(), title, None, settings.processors, Vec::new(), false)
            }
        };
        Event::Started {
            version: 1,
            scene: shown(&request.scene.file),
            output: request.output.file.as_deref().map(shown).unwrap_or_default(),
            width: settings.width,
            height: settings.height,
            crop: corners(&settings.crop),
            samples_per_pixel: settings.samples,
            error: request.goal.error,
            time: request.goal.time.filter(|_| request.goal.error.is_none()),
            integrator,
            progressive,
            agents: settings.agents,
            threads,
            gpus,
            triangles,
            method,
            painters,
            seed: request.seed,
        }
    }

    /// Reports device faults, discarded samples and the share of each engine after rendering.
    pub(super) fn tell(&self, settings: &JobSettings, report: &JobReport, reporter: &Reporter) -> Result<(), Error> {
        match self {
            Self::Own(own) => {
                own.tell_of_devices(reporter);
                if own.engine.dropped_count() > 0 {
                    let count = own.engine.dropped_count();
                    reporter.warn(format!("{count} samples had no finite radiance and count as black"));
                }
                Ok(())
            }
            Self::Other(painter) => {
                if painter.engine.dropped_count() > 0 {
                    let count = painter.engine.dropped_count();
                    reporter.warn(format!("{count} pixels had no finite values and count as black"));
                }
                tell_mix(painter, settings.crop, report, reporter)
            }
        }
    }
}

/// Reports how many zones each of two engines painted, and warns if the seams between them are visible.
fn tell_mix(painter: &ExternalPainter, crop: Rect, report: &JobReport, reporter: &Reporter) -> Result<(), Error> {
    let Some(mix) = &painter.mix else { return Ok(()) };
    let engines = mix.mixed.zones_by_engine().into_iter();
    let engines = engines.map(|(engine, zones)| EngineShare { engine, zones }).collect();
    // Move the zones to the coordinates of the film, which begins at the crop.
    let moved = |rect: Rect| Rect::new(rect.x0 - crop.x0, rect.y0 - crop.y0, rect.x1 - crop.x0, rect.y1 - crop.y0);
    let rects: Vec<Rect> = report.rows.iter().map(|row| moved(row.rect)).collect();
    let found = seams(&report.film.to_picture(), None, &rects)?;
    reporter.tell(Event::Mixed { engines, seams_z: found.z, seams_p: found.p() });
    if found.p() < SEAMS_SEEN {
        reporter.warn("the edges of zones can be seen: the engines do not agree on this scene".to_owned());
    }
    Ok(())
}
