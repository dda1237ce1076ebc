//! An external engine, prepared for the picture of a request.

use std::{
    collections::BTreeMap,
    fmt::Write,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use bottega_engines::{
    BuiltinEngine, MixedEngine, RenderEngine, Survey, Tunables,
    external::{
        CameraView, ExternalEngine, ExternalOptions, LocatedEngine, Opened, SceneRequest, Session, Surveyor,
        manifest::Manifest,
    },
};
use bottega_farm::{Expert, JobReport, JobSettings};
use bottega_image::{Layer, Layout, Metadata, Rect};
use bottega_scene::Projection;
use glam::Mat4;

use super::{absolute, layers, located, parameters};
use crate::{
    builtin::BuiltinPainter,
    devices::threads,
    error::Error,
    identity::identity,
    loaded_scene::LoadedScene,
    plan::{AgentRules, PicturePart, Plan, check_crop, crop, samples_unasked, shared_settings},
    request::{BUILTIN, DEPTH_MAX, IntegratorChoice, Request, SAMPLES_MAX, check_size},
    settings::agents,
    text::shown,
};

/// Maximum number of bounces for the rules, if neither scene nor user gives one.
const DEFAULT_DEPTH: u32 = 16;
/// Samples per pixel if neither user nor manifest gives a number.
const DEFAULT_SAMPLES: u32 = 64;

/// An external engine with its scene opened and the settings of the job.
pub struct ExternalPainter {
    /// The installation of the engine on this machine.
    pub located: Arc<LocatedEngine>,
    /// The engine with the scene opened.
    pub engine: Arc<ExternalEngine>,
    /// The built-in engine, if it renders together with the external one.
    pub mix: Option<Mix>,
    /// The settings of the job.
    pub settings: JobSettings,
    /// Warnings about the rules.
    pub notes: Vec<String>,
    scene: PathBuf,
    opening: SceneRequest,
    /// True if the engine gets a maximum number of bounces.
    has_depth: bool,
}

/// The built-in engine together with an external one.
pub struct Mix {
    /// The built-in engine of the pair.
    pub own: Arc<BuiltinEngine>,
    /// Both engines as one.
    pub mixed: Arc<MixedEngine>,
}

impl ExternalPainter {
    /// Finds the engine, opens the scene with it and makes the settings of the job.
    ///
    /// # Errors
    /// The engine is not installed, does not read the scene, or does not support what the request asks for.
    pub fn open(asked: &Request, rules: AgentRules, part: &PicturePart<'_>) -> Result<Self, Error> {
        // Find the engine, and check that it reads the scene
        check(asked)?;
        let (name, is_mixed) = asked.engine.other()?;
        let located = located(&asked.engine.manifests, name)?;
        let manifest = located.manifest();
        let scene = &asked.scene.file;
        if !manifest.takes(scene) {
            return Err(Error::usage(
                format!("{} does not read `{}`", manifest.title, scene.display()),
                format!("it reads {}", manifest.scene.extensions.join(", ")),
            ));
        }
        let failed = |source| Error::External { engine: name.to_owned(), source };
        // Open the scene; without a camera, again with that of the built-in engine
        let mut opening = opening(asked, &located, part.sent_files())?;
        if is_mixed {
            // Each engine gets half of the processors.
            opening.threads = (opening.threads / 2).max(1);
        }
        let mut session = Session::open_again(&located, &opening).map_err(failed)?;
        if !session.opened().camera {
            opening.view = Some(own_view(asked, &manifest.title)?);
            session.reopen(&located, &opening).map_err(failed)?;
        }
        let opened = session.opened().clone();
        opening.size = Some((opened.width, opened.height));
        // Choose layers and settings, shared with the built-in engine if both render
        let layout = layers::layout(asked, &opened, &manifest.title, is_mixed)?;
        let notes = rules.notes.clone();
        let own = is_mixed.then(|| own(asked, &opened, &manifest.title, rules.clone(), layout.clone())).transpose()?;
        let settings = match &own {
            Some(own) => own.settings.clone(),
            None => settings(asked, &located, &opened, rules.experts, layout)?,
        };
        let depth = asked.integrator.max_depth.or(manifest.tunables.max_depth.and_then(|range| range.default));
        // If the scene gives no number of bounces, both engines must use the same one.
        let depth = depth.or(own.as_ref().filter(|own| !own.has_depth).map(|own| own.settings.tunables.max_depth));
        // Make the engine, alone or mixed with the built-in one
        let options = ExternalOptions {
            request: opening.clone(),
            seed: asked.seed,
            // With a goal of error or time the number of samples is unknown; use the usual one.
            samples: settings.crop.area() * u64::from(asked.goal.samples.unwrap_or_else(|| usual_samples(manifest))),
            layout: settings.layout.clone(),
            scene_depth: depth.is_none().then_some(settings.tunables.max_depth),
            scene_light_samples: (asked.integrator.light_samples == 1).then_some(settings.tunables.light_samples),
            bounds_zones: asked.work.zones.is_none() && asked.work.level > 0,
            time: asked.goal.time.map(Duration::from_secs_f64),
            surveyor: surveyor(asked, &located, &opened),
        };
        let engine = Arc::new(ExternalEngine::new(Arc::clone(&located), options, session).map_err(failed)?);
        let mix = own.map(|OwnEngine { engine: own, .. }| {
            let (ours, others): (Arc<dyn RenderEngine>, Arc<dyn RenderEngine>) =
                (Arc::clone(&own) as _, Arc::clone(&engine) as _);
            let mut both = vec![(ours, 1), (others, engine.lanes())];
            // Order the engines as the user names them: the first one takes simple zones
            let is_first = asked.engine.names.first().is_some_and(|first| first == BUILTIN);
            if !is_first {
                both.reverse();
            }
            Mix { own, mixed: Arc::new(MixedEngine::new(both, usize::from(!is_first))) }
        });
        let agents = agents_of(asked, &engine) + usize::from(is_mixed);
        let settings = JobSettings { agents, goal: part.goal(asked), engine_choice: rules.choice, ..settings };
        Ok(Self { located, engine, mix, settings, notes, scene: scene.clone(), opening, has_depth: depth.is_some() })
    }

    /// Returns the engine that renders zones: the external one, or both as one.
    pub fn paints(&self) -> Arc<dyn RenderEngine> {
        match &self.mix {
            Some(mix) => Arc::clone(&mix.mixed) as _,
            None => Arc::clone(&self.engine) as _,
        }
    }

    /// Returns a function that counts the samples taken so far, over all pixels.
    pub fn counter(&self) -> impl Fn() -> u64 + Send + 'static {
        let (other, own) = (Arc::clone(&self.engine), self.mix.as_ref().map(|mix| Arc::clone(&mix.own)));
        move || other.samples_done() + own.as_ref().map_or(0, |own| own.samples_done())
    }

    /// Returns a text with everything that determines the pixels; see [`crate::journal::name_of`].
    ///
    /// # Errors
    /// The scene file cannot be read.
    pub fn name(&self, asked: &Request) -> Result<String, Error> {
        let settings = &self.settings;
        let bytes = std::fs::read(&self.scene).map_err(|source| Error::Read { path: self.scene.clone(), source })?;
        let mut options = String::new();
        for (name, value) in &self.opening.parameters {
            // Writing to a string cannot fail.
            let _ = write!(options, "{name}={value},");
        }
        let parts = [
            format!("version={}", identity()),
            format!("engine={}", self.located.identity()),
            format!("mixed={}", self.mix.is_some()),
            format!("scene={}", blake3::hash(&bytes).to_hex()),
            format!("size={}x{}", settings.width, settings.height),
            format!("crop={}", settings.crop),
            format!("frame={:?}", self.opening.frame),
            format!("spp={}", settings.samples),
            format!("max-depth={:?}", asked.integrator.max_depth),
            format!("light-samples={}", asked.integrator.light_samples),
            format!("seed={}", asked.seed),
            format!("options={options}"),
            format!("optimize={}", settings.optimization),
            format!("error={:?}", asked.goal.error),
            format!("timed={}", asked.goal.time.is_some()),
            format!("layers={}", layer_names(&settings.layout)),
        ];
        Ok(parts.join("; "))
    }

    /// Returns the metadata of the picture: how it was made.
    pub fn metadata(&self, asked: &Request, report: &JobReport) -> Metadata {
        let settings = &self.settings;
        let mut metadata = Metadata::new();
        metadata.set("scene", shown(&asked.scene.file));
        metadata.set("engine", self.paints().describe().name);
        metadata.set("engine_version", self.located.version.to_string());
        metadata.set("samples_per_pixel", settings.samples.to_string());
        if let Some(frame) = self.opening.frame {
            metadata.set("frame", frame.to_string());
        }
        let depth =
            if self.has_depth { settings.tunables.max_depth.to_string() } else { "as the scene says".to_owned() };
        metadata.set("max_depth", depth);
        metadata.set("seed", asked.seed.to_string());
        metadata.set("optimize", settings.optimization.to_string());
        metadata.set("level", asked.work.level.to_string());
        metadata.set("agents", settings.agents.to_string());
        metadata.set("exact", self.paints().describe().exact_by_pixel.to_string());
        metadata.set("render_seconds", format!("{:.3}", report.times.total.as_secs_f64()));
        metadata.set("complete", (!report.stopped).to_string());
        metadata
    }

    /// Returns the readable name and version of the engine.
    pub fn title(&self) -> String {
        let with = if self.mix.is_some() { " and the built-in engine" } else { "" };
        format!("{} {}{with}", self.located.manifest().title, self.located.version)
    }
}

/// Returns the message to the engine that opens the scene.
fn opening(asked: &Request, located: &LocatedEngine, sent: Option<&Path>) -> Result<SceneRequest, Error> {
    let mut parameters = parameters(located, &asked.engine.options)?;
    let defines = &asked.scene.defines;
    if let (Some(define), false) = (parameters.get_mut("define"), defines.is_empty()) {
        let defines: Vec<String> = defines.iter().map(|(name, value)| format!("{name}={value}")).collect();
        *define = defines.join(" ").into();
    } else if !defines.is_empty() {
        return Err(unfit(located, "--define"));
    }
    if asked.engine.frame.is_some() && !located.manifest().animation.frames {
        return Err(Error::usage(
            format!("{} knows no frames of an animation", located.manifest().title),
            "leave out --frame and --frames, or take another engine",
        ));
    }
    Ok(SceneRequest {
        scene: absolute(&asked.scene.file)?,
        size: asked.film.size.map(|[width, height]| (width, height)),
        frame: asked.engine.frame,
        threads: threads(asked),
        view: None,
        trust: asked.engine.trust,
        outside: outside(asked, &parameters, sent),
        parameters,
    })
}

/// Returns the paths that the engine may read in addition to the folder of the scene. For a scene sent by another machine: the
/// folder of its files. For the user's own: what the user allows, and paths in options.
fn outside(asked: &Request, parameters: &BTreeMap<String, serde_json::Value>, sent: Option<&Path>) -> Vec<PathBuf> {
    if let Some(sent) = sent {
        return vec![sent.to_owned()];
    }
    let named = parameters.values().filter_map(serde_json::Value::as_str).flat_map(std::env::split_paths);
    let named = named.filter(|path| path.is_absolute());
    let all = asked.scene.allow_outside.then(|| PathBuf::from("/"));
    named.chain(all).collect()
}

fn unfit(located: &LocatedEngine, option: &str) -> Error {
    Error::usage(
        format!("{option} means nothing to {}", located.manifest().title),
        "it is for our own engine; other engines do as their scene says",
    )
}

/// Refuses options that only the built-in engine supports.
fn check(asked: &Request) -> Result<(), Error> {
    let is_other = |method| method != IntegratorChoice::Path;
    let options = [
        ("--camera", asked.view.camera.is_some()),
        ("view.pose", asked.view.pose.is_some()),
        ("--lens-radius", asked.view.lens_radius.is_some()),
        ("--env", asked.environment.light.is_some()),
        ("--env-strength", asked.environment.strength != 1.0),
        ("--filter", asked.film.filter.is_some()),
        ("--integrator", asked.integrator.method.is_some_and(is_other)),
        ("--variant", asked.scene.variant.is_some()),
        ("--animation", asked.scene.animation.is_some()),
        ("--shutter", asked.scene.shutter.is_some()),
        ("--exact", asked.devices.exact),
    ];
    match options.into_iter().find(|(_, is_given)| *is_given) {
        None if asked.integrator.max_depth == Some(0) => Err(Error::usage(
            "--max-depth 0 is for our own engine",
            "other engines show direct light at least: --max-depth 1",
        )),
        None => Ok(()),
        Some((option, _)) => Err(Error::usage(
            format!("{option} is for our own engine"),
            "other engines do as their scene says; leave it out, or leave out --engine",
        )),
    }
}

fn settings(
    asked: &Request,
    located: &LocatedEngine,
    opened: &Opened,
    experts: Vec<Expert>,
    layout: Layout,
) -> Result<JobSettings, Error> {
    let frame = Rect::of_size(opened.width, opened.height);
    let crop = crop(asked).unwrap_or(frame);
    check_crop(&crop, &frame)?;
    check_size([opened.width, opened.height], asked.film.crop).map_err(|allowed| {
        let problem = format!("the scene is a picture of {}x{} pixels: {allowed}", opened.width, opened.height);
        Error::usage(problem, "say another size (`--size`), or which part of it (`--crop`)")
    })?;
    let tunables = &located.manifest().tunables;
    let samples = asked.goal.samples.unwrap_or_else(|| default_samples(asked, located.manifest()));
    let samples = tunables.samples.map_or(1, |range| range.fit(samples)).clamp(1, SAMPLES_MAX);
    let depth = asked.integrator.max_depth.or(tunables.max_depth.and_then(|range| range.default));
    let depth = depth.unwrap_or(DEFAULT_DEPTH).min(DEPTH_MAX);
    let wanted = Tunables { max_depth: depth, light_samples: asked.integrator.light_samples };
    let settings = JobSettings::new(frame.width(), frame.height(), samples, wanted, layout);
    Ok(shared_settings(asked, crop, experts, settings))
}

/// Returns the samples per pixel if the request gives none: the maximum if error or time ends the picture and the engine can
/// add samples, else the usual number.
fn default_samples(asked: &Request, manifest: &Manifest) -> u32 {
    let usual = usual_samples(manifest);
    if manifest.adds_up() { samples_unasked(asked, usual) } else { usual }
}

fn usual_samples(manifest: &Manifest) -> u32 {
    manifest.tunables.samples.and_then(|range| range.default).unwrap_or(DEFAULT_SAMPLES)
}

/// Returns the default camera of the built-in engine, for a scene without a camera.
fn own_view(asked: &Request, title: &str) -> Result<CameraView, Error> {
    let lacking = |why: String| {
        Error::failed(
            format!(
                "the scene has no camera, and {title} cannot be given the one that our own engine would take: {why}"
            ),
            "put a camera into the scene",
        )
    };
    let subject = LoadedScene::load(asked).map_err(|error| lacking(error.error_chain()))?;
    let camera = subject.camera();
    match camera.projection {
        Projection::Perspective { vertical_fov } => {
            Ok(CameraView { world_from_camera: Mat4::from(camera.world_from_camera).to_cols_array(), vertical_fov })
        }
        Projection::Orthographic { .. } | Projection::Panorama(_) => {
            Err(lacking("that one has no perspective".to_owned()))
        }
    }
}

/// Returns the request for the built-in engine: with the size that the external engine found, without layers.
fn as_opened(asked: &Request, opened: &Opened) -> Request {
    let mut asked = asked.clone();
    asked.film.size = Some([opened.width, opened.height]);
    asked.film.layers = None;
    asked
}

/// Returns the names of all layers, in order, joined by commas.
fn layer_names(layout: &Layout) -> String {
    let channels = layout.layers().iter().flat_map(Layer::full_names);
    layout.aovs().iter().map(|aov| aov.name().to_owned()).chain(channels).collect::<Vec<_>>().join(",")
}

/// The built-in engine, prepared to render together with an external one.
struct OwnEngine {
    engine: Arc<BuiltinEngine>,
    settings: JobSettings,
    /// True if the scene gives a maximum number of bounces.
    has_depth: bool,
}

/// Prepares the built-in engine for the same picture; it reads size, samples, depth and filter from the same file.
fn own(asked: &Request, opened: &Opened, title: &str, rules: AgentRules, layout: Layout) -> Result<OwnEngine, Error> {
    let asked = as_opened(asked, opened);
    let mut subject = LoadedScene::load(&asked)?;
    if subject.hints.is_sky_added {
        return Err(Error::failed(
            format!("the scene has no light: our own engine would have a sky shine on it, and {title} none"),
            "put light into the scene, or let one engine paint it",
        ));
    }
    // Both engines must use the same pixel filter.
    let Some(filter) = opened.filter else {
        return Err(Error::failed(
            format!("{title} paints this scene with a pixel filter that our own engine does not have"),
            "give the scene's film another one, such as a Gaussian, or let one engine paint it",
        ));
    };
    subject.hints.filter = Some(filter);
    let plan = Plan::of(&asked, &subject, rules, &PicturePart::BesideEngine)?;
    let settings = JobSettings { layout, ..plan.job };
    // Each engine gets half of the processors.
    let half = JobSettings { processors: (settings.processors / 2).max(1), ..settings.clone() };
    let has_depth = subject.hints.max_depth.is_some();
    let own = BuiltinPainter::open(Plan { job: half, ..plan }, subject)?;
    Ok(OwnEngine { engine: own.engine, settings, has_depth })
}

/// Returns the number of agents: one per process of the engine, as more have to wait for each other.
fn agents_of(asked: &Request, engine: &ExternalEngine) -> usize {
    asked.work.agents.map_or(engine.lanes(), |asked| agents(Some(asked), 1))
}

/// Returns a surveyor by the built-in engine; `None` if the manifest does not declare that it reads the same format.
fn surveyor(asked: &Request, located: &LocatedEngine, opened: &Opened) -> Option<Surveyor> {
    use bottega_engines::external::manifest::Importance;
    if located.manifest().scene.importance != Importance::Builtin {
        return None;
    }
    let asked = as_opened(asked, opened);
    let once = Mutex::new(());
    Some(Box::new(move |width, height| {
        let _one = once.lock().unwrap_or_else(PoisonError::into_inner);
        let look = || -> Result<Survey, Error> {
            let subject = LoadedScene::load(&asked)?;
            let plan = Plan::of(&asked, &subject, AgentRules::built_in(), &PicturePart::BesideEngine)?;
            Ok(BuiltinPainter::open(plan, subject)?.engine.survey(width, height)?)
        };
        // If the built-in engine cannot read the scene, the external one surveys it.
        look().inspect_err(|error| tracing::debug!(%error, "the scene is surveyed by its engine")).ok()
    }))
}
