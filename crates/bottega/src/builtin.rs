//! The built-in engine, prepared for the picture of a request.

use std::sync::Arc;

use bottega_engines::{BuiltinEngine, BuiltinOptions, Urgency};
use bottega_farm::{Expert, Goal, JobReport, JobSettings};
use bottega_image::Metadata;
use bottega_render::{PathSettings, integrator::Wave};

use crate::{
    devices::{DeviceChoice, DeviceSet, PainterWish, are_worth_waves, costs, incident_line, left_alone},
    error::Error,
    journal::name_of,
    loaded_scene::LoadedScene,
    method::Method,
    request::Request,
    session::Reporter,
    settings::{
        asks_for_agents, directions, filter, guide_agents, job_settings, max_depth, planned_samples, samples_in_time,
    },
    text::shown,
};

/// The built-in engine with scene, devices, method and job settings of a picture.
pub(crate) struct BuiltinPainter {
    pub(crate) subject: LoadedScene,
    pub(crate) engine: Arc<BuiltinEngine>,
    pub(crate) crew: DeviceSet,
    pub(crate) method: Method,
    pub(crate) settings: JobSettings,
}

impl BuiltinPainter {
    /// Chooses method, settings and devices, and makes the engine.
    ///
    /// - `subject`: the scene of the request.
    /// - `goal`: condition under which a zone is finished.
    /// - `urgency`: raised to [`Urgency::Crop`] if the request has a crop.
    pub(crate) fn open(
        request: &Request,
        subject: LoadedScene,
        experts: Vec<Expert>,
        goal: Goal,
        urgency: Urgency,
    ) -> Result<Self, Error> {
        let method = Method::of(request, &subject, max_depth(request, &subject));
        let settings = JobSettings { goal, ..job_settings(request, &subject, experts)? };
        let urgency = urgency.max(if request.film.crop.is_some() { Urgency::Crop } else { Urgency::Picture });
        let (engine, crew) = engine_for(request, &subject, &settings, urgency)?;
        Ok(Self { subject, engine: Arc::new(engine), crew, method, settings })
    }

    /// Returns a text with everything that determines the pixels; see [`name_of`].
    pub(crate) fn name(&self, request: &Request) -> String {
        name_of(request, &self.subject, &self.settings)
    }

    /// Returns the warnings to report before rendering begins.
    pub(crate) fn notes(&self, request: &Request) -> Vec<String> {
        let mut notes: Vec<String> = self.subject.warnings.iter().map(ToString::to_string).collect();
        notes.extend(self.method.note.clone());
        notes.extend(self.crew.notes.iter().cloned());
        let has_paths = self.method.photons.is_none()
            && self.subject.prepared.can_learn(self.subject.view, planned_samples(&self.settings));
        if wants_waves(request, &self.crew) {
            let paths = PathSettings { photons: self.method.photons, ..PathSettings::default() };
            let (prepared, layout) = (&self.subject.prepared, &self.settings.layout);
            let refusal = Wave::refusal(prepared, self.subject.view, &paths, layout);
            notes.extend(refusal.map(|why| format!("integrator.wavefront and boards do nothing here: {why}")));
        }
        if asks_for_agents(&request.guide) && !has_paths {
            let why = "--guide ala does nothing here: it is for paths in clear air, pictures of 128 × 128 pixels or more, \
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
        let Self { subject, crew, method, settings, .. } = self;
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
        metadata.set("filter", format!("{:?}", filter(request, subject)));
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
fn wants_waves(request: &Request, crew: &DeviceSet) -> bool {
    request.integrator.wavefront || (crew.gpus.is_empty() && are_worth_waves(&crew.boards, crew.threads))
}

/// Makes the built-in engine for a scene, and gathers the devices that render for it.
///
/// # Errors
/// A device requested by name is missing or does not support this picture.
pub fn own_engine(
    request: &Request,
    subject: &LoadedScene,
    job: &JobSettings,
) -> Result<(BuiltinEngine, DeviceSet), Error> {
    engine_for(request, subject, job, Urgency::Picture)
}

fn engine_for(
    request: &Request,
    subject: &LoadedScene,
    job: &JobSettings,
    urgency: Urgency,
) -> Result<(BuiltinEngine, DeviceSet), Error> {
    // Collect the settings of the integrator
    let depth = max_depth(request, subject);
    let photons = Method::of(request, subject, depth).photons;
    let settings = PathSettings {
        seed: request.seed,
        max_depth: depth,
        light_samples: request.integrator.light_samples,
        filter: filter(request, subject),
        sample_max: subject.hints.sample_max.unwrap_or(f32::INFINITY),
        guiding: directions(&request.guide),
        agents: guide_agents(&request.guide),
        planned_samples: planned_samples(job),
        photons,
        ..PathSettings::default()
    };
    // Gather the devices that support the scene
    let choice = DeviceChoice::of(&request.devices.names)
        .map_err(|allowed| Error::usage("these devices cannot be chosen", allowed))?
        .exactly(request.devices.exact)?;
    let memory = request.devices.memory_mb.map(|mib| u64::from(mib) << 20);
    let wanted = PainterWish { threads: job.processors, memory, joins: urgency == Urgency::Look };
    let mut crew = DeviceSet::gather(&choice, &wanted, &subject.prepared, &job.layout, photons.is_some())?;
    if !(crew.boards.is_empty() || wants_waves(request, &crew)) {
        crew.notes.push(left_alone(&crew.boards, crew.threads, &crew.gpus));
        crew.boards.clear();
    }
    // Make the engine, with rays as work units if that pays off
    let wavefront =
        wants_waves(request, &crew) && Wave::refusal(&subject.prepared, subject.view, &settings, &job.layout).is_none();
    let options =
        BuiltinOptions { view: subject.view, settings, layout: job.layout.clone(), threads: crew.threads, wavefront };
    let engine = |options| {
        let (scene, prepass) = (Arc::clone(&subject.prepared), Arc::clone(&subject.prepass));
        BuiltinEngine::on(scene, prepass, options, Arc::clone(&crew.resources)).with_urgency(urgency)
    };
    let first = engine(options.clone());
    // Only CPU threads learn guides, for a number of samples that must be estimated if the goal is a time.
    if !matches!(job.goal, Goal::Time(_)) || crew.threads == 0 {
        return Ok((first, crew));
    }
    let settings = PathSettings { planned_samples: samples_in_time(job, &first), ..settings };
    let timed = engine(BuiltinOptions { settings, ..options });
    Ok((timed, crew))
}
