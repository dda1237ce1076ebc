//! The built-in engine, prepared for the picture of a request.

use std::{sync::Arc, time::Instant};

use bottega_engines::{BuiltinEngine, BuiltinOptions, CancelSwitch, Urgency};
use bottega_farm::{Goal, JobReport};
use bottega_image::Metadata;
use bottega_render::{PathSettings, integrator::Wave};

use crate::{
    devices::{DeviceSet, PainterWish, are_worth_waves, costs, incident_line, left_alone},
    error::Error,
    journal::name_of,
    loaded_scene::LoadedScene,
    plan::Plan,
    request::Request,
    session::Reporter,
    text::shown,
};

/// The built-in engine with scene, devices and plan of a picture.
pub(crate) struct BuiltinPainter {
    pub(crate) subject: LoadedScene,
    pub(crate) engine: Arc<BuiltinEngine>,
    pub(crate) crew: DeviceSet,
    pub(crate) plan: Plan,
}

impl BuiltinPainter {
    /// Gathers the devices of a plan that support the scene, and makes the engine.
    ///
    /// # Errors
    /// A device requested by name is missing or does not support this picture.
    pub(crate) fn open(plan: Plan, subject: LoadedScene) -> Result<Self, Error> {
        // Gather the devices that support the scene
        let Plan { job, paths, .. } = &plan;
        let wanted =
            PainterWish { threads: job.processors, memory: plan.gpu_memory, joins: plan.urgency == Urgency::Look };
        let has_photons = paths.photons.is_some();
        let mut crew = DeviceSet::gather(&plan.devices, &wanted, &subject.prepared, &job.layout, has_photons)?;
        if !(crew.boards.is_empty() || wants_waves(&plan, &crew)) {
            crew.notes.push(left_alone(&crew.boards, crew.threads, &crew.gpus));
            crew.boards.clear();
        }
        // Make the engine, with rays as work units if that pays off
        let wavefront =
            wants_waves(&plan, &crew) && Wave::refusal(&subject.prepared, subject.view, paths, &job.layout).is_none();
        let engine = |planned_samples| {
            let options = BuiltinOptions {
                view: subject.view,
                settings: PathSettings { planned_samples, ..*paths },
                layout: job.layout.clone(),
                threads: crew.threads,
                wavefront,
            };
            let (scene, prepass) = (Arc::clone(&subject.prepared), Arc::clone(&subject.prepass));
            BuiltinEngine::on(scene, prepass, options, Arc::clone(&crew.resources)).with_urgency(plan.urgency)
        };
        let mut made = engine(paths.planned_samples);
        // Only CPU threads learn guides, for a number of samples that must be estimated if the goal is a time.
        if matches!(job.goal, Goal::Time(_)) && crew.threads > 0 {
            made = engine(samples_in_time(&plan, &made));
        }
        Ok(Self { subject, engine: Arc::new(made), crew, plan })
    }

    /// Returns a text with everything that determines the pixels; see [`name_of`].
    pub(crate) fn name(&self, request: &Request) -> String {
        name_of(request, &self.subject, &self.plan)
    }

    /// Returns the warnings to report before rendering begins.
    pub(crate) fn notes(&self) -> Vec<String> {
        let Self { subject, crew, plan, .. } = self;
        let mut notes = plan.notes.clone();
        notes.extend(subject.warnings.iter().map(ToString::to_string));
        notes.extend(plan.method.note.clone());
        notes.extend(crew.notes.iter().cloned());
        if wants_waves(plan, crew) {
            let paths = PathSettings { photons: plan.paths.photons, ..PathSettings::default() };
            let refusal = Wave::refusal(&subject.prepared, subject.view, &paths, &plan.job.layout);
            notes.extend(refusal.map(|why| format!("integrator.wavefront and boards do nothing here: {why}")));
        }
        let learns_paths =
            plan.paths.photons.is_none() && subject.prepared.can_learn(subject.view, plan.paths.planned_samples);
        if plan.wants_agents && !learns_paths {
            let why = "--guide ala does nothing here: it is for paths in clear air where nothing moves, pictures of 128 × 128 pixels or more, \
                       and 524288 samples or more, all pixels together";
            notes.push(why.to_owned());
        }
        notes
    }

    /// Reports the faults of devices, and stores the measured costs of work on them.
    pub(crate) fn tell_of_devices(&self, reporter: &Reporter) {
        if self.crew.gpus.is_empty() && self.crew.boards.is_empty() {
            return;
        }
        let report = self.engine.report();
        for incident in &report.incidents {
            reporter.warn(format!("{}; its work was done elsewhere", incident_line(&report, incident)));
        }
        // Costs of boards are not stored: another board may get the same address.
        if !self.crew.gpus.is_empty() {
            costs::keep(&report);
        }
    }

    /// Returns the metadata of the picture: how it was made.
    pub(crate) fn metadata(&self, request: &Request, report: &JobReport) -> Metadata {
        let Self { subject, crew, plan: Plan { method, job: settings, paths, .. }, .. } = self;
        let mut metadata = Metadata::new();
        metadata.set("scene", shown(&request.scene.file));
        metadata.set("scene_digest", &*subject.scene().digest);
        metadata.set("camera", &*subject.camera().name);
        metadata.set("samples_per_pixel", settings.samples.to_string());
        match settings.goal {
            Goal::Samples => {}
            Goal::Error(error) => metadata.set("error_asked", error.to_string()),
            Goal::Time(_) => metadata.set("time_asked", request.goal.time.unwrap_or_default().to_string()),
        }
        metadata.set("max_depth", settings.tunables.max_depth.to_string());
        metadata.set("light_samples", request.integrator.light_samples.to_string());
        metadata.set("seed", request.seed.to_string());
        metadata.set("integrator", method.word());
        if let Some(photons) = &method.photons {
            metadata.set("photons", photons.count.to_string());
            metadata.set("progressive", photons.progressive.to_string());
        }
        if let Some(hint) = &subject.hints.integrator {
            metadata.set("integrator_of_scene", &*hint.name);
        }
        metadata.set("filter", format!("{:?}", paths.filter));
        metadata.set("optimize", settings.optimization.to_string());
        metadata.set("level", request.work.level.to_string());
        metadata.set("agents", settings.agents.to_string());
        metadata.set("threads", crew.threads.to_string());
        metadata.set("devices", crew.names());
        metadata.set("exact", crew.gpus.is_empty().to_string());
        metadata.set("render_seconds", format!("{:.3}", report.times.total.as_secs_f64()));
        metadata.set("complete", (!report.stopped).to_string());
        metadata
    }
}

/// Returns true if rays are work units of their own. Boards trace only such rays; a GPU renders whole paths much faster.
fn wants_waves(plan: &Plan, crew: &DeviceSet) -> bool {
    plan.wants_waves || (crew.gpus.is_empty() && are_worth_waves(&crew.boards, crew.threads))
}

/// Returns the samples per pixel that a time limit allows, measured with a short trial of the engine under the present load.
/// Learning is planned for this number.
fn samples_in_time(plan: &Plan, engine: &BuiltinEngine) -> u32 {
    /// Columns and rows of the trial, and the share of the time spent on tracing paths.
    const LOOK: (u32, u32) = (48, 36);
    const PAINTING: f64 = 0.8;
    let planned = plan.paths.planned_samples;
    let Goal::Time(time) = plan.job.goal else { return planned };
    let begun = Instant::now();
    if !matches!(engine.glimpse(LOOK, 1, &CancelSwitch::default()), Ok(Some(_))) {
        return planned;
    }
    let path = begun.elapsed().as_secs_f64() / f64::from(LOOK.0 * LOOK.1);
    let samples = PAINTING * time.as_secs_f64() / (path * plan.job.crop.area() as f64).max(1e-9);
    (samples as u32).clamp(1, planned)
}
