//! The built-in engine, prepared for the picture of a request.

use std::{sync::Arc, time::Instant};

use bottega_engines::{BuiltinEngine, BuiltinOptions, CancelSwitch, Urgency};
use bottega_farm::{Goal, JobReport};
use bottega_image::{Aov, Metadata, manifest, set_matte};
use bottega_render::{PathSettings, TechniqueJudge, integrator::Wave};
use bottega_scene::PartNames;

use crate::{
    devices::{DeviceSet, PainterWish, are_worth_waves, costs, incident_line, unused_boards_warning},
    error::Error,
    identity::identity,
    loaded_scene::LoadedScene,
    plan::Plan,
    request::{Request, ViewOptions},
    session::Reporter,
    settings::{catchers, light_groups},
    text::shown,
};

/// The built-in engine with scene, devices and plan of a picture.
pub(crate) struct BuiltinPainter {
    pub(crate) subject: LoadedScene,
    pub(crate) engine: Arc<BuiltinEngine>,
    pub(crate) devices: DeviceSet,
    pub(crate) plan: Plan,
    /// A text with everything that determines the pixels: two pictures with the same name have the same bits. It does not hold the
    /// number of agents and threads, so that another machine can resume the work.
    pub(crate) name: String,
    /// Warnings, to report before rendering begins.
    pub(crate) notes: Vec<String>,
}

impl BuiltinPainter {
    /// Gathers the devices of a plan that support the scene, and makes the engine.
    ///
    /// # Errors
    /// A device requested by name is missing or does not support this picture.
    pub(crate) fn open(request: &Request, mut plan: Plan, subject: LoadedScene) -> Result<Self, Error> {
        // Gather the devices that support the scene
        let Plan { job, paths, .. } = &plan;
        let wanted = PainterWish {
            threads: job.processors,
            memory: plan.gpu_memory,
            bin: plan.bin,
            joins: plan.urgency == Urgency::Look,
        };
        let has_photons = paths.photons.is_some();
        let camera = subject.camera();
        let mut devices =
            DeviceSet::gather(&plan.devices, &wanted, &subject.prepared, camera, &job.layout, has_photons)?;
        if !(devices.boards.is_empty() || wants_waves(&plan, &devices)) {
            devices.notes.push(unused_boards_warning(&devices.boards, devices.threads, &devices.gpus));
            devices.boards.clear();
        }
        // Find the lights of groups
        let has_groups = !plan.light_groups.is_empty();
        if has_groups && has_photons {
            return Err(Error::usage(
                "photons and lighting agents do not keep the light of groups apart (`film.light_groups`)",
                "choose --integrator path, or leave out the groups",
            ));
        }
        let has_catchers = !plan.shadow_catchers.is_empty();
        if has_catchers && has_photons {
            return Err(Error::usage(
                "photons and lighting agents know no shadow catchers (`film.shadow_catchers`)",
                "choose --integrator path, or leave out the catchers",
            ));
        }
        let (catchers, catcher_notes) = catchers(&plan.shadow_catchers, &subject.prepared);
        let (light_groups, group_notes) = light_groups(&plan.light_groups, &subject.prepared);
        // Make the engine, with rays as work units if that pays off
        let wavefront = wants_waves(&plan, &devices)
            && Wave::refusal(&subject.prepared, &subject.view, paths, &job.layout).is_none();
        let engine = |planned_samples| {
            let options = BuiltinOptions {
                view: subject.view.clone(),
                settings: PathSettings { planned_samples, ..*paths },
                layout: job.layout.clone(),
                threads: devices.threads,
                wavefront,
            };
            let (scene, prepass) = (Arc::clone(&subject.prepared), Arc::clone(&subject.prepass));
            BuiltinEngine::on(scene, prepass, options, Arc::clone(&devices.resources))
                .with_urgency(plan.urgency)
                .with_light_groups(light_groups.clone())
                .with_technique_judge(plan.technique.clone().map(|rules| rules as Arc<dyn TechniqueJudge>))
                .with_catchers(catchers.clone())
        };
        let mut made = engine(paths.planned_samples);
        // Only CPU threads learn guides, for a number of samples that must be estimated if the goal is a time.
        if matches!(job.goal, Goal::Time(_)) && devices.threads > 0 {
            made = engine(samples_in_time(&plan, &made));
        }
        plan.notes.extend(group_notes);
        plan.notes.extend(catcher_notes);
        let (name, notes) = (name(request, &subject, &plan), notes(&subject, &devices, &plan));
        Ok(Self { subject, engine: Arc::new(made), devices, plan, name, notes })
    }

    /// Reports the faults of devices, and stores the measured costs of work on them.
    pub(crate) fn tell_of_devices(&self, reporter: &Reporter) {
        if self.devices.gpus.is_empty() && self.devices.boards.is_empty() {
            return;
        }
        let report = self.engine.report();
        for incident in &report.incidents {
            reporter.warn(format!("{}; its work was done elsewhere", incident_line(&report, incident)));
        }
        // Costs of boards are not stored: another board may get the same address.
        if !self.devices.gpus.is_empty() {
            costs::keep(&report);
        }
    }

    /// Returns the metadata of the picture: how it was made.
    pub(crate) fn metadata(&self, request: &Request, report: &JobReport) -> Metadata {
        let Self { subject, devices, plan: Plan { method, job: settings, paths, .. }, .. } = self;
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
        metadata.set("threads", devices.threads.to_string());
        metadata.set("devices", devices.names());
        metadata.set("exact", devices.gpus.is_empty().to_string());
        metadata.set("render_seconds", format!("{:.3}", report.times.total.as_secs_f64()));
        metadata.set("complete", (!report.stopped).to_string());
        let aovs = settings.layout.aovs();
        if Aov::MATTES.into_iter().any(|aov| aovs.contains(aov)) {
            let names = PartNames::new(subject.prepared.scene());
            for matte in Aov::MATTES.into_iter().filter(|&matte| aovs.contains(matte)) {
                set_matte(&mut metadata, matte, manifest(names_of(&names, matte)));
            }
        }
        metadata
    }
}

/// Returns the names of the parts that a Cryptomatte shows.
fn names_of(names: &PartNames, matte: Aov) -> Vec<&str> {
    let parts = names.instances.iter().chain(&names.spheres);
    match matte {
        Aov::CryptoMaterial => names.materials.iter().map(String::as_str).collect(),
        Aov::CryptoAsset => parts.map(|[_, asset]| asset.as_str()).collect(),
        _ => parts.map(|[object, _]| object.as_str()).collect(),
    }
}

/// Returns the text of [`BuiltinPainter::name`].
fn name(request: &Request, subject: &LoadedScene, plan: &Plan) -> String {
    let Plan { method, paths, job: settings, .. } = plan;
    [
        format!("version={}", identity()),
        format!("scene={}", subject.scene().digest),
        format!("camera={}", subject.camera),
        format!("pose={:?}", request.view.pose),
        format!("view={:?}", ViewOptions { camera: None, pose: None, ..request.view.clone() }),
        format!("size={}x{}", settings.width, settings.height),
        format!("crop={}", settings.crop),
        format!("spp={}", settings.samples),
        format!("max-depth={}", settings.tunables.max_depth),
        format!("light-samples={}", request.integrator.light_samples),
        format!("seed={}", request.seed),
        format!("integrator={:?}", method.integrator),
        format!("photons={:?}", method.photons),
        format!("technique-rules={:x}", paths.technique_rules),
        format!("guiding={}", paths.guiding),
        format!("agents={:?}", paths.agents),
        format!("filter={:?}", paths.filter),
        format!("optimize={}", settings.optimization),
        format!("error={:?}", request.goal.error),
        format!("timed={}", request.goal.time.is_some()),
        format!("env={:?}", request.environment.light),
        format!("env-rotate={}", request.environment.rotate),
        format!("env-strength={}", request.environment.strength),
        format!("aov={:?}", settings.layout.aovs().iter().collect::<Vec<_>>()),
        format!("light-groups={:?}", plan.light_groups),
        format!("shadow-catchers={:?}", plan.shadow_catchers),
    ]
    .join("; ")
}

/// Returns the warnings to report before rendering begins.
fn notes(subject: &LoadedScene, devices: &DeviceSet, plan: &Plan) -> Vec<String> {
    let mut notes = plan.notes.clone();
    notes.extend(subject.warnings.iter().map(ToString::to_string));
    notes.extend(plan.method.note.clone());
    notes.extend(devices.notes.iter().cloned());
    if wants_waves(plan, devices) {
        let paths = PathSettings { photons: plan.paths.photons, ..PathSettings::default() };
        let refusal = Wave::refusal(&subject.prepared, &subject.view, &paths, &plan.job.layout);
        notes.extend(refusal.map(|why| format!("integrator.wavefront and boards have no effect here: {why}")));
    }
    let learns_paths = plan.paths.photons.is_none()
        && plan.shadow_catchers.is_empty()
        && subject.prepared.can_learn(&subject.view, plan.paths.planned_samples);
    if plan.wants_agents && !learns_paths {
        let why = "--guide ala has no effect here: it needs path tracing without media, motion and shadow catchers, at least 128 × 128 pixels, and at least 524288 samples over all pixels";
        notes.push(why.to_owned());
    }
    notes
}

/// Returns true if rays are work units of their own. Boards trace only such rays; a GPU renders whole paths much faster.
fn wants_waves(plan: &Plan, devices: &DeviceSet) -> bool {
    plan.wants_waves || (devices.gpus.is_empty() && are_worth_waves(&devices.boards, devices.threads))
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
