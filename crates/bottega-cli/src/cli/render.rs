//! Options of `bottega render`, and their conversion to a request.

use std::{net::SocketAddr, path::PathBuf};

use bottega::{
    Request,
    devices::DeviceChoice,
    frames::Frames,
    request::{
        AdaptationChoice, AuctionChoice, BUILTIN, BalanceChoice, ColorSpace, FrameOptions, GuideChoice,
        ImportanceChoice, IntegratorChoice, InvalidField, OptimizationChoice, OutputOptions, PixelFilter, RulesSource,
        ToneCurve, WorkOptions,
    },
};
use bottega_cluster::FarmAddress;
use bottega_farm::PAPER_RULES_NAME;
use bottega_image::Rect;
use clap::{Args, ValueHint};

use super::{
    choice::choice,
    engine::EngineArgs,
    fields::{help, option_of},
    request::RequestArgs,
    scene::{SceneArgs, change, set},
    values::{LayerNames, parse_light_group, parse_rect},
};
use crate::{error::CliError, farm_args::LoginArgs, notifications::NotificationArgs, option_value::parse_seconds};

/// Light samples per bounce with `--as-in-paper`: with 64 samples per pixel the 1024 light samples of the paper's pictures
/// (MAGarRO, section 4).
const PAPER_LIGHT_SAMPLES: u32 = 16;

#[derive(Clone, Debug, Args)]
pub(crate) struct RenderArgs {
    /// The scene: glTF (.glb, .gltf), USD (.usd, .usda, .usdc, .usdz), Mitsuba 3 (.xml), pbrt-v4 (.pbrt), a mesh (.obj, .ply), or what --engine reads.
    #[arg(value_hint = ValueHint::FilePath, required_unless_present_any = ["request", "from"])]
    scene_file: Option<PathBuf>,
    /// The picture to write: .exr (linear light, all values) or .png (tone-mapped).
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath, required_unless_present_any = ["request", "dry_run"])]
    output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) request: RequestArgs,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,

    #[arg(long, value_name = "N", help_heading = "Quality", help = help("goal.samples"))]
    spp: Option<u32>,
    #[arg(long, value_name = "N", help_heading = "Quality", help = help("integrator.max_depth"))]
    max_depth: Option<u32>,
    #[arg(long, value_name = "E", conflicts_with = "time", help_heading = "Quality", help = help("goal.error"))]
    error: Option<f64>,
    /// Time limit, such as 90, 90s, 10m or 1.5h, from the start to the written file; --spp is then the maximum per pixel.
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, help_heading = "Quality")]
    time: Option<f64>,
    #[arg(long, value_name = "LEVEL", value_parser = choice::<OptimizationChoice>(), help_heading = "Quality", help = help("work.optimization"))]
    optimize: Option<OptimizationChoice>,
    /// Expert rules: an FCL file, or `paper` for those of the MAGarRO paper; default: path-tracing, which is built in, or those
    /// of the engine. May be repeated: agents carry them in turn.
    #[arg(long, value_name = "FILE|paper", value_hint = ValueHint::FilePath, help_heading = "Quality")]
    rules: Vec<PathBuf>,
    #[arg(long, value_name = "METHOD", value_parser = choice::<IntegratorChoice>(), help_heading = "Quality", help = help("integrator.method"))]
    integrator: Option<IntegratorChoice>,
    #[arg(long, value_name = "GUIDE", value_parser = choice::<GuideChoice>(), help_heading = "Quality", help = help("guide.by"))]
    guide: Option<GuideChoice>,
    #[arg(long, help_heading = "Quality", help = help("photons.progressive"))]
    progressive: bool,
    #[arg(long, value_name = "FILTER", value_parser = choice::<PixelFilter>(), help_heading = "Quality", help = help("film.filter"))]
    filter: Option<PixelFilter>,
    #[arg(long, value_name = "N", help_heading = "Quality", help = help("seed"))]
    seed: Option<u64>,

    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = parse_rect, help_heading = "Picture", help = help("film.crop"))]
    crop: Option<Rect>,
    /// Layers of the EXR file in addition to the color: names with commas between, `all` or `none`. The built-in engine has
    /// albedo, normal, depth, samples, cost, position, geometric-normal, uv, direct, indirect, error, motion, crypto-object,
    /// crypto-material and crypto-asset, and makes none by default; other engines make those that the scene asks for. Two
    /// engines make only the layers that both have.
    #[arg(long, value_name = "LIST", help_heading = "Output")]
    aov: Option<LayerNames>,
    #[arg(long = "light-group", value_name = "NAME=PATTERN", value_parser = parse_light_group, help_heading = "Output", help = help("film.light_groups"))]
    light_groups: Vec<(String, String)>,
    #[arg(long = "shadow-catcher", value_name = "PATTERN", help_heading = "Output", help = help("film.shadow_catchers"))]
    shadow_catchers: Vec<String>,
    #[arg(long, help_heading = "Output", help = help("film.denoise"))]
    denoise: bool,
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, help_heading = "Output", help = help("output.exposure"))]
    exposure: Option<f32>,
    #[arg(long, value_name = "CURVE", value_parser = choice::<ToneCurve>(), help_heading = "Output", help = help("output.tonemap"))]
    tonemap: Option<ToneCurve>,
    #[arg(long, help_heading = "Output", help = help("output.alpha"))]
    alpha: bool,
    #[arg(long, help_heading = "Output", help = help("output.half"))]
    half: bool,
    #[arg(long, value_name = "SPACE", value_parser = choice::<ColorSpace>(), help_heading = "Output", help = help("output.colorspace"))]
    colorspace: Option<ColorSpace>,

    #[command(flatten)]
    engine: EngineArgs,

    #[arg(long, value_name = "N", help_heading = "Work", help = help("work.agents"))]
    agents: Option<u16>,
    #[arg(long, value_name = "LIST", help_heading = "Work", help = help("devices.names"))]
    devices: Option<DeviceChoice>,
    #[arg(long, help_heading = "Work", help = help("devices.exact"))]
    exact: bool,
    /// Frames of an animation: numbers and ranges with both ends, such as 1..24, 1..9:2 (every second one), -5..5 or 1,4,7..9.
    /// The number of a frame replaces `####` or `%04d` in the name of the output. With --farm all machines paint all frames
    /// at once.
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true, conflicts_with_all = ["at", "dashboard", "preview", "trace", "record"], help_heading = "Work")]
    frames: Option<Frames>,
    #[arg(long, value_name = "FPS", help_heading = "Work", help = help("frames.fps"))]
    fps: Option<f32>,
    /// Paint with all machines of a farm: the one at this address, or the one that `bottega up` runs on this machine.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, conflicts_with_all = ["record", "time"], help_heading = "Work")]
    pub(crate) farm: Option<Option<FarmAddress>>,
    /// Submit the picture to the farm and return: `bottega jobs fetch` gets it later, and `bottega up --on` reports its end.
    #[arg(long, requires = "farm", conflicts_with = "on", help_heading = "Work")]
    pub(crate) detach: bool,
    #[arg(long, value_name = "N", requires = "farm", help_heading = "Work", help = help("farm.priority"))]
    priority: Option<u32>,
    #[arg(long, value_name = "K", requires = "farm", help_heading = "Work", help = help("farm.verify"))]
    verify: Option<u32>,
    #[arg(long, requires = "farm", help_heading = "Work", help = help("farm.strangers"))]
    strangers: bool,
    #[arg(long, value_name = "TAG", requires = "farm", help_heading = "Work", help = help("farm.require"))]
    require: Vec<String>,
    #[command(flatten)]
    pub(crate) login: LoginArgs,
    /// Continue an interrupted picture; of an animation, also paint the missing frames.
    #[arg(long, help_heading = "Work")]
    pub(crate) resume: bool,
    /// Serve a live view of the work on this address, such as 127.0.0.1:8080.
    #[arg(long, value_name = "ADDRESS", help_heading = "Output")]
    pub(crate) dashboard: Option<SocketAddr>,
    /// Show the picture in this PNG file while it is painted.
    #[arg(long, value_name = "FILE.png", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub(crate) preview: Option<PathBuf>,
    /// Show all layers in tev, a viewer that runs there, while they are painted; default port: 14158.
    #[arg(long, value_name = "HOST[:PORT]", conflicts_with_all = ["frames", "detach"], help_heading = "Output")]
    pub(crate) tev: Option<String>,
    /// Write every message between the agents to this file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub(crate) trace: Option<PathBuf>,
    /// Record the time of each zone, for `bottega simulate`.
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath, conflicts_with_all = ["resume", "error", "time"], help_heading = "Output")]
    pub(crate) record: Option<PathBuf>,
    /// Draw the work of each processor and device, the level of the work bin, and failures: .svg, or .json as data.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with = "frames", help_heading = "Output")]
    pub(crate) timeline: Option<PathBuf>,
    /// Share out the work as in the MAGarRO paper: its importance, zones, auction, adaptation and rules, 16 light samples
    /// per bounce for its rules to lower, one zone per agent at a time, none cut or taken over. --rules and --set override it.
    #[arg(long, help_heading = "Work")]
    as_in_paper: bool,
    /// Print nothing but errors.
    #[arg(short, long, conflicts_with = "json", help_heading = "Output")]
    pub(crate) quiet: bool,
    /// Also report how the work was shared out: survey, auction, expected times, work of processors and devices.
    #[arg(short, long, conflicts_with_all = ["json", "quiet"], help_heading = "Output")]
    pub(crate) verbose: bool,
    #[command(flatten)]
    pub(crate) notifications: NotificationArgs,
}

impl RenderArgs {
    /// Returns the request: the one read from a file or an image, if any, with the options applied.
    ///
    /// # Errors
    /// The request cannot be read, or is invalid.
    pub(crate) fn to_request(&self) -> Result<Request, CliError> {
        let mut request = match self.request.read()? {
            Some(request) => request,
            None => Request::new(self.scene_file.clone().unwrap_or_default()),
        };
        self.apply(&mut request)?;
        request.validate().map_err(|error| self.invalid(error))?;
        let request = self.scene.set_fields(request)?;
        if request.output.file.is_none() && !self.request.dry_run {
            return Err(CliError::usage("no output file is given", "give one with -o: .exr or .png"));
        }
        Ok(request)
    }

    /// Returns the error of a field. It names the option, unless the value may come from a request that was read.
    fn invalid(&self, mut error: InvalidField) -> CliError {
        if let Some(option) = option_of(&error.field).filter(|_| !self.request.is_given()) {
            error.field = option.to_owned();
        }
        bottega::Error::from(error).into()
    }

    /// Applies the options to a request.
    fn apply(&self, request: &mut Request) -> Result<(), CliError> {
        change(&mut request.scene.file, self.scene_file.clone());
        if self.as_in_paper {
            work_as_in_paper(&mut request.work);
        }
        self.scene.apply(request);
        set(&mut request.film.crop, self.crop.map(|crop| [crop.x0, crop.y0, crop.x1, crop.y1]));
        set(&mut request.film.filter, self.filter);
        set(&mut request.film.layers, self.aov.clone().map(|LayerNames(names)| names));
        if !self.light_groups.is_empty() {
            request.film.light_groups.clear();
        }
        for (name, pattern) in &self.light_groups {
            request.film.light_groups.entry(name.clone()).or_default().push(pattern.clone());
        }
        if !self.shadow_catchers.is_empty() {
            request.film.shadow_catchers.clone_from(&self.shadow_catchers);
        }
        request.film.denoise |= self.denoise;
        set(&mut request.goal.samples, self.spp);
        if self.error.is_some() || self.time.is_some() {
            (request.goal.error, request.goal.time) = (self.error, self.time);
        }
        set(&mut request.integrator.method, self.integrator);
        set(&mut request.integrator.max_depth, self.max_depth);
        request.photons.progressive |= self.progressive;
        set(&mut request.guide.by, self.guide);
        self.engine.apply(&mut request.engine);
        if self.as_in_paper && request.engine.names == [BUILTIN] {
            request.integrator.light_samples = PAPER_LIGHT_SAMPLES;
        }
        change(&mut request.seed, self.seed);
        self.apply_work(request);
        self.apply_output(&mut request.output);
        set(&mut request.frames, self.frames.clone().map(FrameOptions::new));
        match (self.fps, &mut request.frames) {
            (Some(fps), Some(frames)) => frames.fps = fps,
            (Some(_), None) => {
                return Err(CliError::usage("--fps needs --frames", "give the frames, or leave out --fps"));
            }
            (None, _) => {}
        }
        Ok(())
    }

    fn apply_work(&self, request: &mut Request) {
        let work = &mut request.work;
        set(&mut work.agents, self.agents);
        change(&mut work.optimization, self.optimize);
        if !self.rules.is_empty() {
            work.rules = self.rules.iter().cloned().map(RulesSource::File).collect();
        }
        change(&mut request.devices.names, self.devices.as_ref().map(DeviceChoice::names));
        request.devices.exact |= self.exact;
        change(&mut request.farm.priority, self.priority);
        set(&mut request.farm.verify, self.verify);
        request.farm.strangers |= self.strangers;
        if !self.require.is_empty() {
            request.farm.require = self.require.clone();
        }
    }

    fn apply_output(&self, output: &mut OutputOptions) {
        set(&mut output.file, self.output.clone());
        change(&mut output.exposure, self.exposure);
        change(&mut output.tonemap, self.tonemap);
        output.alpha |= self.alpha;
        output.half |= self.half;
        change(&mut output.colorspace, self.colorspace);
    }
}

/// Shares out the work as the MAGarRO paper describes it, without what is ours: no zone waits in an agent's hand, none is cut
/// near the end, none is taken over.
fn work_as_in_paper(work: &mut WorkOptions) {
    work.importance = ImportanceChoice::Paper;
    work.zone_balance = BalanceChoice::Ratio;
    (work.auction, work.adaptation) = (AuctionChoice::Paper, AdaptationChoice::Paper);
    (work.prefetch, work.share_tail) = (1, false);
    work.rules = vec![RulesSource::File(PAPER_RULES_NAME.into())];
}
