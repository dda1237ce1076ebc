//! Options of `bottega render`, and their conversion to a request.

use std::{net::SocketAddr, path::PathBuf};

use bottega::{
    Request,
    devices::DeviceChoice,
    frames::Frames,
    request::{
        AGENTS_MAX, AdaptationChoice, AuctionChoice, BalanceChoice, BandChoice, DEPTH_MAX, FrameOptions,
        ImportanceChoice, IntegratorChoice, LIGHT_SAMPLES_MAX, OptimizationChoice, PRIORITY_MAX, PixelFilter,
        PngEncoding, RulesSource, SAMPLES_MAX, ToneCurve, ZONES_MAX,
    },
};
use bottega_cluster::FarmAddress;
use bottega_farm::PAPER_RULES_NAME;
use bottega_image::Rect;
use clap::{Args, ValueHint};

use super::{
    choice::choice,
    engine::EngineArgs,
    light::{GuideArgs, LightingAgentArgs, PhotonArgs},
    request::RequestArgs,
    scene::{SceneArgs, change, set},
    values::{LayerNames, parse_bands, parse_error, parse_rate, parse_rect, parse_seconds, parse_stops},
};
use crate::{error::CliError, farm::LoginArgs, notifications::NotificationArgs};

#[derive(Clone, Debug, Args)]
pub(crate) struct RenderArgs {
    /// The scene: glTF (.glb, .gltf), Mitsuba 3 (.xml), pbrt-v4 (.pbrt), a mesh (.obj, .ply), or what --engine reads.
    #[arg(value_hint = ValueHint::FilePath, required_unless_present_any = ["request", "from"])]
    scene_file: Option<PathBuf>,
    /// The picture to write: .exr (linear light, all values) or .png (tone-mapped).
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath, required_unless_present_any = ["request", "dry_run"])]
    output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) request: RequestArgs,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,

    /// Samples a pixel; default: what the scene file asks for, or 64.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(SAMPLES_MAX)), help_heading = "Quality")]
    spp: Option<u32>,
    /// Bounces of light: 0 only what shines itself, 1 direct light, and so on; default: what the scene file asks for, or 16.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=i64::from(DEPTH_MAX)), help_heading = "Quality")]
    max_depth: Option<u32>,
    /// Light samples at each bounce. Default: 1.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(LIGHT_SAMPLES_MAX)), help_heading = "Quality")]
    light_samples: Option<u32>,
    /// Have rays be units of work of their own, which any device may follow, and shading be another: the way of the HRA paper.
    /// The picture has the same bits; which way is faster is in docs/hra.md.
    #[arg(long, help_heading = "Work")]
    wavefront: bool,
    /// Give each cell of 32 × 32 pixels samples until its estimated relative error is at most this, such as 0.05; --spp is
    /// then the most that a pixel gets (default: 4096). The picture does not depend on the machines that paint it.
    #[arg(long, value_name = "E", value_parser = parse_error, conflicts_with = "time", help_heading = "Quality")]
    error: Option<f64>,
    /// The best picture in so much time, such as 90, 90s, 10m or 1.5h, from start to written file; --spp is then the most
    /// that a pixel gets.
    #[arg(long, value_name = "TIME", value_parser = parse_seconds, help_heading = "Quality")]
    time: Option<f64>,
    /// Let the agents' expert rules trade quality for time, zone by zone. Default: off.
    #[arg(long, value_name = "LEVEL", value_parser = choice::<OptimizationChoice>(), help_heading = "Quality")]
    optimize: Option<OptimizationChoice>,
    /// The expert rules, as FCL text; default: path-tracing, which comes with the program, or with --engine NAME those of that
    /// engine. `paper` is the MAGarRO paper's own set. Give it several times and agents carry them in turn.
    #[arg(long, value_name = "FILE|paper", value_hint = ValueHint::FilePath, help_heading = "Quality")]
    rules: Vec<PathBuf>,
    /// How wide the bands are in which neighboring zones are blended: `off`, `rules` (the expert rules say it, edge by edge; the
    /// default), or so many pixels beyond each edge of each zone. What lies in a band is painted twice. Without --optimize there
    /// are none.
    #[arg(long, value_name = "off|rules|N", value_parser = parse_bands, help_heading = "Quality")]
    bands: Option<BandChoice>,
    /// How light is followed; default: what finds the light that the scene file's own integrator finds, or path.
    #[arg(long, value_name = "METHOD", value_parser = choice::<IntegratorChoice>(), help_heading = "Quality")]
    integrator: Option<IntegratorChoice>,
    #[command(flatten)]
    photons: PhotonArgs,
    #[command(flatten)]
    lighting_agents: LightingAgentArgs,
    #[command(flatten)]
    guide: GuideArgs,
    /// How samples are spread over a pixel; default: what the scene file asks for, or blackman-harris.
    #[arg(long, value_name = "FILTER", value_parser = choice::<PixelFilter>(), help_heading = "Quality")]
    filter: Option<PixelFilter>,
    /// Another seed gives other noise; the same seed the same picture, bit for bit. Default: 0.
    #[arg(long, value_name = "N", help_heading = "Quality")]
    seed: Option<u64>,

    /// Paint only this part of the picture; each pixel is the same as in the whole. Default: what the scene file asks for.
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = parse_rect, help_heading = "Picture")]
    crop: Option<Rect>,
    /// More values a pixel, as layers of the EXR file: names with commas between, `all` or `none`. Our own engine has
    /// albedo,normal,depth,samples,cost, and makes none unless asked. Of other engines all layers come out that the scene asks
    /// for, unless this says which of them. Of two engines: those that both mean the same by.
    #[arg(long, value_name = "LIST", help_heading = "Output")]
    aov: Option<LayerNames>,
    /// Remove what noise is left in the finished picture, by Intel's Open Image Denoise, which must be installed; BOTTEGA_OIDN
    /// names its file or folder where it is not found. Albedo and normals are made for it, and are layers of the EXR file then,
    /// as is the noisy color (`noisy`).
    #[arg(long, help_heading = "Output")]
    denoise: bool,
    /// Brighten (+) or darken (-) a PNG by so many stops.
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, value_parser = parse_stops, help_heading = "Output")]
    exposure: Option<f32>,
    /// How a PNG's highlights are brought into range. Default: agx.
    #[arg(long, value_name = "CURVE", value_parser = choice::<ToneCurve>(), help_heading = "Output")]
    tonemap: Option<ToneCurve>,
    /// How a PNG's values are stored. Default: srgb.
    #[arg(long, value_name = "ENCODING", value_parser = choice::<PngEncoding>(), help_heading = "Output")]
    encoding: Option<PngEncoding>,
    /// Write alpha into a PNG: transparent where the surroundings are seen. Without it, a PNG has alpha where the scene's film
    /// asks for it (Mitsuba's `pixel_format`). An EXR file always has it.
    #[arg(long, help_heading = "Output")]
    alpha: bool,
    /// Write 16-bit instead of 32-bit values into an EXR file.
    #[arg(long, help_heading = "Output")]
    half: bool,
    /// Write an EXR file in tiles instead of scan lines.
    #[arg(long, help_heading = "Output")]
    tiled: bool,

    #[command(flatten)]
    engine: EngineArgs,

    /// Render Agents that share the work; default: one for every two processors.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(AGENTS_MAX)), help_heading = "Work")]
    agents: Option<u16>,
    /// Devices that render: `auto` (the processors, and the best GPU if there is one; the default), or a list of `cpu` and parts
    /// of GPUs' names, see `bottega devices`. A GPU's pixels differ from a processor's in rounding; a scene that it cannot
    /// render is left to the processors.
    #[arg(long, value_name = "LIST", help_heading = "Work")]
    devices: Option<DeviceChoice>,
    /// Have every pixel the same to the last bit on all machines of a farm: processors alone paint it.
    #[arg(long, help_heading = "Work")]
    exact: bool,
    /// Memory that scenes may take on each GPU, in MiB. What does not fit is painted by the processors. Default: nearly all
    /// that it has.
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Work")]
    gpu_memory: Option<u32>,
    /// Paint these frames of an animation: a list of numbers and ranges, such as 1..24, 1..9:2 (every second one), -5..5 or
    /// 1,4,7..9; both ends of a range are painted. The number of a frame takes the place of `####` or `%04d` in the name of
    /// the output; one below 0 is `-` and then its digits. With --farm all frames are painted at once, by all machines.
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true, conflicts_with_all = ["at", "dashboard", "preview", "trace", "record"], help_heading = "Work")]
    frames: Option<Frames>,
    /// Frames a second: frame N shows the scene at N / FPS seconds. Default: 24.
    #[arg(long, value_name = "FPS", value_parser = parse_rate, help_heading = "Work")]
    fps: Option<f32>,
    /// Paint with all machines of a farm: the one that `bottega up` runs on this machine, or the one named.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, conflicts_with_all = ["record", "time"], help_heading = "Work")]
    pub(crate) farm: Option<Option<FarmAddress>>,
    /// Only ask the farm for the picture, and do not wait for it: `bottega jobs fetch` has it in the end, and
    /// `bottega up --on` tells of it.
    #[arg(long, requires = "farm", conflicts_with = "on", help_heading = "Work")]
    pub(crate) detach: bool,
    /// How urgent the picture is to the farm: jobs have machines in proportion to their priorities. Default: 10.
    #[arg(long, value_name = "N", requires = "farm", value_parser = clap::value_parser!(u32).range(1..=i64::from(PRIORITY_MAX)), help_heading = "Work")]
    priority: Option<u32>,
    /// Do not trust the machines of the farm: each zone counts when so many different ones have painted the same: bit for
    /// bit, or by its look where engines give no two of them the same bits. Of one that was right often only a part is
    /// compared; one that was wrong is left out, and what was taken on its word is painted again. Zones wait while there are
    /// fewer machines.
    #[arg(long, value_name = "K", requires = "farm", value_parser = clap::value_parser!(u32).range(1..=i64::from(bottega_farm::VERIFY_MAX)), help_heading = "Work")]
    verify: Option<u32>,
    /// Let agents of other platforms paint zones, by FIPA and with engines of their own: the picture then depends on who
    /// painted it. With --verify 2 what each paints is compared with what another one does.
    #[arg(long, requires = "farm", help_heading = "Work")]
    strangers: bool,
    /// Have it painted by machines with this tag alone (`bottega join --tag`), beside this one. May be said again: all are needed.
    #[arg(long, value_name = "TAG", requires = "farm", help_heading = "Work")]
    require: Vec<String>,
    #[command(flatten)]
    pub(crate) login: LoginArgs,
    /// Go on with a picture that was interrupted; of an animation, paint the frames that are not there yet, and go on with one
    /// that was interrupted.
    #[arg(long, help_heading = "Work")]
    pub(crate) resume: bool,
    /// Serve a live view of the work on this address, such as 127.0.0.1:8080.
    #[arg(long, value_name = "ADDRESS", help_heading = "Output")]
    pub(crate) dashboard: Option<SocketAddr>,
    /// Show the picture in this PNG file while it is painted: coarse and complete at once, then better and better.
    #[arg(long, value_name = "FILE.png", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub(crate) preview: Option<PathBuf>,
    /// Show all layers in tev, a viewer that runs there, while they are painted; its port is 14158 unless it is named.
    #[arg(long, value_name = "HOST[:PORT]", conflicts_with_all = ["frames", "detach"], help_heading = "Output")]
    pub(crate) tev: Option<String>,
    /// Write every message between the agents to this file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub(crate) trace: Option<PathBuf>,
    /// Write down what each zone took, for `bottega simulate`.
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath, conflicts_with_all = ["resume", "error", "time"], help_heading = "Output")]
    pub(crate) record: Option<PathBuf>,
    /// Draw what each processor and device was at, how full the work bin was and what went wrong: .svg, or .json as data.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with = "frames", help_heading = "Output")]
    pub(crate) timeline: Option<PathBuf>,
    /// How the winners of an auction among the agents are found. Default: finishing-time.
    #[arg(long, value_name = "RULE", value_parser = choice::<AuctionChoice>(), help_heading = "Work")]
    auction: Option<AuctionChoice>,
    /// How agents learn their speed. Default: ratio.
    #[arg(long, value_name = "RULE", value_parser = choice::<AdaptationChoice>(), help_heading = "Work")]
    adaptation: Option<AdaptationChoice>,
    /// As in the MAGarRO paper: --importance paper, --zone-balance ratio, --auction paper, --adaptation paper and --rules paper,
    /// where nothing else is said.
    #[arg(long, help_heading = "Work")]
    as_in_paper: bool,
    /// Cut the picture into about so many zones; default: by --zone-max-complexity, or else by the number of agents.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(ZONES_MAX)), help_heading = "Work")]
    zones: Option<u32>,
    /// Say nothing but errors.
    #[arg(short, long, conflicts_with = "json", help_heading = "Output")]
    pub(crate) quiet: bool,
    /// Also say how the work was shared out: survey, auction, expected times, what processors and devices did.
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
        let request = self.request.set(request)?;
        request.validate().map_err(bottega::Error::from)?;
        if request.output.file.is_none() && !self.request.dry_run {
            return Err(CliError::usage("where is the picture to go?", "name a file with -o: .exr or .png"));
        }
        Ok(request)
    }

    /// Applies the options to a request.
    fn apply(&self, request: &mut Request) -> Result<(), CliError> {
        change(&mut request.scene.file, self.scene_file.clone());
        if self.as_in_paper {
            let work = &mut request.work;
            work.importance = ImportanceChoice::Paper;
            (work.auction, work.adaptation) = (AuctionChoice::Paper, AdaptationChoice::Paper);
            work.zone_balance = BalanceChoice::Ratio;
            work.rules = vec![RulesSource::File(PAPER_RULES_NAME.into())];
        }
        self.scene.apply(request);
        set(&mut request.film.crop, self.crop.map(|crop| [crop.x0, crop.y0, crop.x1, crop.y1]));
        set(&mut request.film.filter, self.filter);
        set(&mut request.film.layers, self.aov.clone().map(|LayerNames(names)| names));
        request.film.denoise |= self.denoise;
        set(&mut request.goal.samples, self.spp);
        if self.error.is_some() || self.time.is_some() {
            (request.goal.error, request.goal.time) = (self.error, self.time);
        }
        let integrator = &mut request.integrator;
        set(&mut integrator.method, self.integrator);
        set(&mut integrator.max_depth, self.max_depth);
        change(&mut integrator.light_samples, self.light_samples);
        integrator.wavefront |= self.wavefront;
        self.photons.apply(&mut request.photons);
        self.lighting_agents.apply(&mut request.lighting_agents);
        self.guide.apply(&mut request.guide);
        self.engine.apply(&mut request.engine);
        change(&mut request.seed, self.seed);
        self.apply_work(request);
        self.apply_output(request);
        set(&mut request.frames, self.frames.clone().map(FrameOptions::new));
        match (self.fps, &mut request.frames) {
            (Some(fps), Some(frames)) => frames.fps = fps,
            (Some(_), None) => {
                return Err(CliError::usage("--fps is for --frames", "say which frames, or leave it out"));
            }
            (None, _) => {}
        }
        Ok(())
    }

    fn apply_work(&self, request: &mut Request) {
        let work = &mut request.work;
        set(&mut work.agents, self.agents);
        set(&mut work.zones, self.zones);
        change(&mut work.auction, self.auction);
        change(&mut work.adaptation, self.adaptation);
        change(&mut work.optimization, self.optimize);
        change(&mut work.bands, self.bands);
        if !self.rules.is_empty() {
            work.rules = self.rules.iter().cloned().map(RulesSource::File).collect();
        }
        change(&mut request.devices.names, self.devices.as_ref().map(DeviceChoice::names));
        request.devices.exact |= self.exact;
        set(&mut request.devices.memory_mb, self.gpu_memory);
        change(&mut request.farm.priority, self.priority);
        set(&mut request.farm.verify, self.verify);
        request.farm.strangers |= self.strangers;
        if !self.require.is_empty() {
            request.farm.require = self.require.clone();
        }
    }

    fn apply_output(&self, request: &mut Request) {
        let output = &mut request.output;
        set(&mut output.file, self.output.clone());
        change(&mut output.exposure, self.exposure);
        change(&mut output.tonemap, self.tonemap);
        change(&mut output.encoding, self.encoding);
        output.alpha |= self.alpha;
        output.half |= self.half;
        output.tiled |= self.tiled;
    }
}
