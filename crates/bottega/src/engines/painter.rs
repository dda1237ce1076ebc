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
    agent_rules::AgentRules,
    builtin::BuiltinPainter,
    devices::threads,
    error::Error,
    identity::identity,
    loaded_scene::LoadedScene,
    plan::{PicturePart, Plan, check_crop, crop, default_sample_limit, shared_settings},
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
    /// - `rules`: the rules of the agents, and those that choose the engine of a zone.
    /// - `part`: the part of the picture that this process renders.
    ///
    /// # Errors
    /// The engine is not installed, cannot open the scene, or does not support what the request asks for.
    pub fn open(request: &Request, rules: AgentRules, part: &PicturePart<'_>) -> Result<Self, Error> {
        // Find the engine, and check that it reads the scene
        check(request)?;
        let (name, is_mixed) = request.engine.other()?;
        let located = located(&request.engine.manifests, name)?;
        let manifest = located.manifest();
        let scene = &request.scene.file;
        if !manifest.takes(scene) {
            return Err(Error::usage(
                format!("{} does not read `{}`", manifest.title, scene.display()),
                format!("it reads {}", manifest.scene.extensions.join(", ")),
            ));
        }
        let failed = |source| Error::External { engine: name.to_owned(), source };
        // Open the scene; without a camera, again with that of the built-in engine
        let mut opening = opening(request, &located, part.sent_files())?;
        if is_mixed {
            // Each engine gets half of the processors.
            opening.threads = (opening.threads / 2).max(1);
        }
        let mut session = Session::open_again(&located, &opening).map_err(failed)?;
        if !session.opened().camera {
            opening.view = Some(own_view(request, &manifest.title)?);
            session.reopen(&located, &opening).map_err(failed)?;
        }
        let opened = session.opened().clone();
        opening.size = Some((opened.width, opened.height));
        // Choose layers and settings, shared with the built-in engine if both render
        let layout = layers::layout(request, &opened, &manifest.title, is_mixed)?;
        let notes = rules.notes.clone();
        let own =
            is_mixed.then(|| own(request, &opened, &manifest.title, rules.clone(), layout.clone())).transpose()?;
        let settings = match &own {
            Some(own) => own.settings.clone(),
            None => settings(request, &located, &opened, rules.experts, layout)?,
        };
        let depth = request.integrator.max_depth.or(manifest.tunables.max_depth.and_then(|range| range.default));
        // If the scene gives no number of bounces, both engines must use the same one.
        let depth = depth.or(own.as_ref().filter(|own| !own.has_depth).map(|own| own.settings.tunables.max_depth));
        // Make the engine, alone or mixed with the built-in one
        let options = ExternalOptions {
            request: opening.clone(),
            seed: request.seed,
            // With a goal of error or time the number of samples is unknown; use the usual one.
            samples: settings.crop.area() * u64::from(request.goal.samples.unwrap_or_else(|| usual_samples(manifest))),
            layout: settings.layout.clone(),
            scene_depth: depth.is_none().then_some(settings.tunables.max_depth),
            scene_light_samples: (request.integrator.light_samples == 1).then_some(settings.tunables.light_samples),
            bounds_zones: request.work.zones.is_none() && request.work.level > 0,
            time: request.goal.time.map(Duration::from_secs_f64),
            surveyor: surveyor(request, &located, &opened),
        };
        let engine = Arc::new(ExternalEngine::new(Arc::clone(&located), options, session).map_err(failed)?);
        let mix = own.map(|OwnEngine { engine: own, .. }| {
            let (ours, others): (Arc<dyn RenderEngine>, Arc<dyn RenderEngine>) =
                (Arc::clone(&own) as _, Arc::clone(&engine) as _);
            let mut both = vec![(ours, 1), (others, engine.lanes())];
            // Order the engines as the user names them: the first one takes simple zones
            let is_first = request.engine.names.first().is_some_and(|first| first == BUILTIN);
            if !is_first {
                both.reverse();
            }
            Mix { own, mixed: Arc::new(MixedEngine::new(both, usize::from(!is_first))) }
        });
        let agents = agents_of(request, &engine) + usize::from(is_mixed);
        let settings = JobSettings { agents, goal: part.goal(request), engine_choice: rules.choice, ..settings };
        Ok(Self { located, engine, mix, settings, notes, scene: scene.clone(), opening, has_depth: depth.is_some() })
    }

    /// Returns the engine that renders zones: the external one, or both as one.
    pub fn paints(&self) -> Arc<dyn RenderEngine> {
        match &self.mix {
            Some(mix) => Arc::clone(&mix.mixed) as _,
            None => Arc::clone(&self.engine) as _,
        }
    }

    /// Returns a function that returns the number of samples taken so far, over all pixels.
    pub fn counter(&self) -> impl Fn() -> u64 + Send + 'static {
        let (other, own) = (Arc::clone(&self.engine), self.mix.as_ref().map(|mix| Arc::clone(&mix.own)));
        move || other.samples_done() + own.as_ref().map_or(0, |own| own.samples_done())
    }

    /// Returns a text with everything that determines the pixels; see [`Session::name`](crate::Session::name).
    ///
    /// # Errors
    /// The scene file cannot be read.
    pub fn name(&self, request: &Request) -> Result<String, Error> {
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
            format!("max-depth={:?}", request.integrator.max_depth),
            format!("light-samples={}", request.integrator.light_samples),
            format!("seed={}", request.seed),
            format!("options={options}"),
            format!("optimize={}", settings.optimization),
            format!("error={:?}", request.goal.error),
            format!("timed={}", request.goal.time.is_some()),
            format!("layers={}", layer_names(&settings.layout)),
        ];
        Ok(parts.join("; "))
    }

    /// Returns the metadata of the picture: how it was made.
    pub fn metadata(&self, request: &Request, report: &JobReport) -> Metadata {
        let settings = &self.settings;
        let mut metadata = Metadata::new();
        metadata.set("scene", shown(&request.scene.file));
        metadata.set("engine", self.paints().describe().name);
        metadata.set("engine_version", self.located.version.to_string());
        metadata.set("samples_per_pixel", settings.samples.to_string());
        if let Some(frame) = self.opening.frame {
            metadata.set("frame", frame.to_string());
        }
        let depth =
            if self.has_depth { settings.tunables.max_depth.to_string() } else { "as the scene says".to_owned() };
        metadata.set("max_depth", depth);
        metadata.set("seed", request.seed.to_string());
        metadata.set("optimize", settings.optimization.to_string());
        metadata.set("level", request.work.level.to_string());
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
fn opening(request: &Request, located: &LocatedEngine, sent: Option<&Path>) -> Result<SceneRequest, Error> {
    let mut parameters = parameters(located, &request.engine.options)?;
    let defines = &request.scene.defines;
    if let (Some(define), false) = (parameters.get_mut("define"), defines.is_empty()) {
        let defines: Vec<String> = defines.iter().map(|(name, value)| format!("{name}={value}")).collect();
        *define = defines.join(" ").into();
    } else if !defines.is_empty() {
        return Err(unsupported_option(located, "--define"));
    }
    if request.engine.frame.is_some() && !located.manifest().animation.frames {
        return Err(Error::usage(
            format!("{} does not support frames of an animation", located.manifest().title),
            "leave out --frame and --frames, or use another engine",
        ));
    }
    Ok(SceneRequest {
        scene: absolute(&request.scene.file)?,
        size: request.film.size.map(|[width, height]| (width, height)),
        frame: request.engine.frame,
        threads: threads(request),
        view: None,
        trust: request.engine.trust,
        outside: outside(request, &parameters, sent),
        parameters,
    })
}

/// Returns the paths that the engine may read in addition to the folder of the scene. For a scene sent by another machine: the
/// folder of its files. For the user's own: what the user allows, and paths in options.
fn outside(request: &Request, parameters: &BTreeMap<String, serde_json::Value>, sent: Option<&Path>) -> Vec<PathBuf> {
    if let Some(sent) = sent {
        return vec![sent.to_owned()];
    }
    let named = parameters.values().filter_map(serde_json::Value::as_str).flat_map(std::env::split_paths);
    let named = named.filter(|path| path.is_absolute());
    let all = request.scene.allow_outside.then(|| PathBuf::from("/"));
    named.chain(all).collect()
}

fn unsupported_option(located: &LocatedEngine, option: &str) -> Error {
    Error::usage(
        format!("{} does not support {option}", located.manifest().title),
        "only the built-in engine supports it; other engines follow their scene file",
    )
}

/// Refuses options that only the built-in engine supports.
fn check(request: &Request) -> Result<(), Error> {
    let is_other = |method| method != IntegratorChoice::Path;
    let options = [
        ("--camera", request.view.camera.is_some()),
        ("view.pose", request.view.pose.is_some()),
        ("--lens-radius", request.view.lens_radius.is_some()),
        ("view.blades", request.view.blades.is_some()),
        ("view.aperture_ratio", request.view.aperture_ratio.is_some()),
        ("--projection", request.view.projection.is_some()),
        ("view.stereo", request.view.stereo.is_some()),
        ("view.rolling_shutter", request.view.rolling_shutter.is_some()),
        ("--env", request.environment.light.is_some()),
        ("--env-strength", request.environment.strength != 1.0),
        ("--filter", request.film.filter.is_some()),
        ("--integrator", request.integrator.method.is_some_and(is_other)),
        ("--variant", request.scene.variant.is_some()),
        ("--animation", request.scene.animation.is_some()),
        ("--shutter", request.scene.shutter.is_some()),
        ("scene.subdivision", request.scene.subdivision.is_some()),
        ("scene.displacement", request.scene.displacement.is_some()),
        ("--exact", request.devices.exact),
    ];
    match options.into_iter().find(|(_, is_given)| *is_given) {
        None if request.integrator.max_depth == Some(0) => Err(Error::usage(
            "only the built-in engine supports --max-depth 0",
            "other engines render at least direct light: --max-depth 1",
        )),
        None => Ok(()),
        Some((option, _)) => Err(Error::usage(
            format!("only the built-in engine supports {option}"),
            "other engines follow their scene file; leave it out, or leave out --engine",
        )),
    }
}

fn settings(
    request: &Request,
    located: &LocatedEngine,
    opened: &Opened,
    experts: Vec<Expert>,
    layout: Layout,
) -> Result<JobSettings, Error> {
    let frame = Rect::of_size(opened.width, opened.height);
    let crop = crop(request).unwrap_or(frame);
    check_crop(&crop, &frame)?;
    check_size([opened.width, opened.height], request.film.crop).map_err(|allowed| {
        let problem = format!("the scene sets a picture of {}x{} pixels: {allowed}", opened.width, opened.height);
        Error::usage(problem, "give another size (`--size`), or a part of the picture (`--crop`)")
    })?;
    let tunables = &located.manifest().tunables;
    let samples = request.goal.samples.unwrap_or_else(|| default_samples(request, located.manifest()));
    let samples = tunables.samples.map_or(1, |range| range.fit(samples)).clamp(1, SAMPLES_MAX);
    let depth = request.integrator.max_depth.or(tunables.max_depth.and_then(|range| range.default));
    let depth = depth.unwrap_or(DEFAULT_DEPTH).min(DEPTH_MAX);
    let wanted = Tunables { max_depth: depth, light_samples: request.integrator.light_samples };
    let settings = JobSettings::new(frame.width(), frame.height(), samples, wanted, layout);
    Ok(shared_settings(request, crop, experts, settings))
}

/// Returns the samples per pixel if the request gives none: the maximum if error or time ends the picture and the engine can
/// add samples, else the usual number.
fn default_samples(request: &Request, manifest: &Manifest) -> u32 {
    let usual = usual_samples(manifest);
    if manifest.adds_up() { default_sample_limit(request, usual) } else { usual }
}

fn usual_samples(manifest: &Manifest) -> u32 {
    manifest.tunables.samples.and_then(|range| range.default).unwrap_or(DEFAULT_SAMPLES)
}

/// Returns the default camera of the built-in engine, for a scene without a camera.
fn own_view(request: &Request, title: &str) -> Result<CameraView, Error> {
    let lacking = |why: String| {
        Error::failed(
            format!("the scene has no camera, and {title} cannot use the default camera of the built-in engine: {why}"),
            "add a camera to the scene",
        )
    };
    let subject = LoadedScene::load(request).map_err(|error| lacking(error.error_chain()))?;
    let camera = subject.camera();
    match camera.projection {
        Projection::Perspective { vertical_fov } => {
            Ok(CameraView { world_from_camera: Mat4::from(camera.world_from_camera).to_cols_array(), vertical_fov })
        }
        Projection::Orthographic { .. } | Projection::Fisheye { .. } | Projection::Panorama(_) => {
            Err(lacking("its projection is not perspective".to_owned()))
        }
    }
}

/// Returns the request for the built-in engine: with the size that the external engine found, without layers.
fn as_opened(request: &Request, opened: &Opened) -> Request {
    let mut request = request.clone();
    request.film.size = Some([opened.width, opened.height]);
    request.film.layers = None;
    request
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
fn own(request: &Request, opened: &Opened, title: &str, rules: AgentRules, layout: Layout) -> Result<OwnEngine, Error> {
    let request = as_opened(request, opened);
    let mut subject = LoadedScene::load(&request)?;
    if subject.hints.is_sky_added {
        return Err(Error::failed(
            format!("the scene has no light: the built-in engine would add a sky, and {title} would not"),
            "add a light to the scene, or render it with one engine",
        ));
    }
    // Both engines must use the same pixel filter.
    let Some(filter) = opened.filter else {
        return Err(Error::failed(
            format!("{title} renders this scene with a pixel filter that the built-in engine does not have"),
            "choose another filter in the scene, such as a Gaussian, or render it with one engine",
        ));
    };
    subject.hints.filter = Some(filter);
    let plan = Plan::of(&request, &subject, rules, &PicturePart::BesideEngine)?;
    let settings = JobSettings { layout, ..plan.job };
    // Each engine gets half of the processors.
    let half = JobSettings { processors: (settings.processors / 2).max(1), ..settings.clone() };
    let has_depth = subject.hints.max_depth.is_some();
    let own = BuiltinPainter::open(&request, Plan { job: half, ..plan }, subject)?;
    Ok(OwnEngine { engine: own.engine, settings, has_depth })
}

/// Returns the number of agents: one per process of the engine, as more have to wait for each other.
fn agents_of(request: &Request, engine: &ExternalEngine) -> usize {
    request.work.agents.map_or(engine.lanes(), |count| agents(Some(count), 1))
}

/// Returns a surveyor by the built-in engine; `None` if the manifest does not declare that it reads the same format.
fn surveyor(request: &Request, located: &LocatedEngine, opened: &Opened) -> Option<Surveyor> {
    use bottega_engines::external::manifest::Importance;
    if located.manifest().scene.importance != Importance::Builtin {
        return None;
    }
    let request = as_opened(request, opened);
    let once = Mutex::new(());
    Some(Box::new(move |width, height| {
        let _one = once.lock().unwrap_or_else(PoisonError::into_inner);
        let look = || -> Result<Survey, Error> {
            let subject = LoadedScene::load(&request)?;
            let plan = Plan::of(&request, &subject, AgentRules::built_in(), &PicturePart::BesideEngine)?;
            Ok(BuiltinPainter::open(&request, plan, subject)?.engine.survey(width, height)?)
        };
        // If the built-in engine cannot read the scene, the external one surveys it.
        look()
            .inspect_err(
                |error| tracing::debug!(%error, "the built-in engine cannot survey the scene; its own engine does"),
            )
            .ok()
    }))
}
