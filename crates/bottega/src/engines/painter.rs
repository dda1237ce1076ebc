//! A picture made ready: what is to be painted, and the engine that paints it.

use std::{
    collections::BTreeMap,
    fmt::Write,
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
};

use bottega_engines::{
    BuiltinEngine, MixedEngine, RenderEngine, Survey, Tunables,
    external::{
        CameraView, ExternalEngine, ExternalOptions, Located, Opened, SceneRequest, Session, Surveyor,
        manifest::Manifest,
    },
};
use bottega_farm::{Expert, JobReport, JobSettings};
use bottega_image::{Layer, Layout, Metadata, Rect};
use bottega_scene::Projection;
use glam::Mat4;

use super::{
    attempt::{absolute, parameters},
    layers, located,
};
use crate::{
    cli::{DEPTH_MAX, IntegratorArg, RenderArgs, SAMPLES_MAX, Size},
    error::CliError,
    identity::identity,
    render,
    scene::{Subject, agents, shown, threads},
};

/// Bounces where neither scene nor user says a number and rules need one.
const DEFAULT_DEPTH: u32 = 16;
/// Samples where nobody says.
const DEFAULT_SAMPLES: u32 = 64;

/// An engine of other people with the picture that it is to paint.
pub(crate) struct Painter {
    pub(crate) located: Arc<Located>,
    pub(crate) engine: Arc<ExternalEngine>,
    /// Where our own engine paints, too.
    pub(crate) mix: Option<Mix>,
    pub(crate) settings: JobSettings,
    scene: PathBuf,
    request: SceneRequest,
    /// Whether the engine is told a depth.
    has_depth: bool,
}

/// Our own engine beside the other one.
pub(crate) struct Mix {
    pub(crate) own: Arc<BuiltinEngine>,
    pub(crate) mixed: Arc<MixedEngine>,
}

impl Painter {
    /// Finds the engine, opens the scene with it, and makes it ready.
    pub(crate) fn open(args: &RenderArgs, experts: Vec<Expert>) -> Result<Self, CliError> {
        check(args)?;
        let (name, is_mixed) = args.engines.other()?;
        let located = located(&args.engines.folders, name)?;
        let manifest = located.manifest();
        let scene = &args.scene.file.scene;
        if !manifest.takes(scene) {
            return Err(CliError::usage(
                format!("{} does not read `{}`", manifest.title, scene.display()),
                format!("it reads {}", manifest.scene.extensions.join(", ")),
            ));
        }
        let failed = |source| CliError::External { engine: name.to_owned(), source };
        let mut request = request(args, &located)?;
        if is_mixed {
            // Half of the processors for each.
            request.threads = (request.threads / 2).max(1);
        }
        let mut session = Session::open(&located, &request).map_err(failed)?;
        if !session.opened().camera {
            request.view = Some(own_view(args, &manifest.title)?);
            session.reopen(&located, &request).map_err(failed)?;
        }
        let opened = session.opened().clone();
        request.size = Some((opened.width, opened.height));
        let layout = layers::layout(args, &opened, &manifest.title, is_mixed)?;
        let own = is_mixed.then(|| own(args, &opened, &manifest.title, experts.clone(), layout.clone())).transpose()?;
        let settings = match &own {
            Some(own) => own.settings.clone(),
            None => settings(args, &located, &opened, experts, layout)?,
        };
        let depth = args.max_depth.or(manifest.tunables.max_depth.and_then(|range| range.default));
        // Where the scene says nothing the two would each take a number of their own.
        let depth = depth.or(own.as_ref().filter(|own| !own.has_depth).map(|own| own.settings.tunables.max_depth));
        let options = ExternalOptions {
            request: request.clone(),
            seed: args.seed,
            // What error or time will come to is not known yet.
            samples: settings.crop.area() * u64::from(args.spp.unwrap_or_else(|| usual_samples(manifest))),
            layout: settings.layout.clone(),
            scene_depth: depth.is_none().then_some(settings.tunables.max_depth),
            scene_light_samples: (args.light_samples == 1).then_some(settings.tunables.light_samples),
            bounds_zones: args.zones.is_none() && args.scene.level > 0,
            time: args.time,
            surveyor: surveyor(args, &located, &opened),
        };
        let engine = Arc::new(ExternalEngine::new(Arc::clone(&located), options, session).map_err(failed)?);
        let mix = own.map(|Own { engine: own, .. }| {
            let (ours, others): (Arc<dyn RenderEngine>, Arc<dyn RenderEngine>) =
                (Arc::clone(&own) as _, Arc::clone(&engine) as _);
            let mut both = vec![(ours, 1), (others, engine.lanes())];
            // In the order in which the user names them.
            let is_first = args.engines.engine.first().is_some_and(|first| first == super::BUILTIN);
            if !is_first {
                both.reverse();
            }
            Mix { own, mixed: Arc::new(MixedEngine::new(both, usize::from(!is_first))) }
        });
        let agents = agents_of(args, &engine) + usize::from(is_mixed);
        let settings = JobSettings { agents, ..settings };
        Ok(Self { located, engine, mix, settings, scene: scene.clone(), request, has_depth: depth.is_some() })
    }

    /// Who paints.
    pub(crate) fn paints(&self) -> Arc<dyn RenderEngine> {
        match &self.mix {
            Some(mix) => Arc::clone(&mix.mixed) as _,
            None => Arc::clone(&self.engine) as _,
        }
    }

    /// Counts the samples taken so far, all pixels together.
    pub(crate) fn counter(&self) -> impl Fn() -> u64 + Send + 'static {
        let (other, own) = (Arc::clone(&self.engine), self.mix.as_ref().map(|mix| Arc::clone(&mix.own)));
        move || other.samples_done() + own.as_ref().map_or(0, |own| own.samples_done())
    }

    /// What makes the picture what it is, as for our own engine.
    pub(crate) fn name(&self, args: &RenderArgs) -> Result<String, CliError> {
        let settings = &self.settings;
        let bytes = std::fs::read(&self.scene).map_err(|source| CliError::Read { path: self.scene.clone(), source })?;
        let mut options = String::new();
        for (name, value) in &self.request.parameters {
            // Into a string nothing fails.
            let _ = write!(options, "{name}={value},");
        }
        let parts = [
            format!("version={}", identity()),
            format!("engine={}", self.located.identity()),
            format!("mixed={}", self.mix.is_some()),
            format!("scene={}", blake3::hash(&bytes).to_hex()),
            format!("size={}x{}", settings.width, settings.height),
            format!("crop={}", settings.crop),
            format!("frame={:?}", self.request.frame),
            format!("spp={}", settings.samples),
            format!("max-depth={:?}", args.max_depth),
            format!("light-samples={}", args.light_samples),
            format!("seed={}", args.seed),
            format!("options={options}"),
            format!("optimize={}", settings.optimization),
            format!("error={:?}", args.error),
            format!("timed={}", args.time.is_some()),
            format!("layers={}", layer_names(&settings.layout)),
        ];
        Ok(parts.join("; "))
    }

    /// What the picture says of how it was made.
    pub(crate) fn metadata(&self, args: &RenderArgs, report: &JobReport) -> Metadata {
        let settings = &self.settings;
        let mut metadata = Metadata::new();
        metadata.set("scene", shown(&args.scene.file.scene));
        metadata.set("engine", self.paints().describe().name);
        metadata.set("engine_version", self.located.version.to_string());
        metadata.set("samples_per_pixel", settings.samples.to_string());
        if let Some(frame) = self.request.frame {
            metadata.set("frame", frame.to_string());
        }
        let depth =
            if self.has_depth { settings.tunables.max_depth.to_string() } else { "as the scene says".to_owned() };
        metadata.set("max_depth", depth);
        metadata.set("seed", args.seed.to_string());
        metadata.set("optimize", settings.optimization.to_string());
        metadata.set("level", args.scene.level.to_string());
        metadata.set("agents", settings.agents.to_string());
        metadata.set("exact", self.paints().describe().exact_by_pixel.to_string());
        metadata.set("render_seconds", format!("{:.3}", report.times.total.as_secs_f64()));
        metadata.set("complete", (!report.stopped).to_string());
        metadata
    }

    /// Engine and version, as people read it.
    pub(crate) fn title(&self) -> String {
        let with = if self.mix.is_some() { " and the built-in engine" } else { "" };
        format!("{} {}{with}", self.located.manifest().title, self.located.version)
    }
}

fn request(args: &RenderArgs, located: &Located) -> Result<SceneRequest, CliError> {
    let mut parameters = parameters(located, &args.engines.options)?;
    if let (Some(define), false) = (parameters.get_mut("define"), args.scene.file.defines.is_empty()) {
        let defines: Vec<String> =
            args.scene.file.defines.iter().map(|(name, value)| format!("{name}={value}")).collect();
        *define = defines.join(" ").into();
    } else if !args.scene.file.defines.is_empty() {
        return Err(unfit(located, "--define"));
    }
    if args.engines.frame.is_some() && !located.manifest().animation.frames {
        return Err(CliError::usage(
            format!("{} knows no frames of an animation", located.manifest().title),
            "leave out --frame and --frames, or take another engine",
        ));
    }
    Ok(SceneRequest {
        scene: absolute(&args.scene.file.scene)?,
        size: args.scene.size.map(|size| (size.width, size.height)),
        frame: args.engines.frame,
        threads: threads(&args.scene),
        view: None,
        trust: args.engines.trust,
        outside: outside(args, &parameters),
        parameters,
    })
}

/// What the engine may read beside the folder of the scene: of a scene that was sent here what was sent with it; of the
/// user's own what the user allows, and what options name.
fn outside(args: &RenderArgs, parameters: &BTreeMap<String, serde_json::Value>) -> Vec<PathBuf> {
    if let Some(sent) = &args.engines.sent {
        return vec![sent.clone()];
    }
    let named = parameters.values().filter_map(serde_json::Value::as_str).flat_map(std::env::split_paths);
    let named = named.filter(|path| path.is_absolute());
    let all = args.scene.file.allow_outside.then(|| PathBuf::from("/"));
    named.chain(all).collect()
}

fn unfit(located: &Located, option: &str) -> CliError {
    CliError::usage(
        format!("{option} means nothing to {}", located.manifest().title),
        "it is for our own engine; other engines do as their scene says",
    )
}

/// What only our own engine knows is refused, not left out in silence.
fn check(args: &RenderArgs) -> Result<(), CliError> {
    let options = [
        ("--camera", args.scene.camera.is_some()),
        ("--lens-radius", args.scene.lens_radius.is_some()),
        ("--env", args.scene.env.is_some()),
        ("--env-strength", args.scene.env_strength != 1.0),
        ("--filter", args.filter.is_some()),
        ("--integrator", args.integrator.is_some_and(|asked| asked != IntegratorArg::Path)),
        ("--variant", args.scene.file.variant.is_some()),
        ("--animation", args.scene.file.animation.is_some()),
        ("--exact", args.exact),
        ("--record", args.record.is_some()),
    ];
    match options.into_iter().find(|(_, is_given)| *is_given) {
        None if args.max_depth == Some(0) => Err(CliError::usage(
            "--max-depth 0 is for our own engine",
            "other engines show direct light at least: --max-depth 1",
        )),
        None => Ok(()),
        Some((option, _)) => Err(CliError::usage(
            format!("{option} is for our own engine"),
            "other engines do as their scene says; leave it out, or leave out --engine",
        )),
    }
}

fn settings(
    args: &RenderArgs,
    located: &Located,
    opened: &Opened,
    experts: Vec<Expert>,
    layout: Layout,
) -> Result<JobSettings, CliError> {
    let frame = Rect::of_size(opened.width, opened.height);
    let crop = args.crop.unwrap_or(frame);
    if !frame.encloses(&crop) {
        return Err(CliError::usage(
            format!("the crop {crop} is not within the picture of {}x{}", frame.width(), frame.height()),
            "x1 and y1 may be at most the picture's width and height",
        ));
    }
    let tunables = &located.manifest().tunables;
    let samples = args.spp.unwrap_or_else(|| default_samples(args, located.manifest()));
    let samples = tunables.samples.map_or(1, |range| range.fit(samples)).clamp(1, SAMPLES_MAX);
    let depth = args.max_depth.or(tunables.max_depth.and_then(|range| range.default)).unwrap_or(DEFAULT_DEPTH);
    let asked = Tunables { max_depth: depth.min(DEPTH_MAX), light_samples: args.light_samples };
    Ok(JobSettings {
        crop,
        level: render::level(args.scene.level),
        optimization: render::optimization(args.optimize),
        experts,
        processors: threads(&args.scene),
        importance: args.scene.importance_function(),
        zones: args.zones,
        verify: args.verify.unwrap_or(1),
        ..JobSettings::new(frame.width(), frame.height(), samples, asked, layout)
    })
}

/// Samples where the user says no number: as many as it takes where error or time ends the picture and samples add up.
fn default_samples(args: &RenderArgs, manifest: &Manifest) -> u32 {
    let usual = usual_samples(manifest);
    if manifest.adds_up() { render::samples_unasked(args, usual) } else { usual }
}

fn usual_samples(manifest: &Manifest) -> u32 {
    manifest.tunables.samples.and_then(|range| range.default).unwrap_or(DEFAULT_SAMPLES)
}

/// Where our own engine would look from, for a scene without a camera.
fn own_view(args: &RenderArgs, title: &str) -> Result<CameraView, CliError> {
    let lacking = |why: String| {
        CliError::failed(
            format!(
                "the scene has no camera, and {title} cannot be given the one that our own engine would take: {why}"
            ),
            "put a camera into the scene",
        )
    };
    let subject = Subject::load(&args.scene).map_err(|error| lacking(error.told()))?;
    let camera = &subject.scene().cameras[subject.view.camera];
    match camera.projection {
        Projection::Perspective { vertical_fov } => {
            Ok(CameraView { world_from_camera: Mat4::from(camera.world_from_camera).to_cols_array(), vertical_fov })
        }
        Projection::Orthographic { .. } | Projection::Panorama(_) => {
            Err(lacking("that one has no perspective".to_owned()))
        }
    }
}

/// The same picture for our own engine: of the size that the other one found, without layers of its own.
fn as_opened(args: &RenderArgs, opened: &Opened) -> RenderArgs {
    let mut args = args.clone();
    args.scene.size = Size::new(opened.width, opened.height).ok();
    args.aov = None;
    args
}

/// Names of all layers, in their order.
fn layer_names(layout: &Layout) -> String {
    let channels = layout.layers().iter().flat_map(Layer::full_names);
    layout.aovs().iter().map(|aov| aov.name().to_owned()).chain(channels).collect::<Vec<_>>().join(",")
}

/// Our own engine beside another one.
struct Own {
    engine: Arc<BuiltinEngine>,
    settings: JobSettings,
    /// Whether the scene says how far light goes.
    has_depth: bool,
}

/// Our own engine with the same picture: it reads size, samples, depth and filter from the same file.
fn own(args: &RenderArgs, opened: &Opened, title: &str, experts: Vec<Expert>, layout: Layout) -> Result<Own, CliError> {
    let args = as_opened(args, opened);
    let mut subject = Subject::load(&args.scene)?;
    if subject.hints.is_sky_added {
        return Err(CliError::failed(
            format!("the scene has no light: our own engine would have a sky shine on it, and {title} none"),
            "put light into the scene, or let one engine paint it",
        ));
    }
    let settings = JobSettings { layout, ..render::job_settings(&args, &subject, experts)? };
    // The same part of a pixel's surroundings counts for both.
    let Some(filter) = opened.filter else {
        return Err(CliError::failed(
            format!("{title} paints this scene with a pixel filter that our own engine does not have"),
            "give the scene's film another one, such as a Gaussian, or let one engine paint it",
        ));
    };
    subject.hints.filter = Some(filter);
    let half = JobSettings { processors: (settings.processors / 2).max(1), ..settings.clone() };
    let (engine, _) = render::engine(&args, &subject, &half)?;
    Ok(Own { engine: Arc::new(engine), settings, has_depth: subject.hints.max_depth.is_some() })
}

/// An agent for each process that paints: more would only wait for one another.
fn agents_of(args: &RenderArgs, engine: &ExternalEngine) -> usize {
    args.agents.map_or(engine.lanes(), |asked| agents(Some(asked), 1))
}

/// Our own look at the scene, where the manifest says that we read the same format.
fn surveyor(args: &RenderArgs, located: &Located, opened: &Opened) -> Option<Surveyor> {
    use bottega_engines::external::manifest::Importance;
    if located.manifest().scene.importance != Importance::Builtin {
        return None;
    }
    let args = as_opened(args, opened);
    let once = Mutex::new(());
    Some(Box::new(move |width, height| {
        let _one = once.lock().unwrap_or_else(PoisonError::into_inner);
        let look = || -> Result<Survey, CliError> {
            let subject = Subject::load(&args.scene)?;
            let settings = render::job_settings(&args, &subject, vec![Expert::path_tracing()])?;
            let (engine, _) = render::engine(&args, &subject, &settings)?;
            Ok(engine.survey(width, height)?)
        };
        // What we do not read, or read wrongly, the engine looks at itself.
        look().inspect_err(|error| tracing::debug!(%error, "the scene is surveyed by its engine")).ok()
    }))
}
