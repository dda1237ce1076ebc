//! What the command line takes. Everything here is checked before any work begins.

mod guiding;
mod layers;
mod lighting_agents;
mod photons;
mod values;

use std::{net::SocketAddr, path::PathBuf, time::Duration};

use bottega_farm::{Channel, ChannelSet, ImportanceFunction};
use bottega_image::Rect;
use bottega_render::{AgentSettings, ala::Criterion};
use bottega_scene::LoadOptions;
use clap::{Args, Parser, Subcommand, ValueHint};

pub(crate) use self::guiding::GuideArg;
pub(crate) use self::layers::{GUIDES, LayersArg};
pub(crate) use self::values::{
    DEPTH_MAX, EncodingArg, EnvironmentArg, FilterArg, ImportanceArg, IntegratorArg, OptimizeArg, SAMPLES_MAX, Size,
    ToneArg, parse_define, parse_duration, parse_size,
};
use self::values::{
    parse_channel, parse_criterion, parse_distance, parse_environment, parse_error, parse_factor, parse_rate,
    parse_rect, parse_share, parse_stops, parse_time,
};
use self::{guiding::GuideArgs, lighting_agents::LightingAgentArgs, photons::PhotonArgs};
use crate::{
    bench::{AlaArgs, EnginesBenchArgs, FarmBenchArgs, HraBenchArgs, MagarroArgs},
    devices::DeviceChoice,
    engines::{EngineArgs, EnginesArgs},
    farm::{FarmAddress, JobsArgs, JoinArgs, LoginArgs, MachinesArgs, PRIORITY, PRIORITY_MAX, UpArgs},
    frames::Frames,
    identity,
    platform::PlatformArgs,
    rules::RulesArgs,
    simulate::args::SimulateArgs,
};

/// A physically based renderer whose work is shared out by agents.
#[derive(Debug, Parser)]
#[command(
    name = "bottega",
    version = identity::description(),
    after_help = "Start with:\n  bottega render scene.glb -o picture.png\n  bottega render --help"
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Paint a picture of a scene.
    Render(Box<RenderArgs>),
    /// Show what the Analyst thinks of a scene: importance map, zones and predicted cost.
    Analyze(AnalyzeArgs),
    /// Compare two pictures: RMSE, relMSE, FLIP, and where they differ; or look for seams between zones.
    Diff(DiffArgs),
    /// Say what is in a scene file.
    Info(InfoArgs),
    /// Say what other agents would have made of a work that was recorded, or of a synthetic one.
    Simulate(Box<SimulateArgs>),
    /// Start a farm on this machine: many machines paint one picture.
    Up(UpArgs),
    /// Offer this machine to a farm.
    Join(JoinArgs),
    /// See and steer what a farm is asked for.
    Jobs(JobsArgs),
    /// See and steer the machines of a farm.
    Machines(MachinesArgs),
    /// See, check and try the other renderers that can paint.
    Engines(EnginesArgs),
    /// Check, evaluate and draw expert rules.
    Rules(RulesArgs),
    /// Run a FIPA agent platform, or ask one what it knows.
    Platform(PlatformArgs),
    /// Measure this machine and this program.
    Bench(BenchArgs),
    /// List the devices that can take part in rendering.
    Devices(DevicesArgs),
    /// Print completions for a shell.
    #[command(
        after_help = "For example: bottega completions bash > ~/.local/share/bash-completion/completions/bottega"
    )]
    Completions {
        /// Which shell.
        shell: clap_complete::Shell,
    },
}

/// Which scene file, and how it is read.
#[derive(Clone, Debug, Args)]
pub(crate) struct FileArgs {
    /// The scene: glTF (.glb, .gltf), Mitsuba 3 (.xml), pbrt-v4 (.pbrt), or a mesh (.obj, .ply).
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene: PathBuf,
    /// Refuse the scene when something in it is not supported, instead of painting a substitute.
    #[arg(long, help_heading = "Scene file")]
    pub(crate) strict: bool,
    /// Let the scene read files outside of its own folder.
    #[arg(long, help_heading = "Scene file")]
    pub(crate) allow_outside: bool,
    /// Let the scene read files below this folder too, by whatever path or symbolic link it leads there; may be repeated.
    #[arg(long = "asset-root", value_name = "FOLDER", value_hint = ValueHint::DirPath, help_heading = "Scene file")]
    pub(crate) asset_roots: Vec<PathBuf>,
    /// Let the camera see through the backs of a glTF scene's materials that are not double-sided, as viewers do.
    #[arg(long, help_heading = "Scene file")]
    pub(crate) cull_backfaces: bool,
    /// Set a parameter of a Mitsuba scene (its `<default>`s, used as `$NAME`).
    #[arg(short = 'D', long = "define", value_name = "NAME=VALUE", value_parser = parse_define, help_heading = "Scene file")]
    pub(crate) defines: Vec<(String, String)>,
    /// Show the animations of a glTF scene at this time; default: the scene as its file describes it.
    #[arg(long, value_name = "SECONDS", value_parser = parse_time, allow_negative_numbers = true, help_heading = "Scene file")]
    pub(crate) at: Option<f32>,
    /// The animation to show, by name or by number from 0; default: all, the first one where several move the same.
    #[arg(long, value_name = "NAME", help_heading = "Scene file")]
    pub(crate) animation: Option<String>,
    /// Which of a glTF file's variants of materials to show, by name or by number from 0.
    #[arg(long, value_name = "NAME", help_heading = "Scene file")]
    pub(crate) variant: Option<String>,
}

impl FileArgs {
    /// How the file is read.
    pub(crate) fn options(&self) -> LoadOptions {
        LoadOptions {
            strict: self.strict,
            allow_outside: self.allow_outside,
            asset_roots: self.asset_roots.clone(),
            cull_backfaces: self.cull_backfaces,
            defines: self.defines.clone(),
            at: self.at,
            animation: self.animation.clone(),
            variant: self.variant.clone(),
            ..LoadOptions::default()
        }
    }
}

/// Which scene, which camera, how large: what `render` and `analyze` share.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    #[command(flatten)]
    pub(crate) file: FileArgs,
    /// Size of the picture in pixels; default: what the scene file asks for, or 720 high and as wide as the camera says.
    #[arg(long, value_name = "WxH", value_parser = parse_size, help_heading = "Picture")]
    pub(crate) size: Option<Size>,
    /// The camera, by name or by number from 0; default: the file's first.
    #[arg(long, value_name = "NAME", help_heading = "Picture")]
    pub(crate) camera: Option<String>,
    /// Radius of the lens in scene units: what is not at the focus distance blurs; 0: all is sharp.
    #[arg(long, value_name = "RADIUS", value_parser = parse_factor, requires = "focus_distance", help_heading = "Picture")]
    pub(crate) lens_radius: Option<f32>,
    /// Distance from the camera at which things are sharp, in scene units.
    #[arg(long, value_name = "DISTANCE", value_parser = parse_distance, help_heading = "Picture")]
    pub(crate) focus_distance: Option<f32>,
    /// Light from all around: an .hdr, .exr or .png picture of the whole sphere, one radiance as R,G,B, or `sky`, the
    /// neutral one that a scene without any light gets by itself.
    #[arg(long, value_name = "FILE|R,G,B|sky", value_parser = parse_environment, help_heading = "Light")]
    pub(crate) env: Option<EnvironmentArg>,
    /// Turn the environment about the vertical axis.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, help_heading = "Light")]
    pub(crate) env_rotate: f32,
    /// Multiply the environment's light.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = parse_factor, help_heading = "Light")]
    pub(crate) env_strength: f32,
    /// Processors to use; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Work")]
    pub(crate) threads: Option<u16>,
    /// How the picture is cut: 0 not at all, 1 by importance, 2 joined, 3 balanced.
    #[arg(long, value_name = "LEVEL", default_value_t = 3, value_parser = clap::value_parser!(u8).range(0..=3), help_heading = "Work")]
    pub(crate) level: u8,
    /// Which measure makes the importance map.
    #[arg(long, value_enum, default_value_t = ImportanceArg::Predicted, help_heading = "Work")]
    pub(crate) importance: ImportanceArg,
    /// What the measure knows of a place; default: everything. What is left out counts everywhere as its mean, and tells
    /// no places apart. For `predicted`: steps,shadow,material; for `visual`: recursion,depth,indirect,texture,noise,
    /// saliency.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse_channel, help_heading = "Work")]
    pub(crate) channels: Option<Vec<Channel>>,
    /// Print one JSON object a line instead of text for people.
    #[arg(long, help_heading = "Output")]
    pub(crate) json: bool,
}

impl SceneArgs {
    /// The measure, of the channels that are on.
    pub(crate) fn importance_function(&self) -> ImportanceFunction {
        let channels = self.channels.iter().flatten().copied().collect::<ChannelSet>();
        let channels = if self.channels.is_some() { channels } else { ChannelSet::ALL };
        match self.importance {
            ImportanceArg::Predicted => ImportanceFunction::PredictedCost(channels),
            ImportanceArg::Paper => ImportanceFunction::Paper,
            ImportanceArg::Visual => ImportanceFunction::Visual(channels),
        }
    }
}

#[derive(Clone, Debug, Args)]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// The picture to write: .exr (linear light, all values) or .png (tone-mapped).
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) output: PathBuf,

    /// Samples a pixel; default: what the scene file asks for, or 64.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=SAMPLES_MAX as i64), help_heading = "Quality")]
    pub(crate) spp: Option<u32>,
    /// Bounces of light: 0 only what shines itself, 1 direct light, and so on; default: what the scene file asks for, or 16.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=DEPTH_MAX as i64), help_heading = "Quality")]
    pub(crate) max_depth: Option<u32>,
    /// Light samples at each bounce.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024), help_heading = "Quality")]
    pub(crate) light_samples: u32,
    /// Give each cell of 32 × 32 pixels samples until its estimated relative error is at most this, such as 0.05; --spp is
    /// then the most that a pixel gets (default: 4096). Whoever paints it, the picture is the same.
    #[arg(long, value_name = "E", value_parser = parse_error, conflicts_with = "time", help_heading = "Quality")]
    pub(crate) error: Option<f64>,
    /// The best picture in so much time, such as 90, 90s, 10m or 1.5h, from start to written file; --spp is then the most
    /// that a pixel gets.
    #[arg(long, value_name = "TIME", value_parser = parse_duration, help_heading = "Quality")]
    pub(crate) time: Option<Duration>,
    /// Let the agents' expert rules trade quality for time, zone by zone.
    #[arg(long, value_enum, value_name = "LEVEL", default_value_t = OptimizeArg::Off, help_heading = "Quality")]
    pub(crate) optimize: OptimizeArg,
    /// The expert rules, as FCL text; default: path-tracing, which comes with the program, or with --engine NAME those of that
    /// engine. Give it several times and agents carry them in turn.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Quality")]
    pub(crate) rules: Vec<PathBuf>,
    /// How light is followed; default: what finds the light that the scene file's own integrator finds, or path.
    #[arg(long, value_enum, help_heading = "Quality")]
    pub(crate) integrator: Option<IntegratorArg>,
    #[command(flatten)]
    pub(crate) photon_mapping: PhotonArgs,
    #[command(flatten)]
    pub(crate) lighting: LightingAgentArgs,
    #[command(flatten)]
    pub(crate) guiding: GuideArgs,
    /// How samples are spread over a pixel; default: what the scene file asks for, or blackman-harris.
    #[arg(long, value_enum, help_heading = "Quality")]
    pub(crate) filter: Option<FilterArg>,
    /// Another seed gives other noise; the same seed the same picture, bit for bit.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Quality")]
    pub(crate) seed: u64,

    /// Paint only this part of the picture; each pixel is the same as in the whole. Default: what the scene file asks for.
    #[arg(long, value_name = "x0,y0,x1,y1", value_parser = parse_rect, help_heading = "Picture")]
    pub(crate) crop: Option<Rect>,
    /// More values a pixel, as layers of the EXR file: names with commas between, `all` or `none`. Our own engine has
    /// albedo,normal,depth,samples,cost, and makes none unless asked. Of other engines all layers come out that the scene asks
    /// for, unless this says which of them. Of two engines: those that both mean the same by.
    #[arg(long, value_name = "LIST", help_heading = "Output")]
    pub(crate) aov: Option<LayersArg>,
    /// Remove what noise is left in the finished picture, by Intel's Open Image Denoise, which must be installed; BOTTEGA_OIDN
    /// names its file or folder where it is not found. Albedo and normals are made for it, and are layers of the EXR file then,
    /// as is the noisy color (`noisy`).
    #[arg(long, help_heading = "Output")]
    pub(crate) denoise: bool,
    /// Brighten (+) or darken (-) a PNG by so many stops.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = parse_stops, help_heading = "Output")]
    pub(crate) exposure: f32,
    /// How a PNG's highlights are brought into range.
    #[arg(long, value_enum, default_value_t = ToneArg::Agx, help_heading = "Output")]
    pub(crate) tonemap: ToneArg,
    /// How a PNG's values are stored.
    #[arg(long, value_enum, default_value_t = EncodingArg::Srgb, help_heading = "Output")]
    pub(crate) encoding: EncodingArg,
    /// Write alpha into a PNG: transparent where the surroundings are seen. Without it, a PNG has alpha where the scene's film
    /// asks for it (Mitsuba's `pixel_format`). An EXR file always has it.
    #[arg(long, help_heading = "Output")]
    pub(crate) alpha: bool,
    /// Write 16-bit instead of 32-bit values into an EXR file.
    #[arg(long, help_heading = "Output")]
    pub(crate) half: bool,
    /// Write an EXR file in tiles instead of scan lines.
    #[arg(long, help_heading = "Output")]
    pub(crate) tiled: bool,

    #[command(flatten)]
    pub(crate) engines: EngineArgs,

    /// Render Agents that share the work; default: one for every two processors.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Work")]
    pub(crate) agents: Option<u16>,
    /// Who paints: `auto` (the processors, and the best GPU if there is one), or a list of `cpu` and parts of GPUs' names, see
    /// `bottega devices`. A GPU's pixels differ from a processor's in rounding, and a scene that is none for it is painted by
    /// the processors.
    #[arg(long, value_name = "LIST", default_value = "auto", help_heading = "Work")]
    pub(crate) devices: DeviceChoice,
    /// Have every pixel the same to the last bit, whoever paints it: by processors alone, on all machines of a farm.
    #[arg(long, help_heading = "Work")]
    pub(crate) exact: bool,
    /// Paint these frames of an animation: a list of numbers and ranges, such as 1..24, 1..9:2 (every second one), -5..5 or
    /// 1,4,7..9; both ends of a range are painted. The number of a frame takes the place of `####` or `%04d` in the name of
    /// the output; one below 0 is `-` and then its digits. With --farm all frames are painted at once, by all machines.
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true, conflicts_with_all = ["at", "dashboard", "preview", "trace", "record"], help_heading = "Work")]
    pub(crate) frames: Option<Frames>,
    /// Frames a second: frame N shows the scene at N / FPS seconds.
    #[arg(long, value_name = "FPS", default_value_t = 24.0, requires = "frames", value_parser = parse_rate, help_heading = "Work")]
    pub(crate) fps: f32,
    /// Paint with all machines of a farm: the one that `bottega up` runs on this machine, or the one named.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, conflicts_with_all = ["record", "time"], help_heading = "Work")]
    pub(crate) farm: Option<Option<FarmAddress>>,
    /// Only ask the farm for the picture, and do not wait for it: `bottega jobs fetch` has it in the end.
    #[arg(long, requires = "farm", help_heading = "Work")]
    pub(crate) detach: bool,
    /// How urgent the picture is to the farm: jobs have machines in proportion to their priorities.
    #[arg(long, value_name = "N", requires = "farm", default_value_t = PRIORITY, value_parser = clap::value_parser!(u32).range(1..=i64::from(PRIORITY_MAX)), help_heading = "Work")]
    pub(crate) priority: u32,
    /// Do not trust the machines of the farm: each zone counts when so many different ones have painted the same: bit for
    /// bit, or by its look where engines give no two of them the same bits. Of one that was right often only a part is compared; one that was wrong is left out, and what was taken on its word is
    /// painted again. Zones wait while there are fewer machines.
    #[arg(long, value_name = "K", requires = "farm", value_parser = clap::value_parser!(u32).range(1..=i64::from(bottega_farm::VERIFY_MAX)), help_heading = "Work")]
    pub(crate) verify: Option<u32>,
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
    /// Write every message between the agents to this file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub(crate) trace: Option<PathBuf>,
    /// Write down what each zone took, for `bottega simulate`.
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath, conflicts_with_all = ["resume", "error", "time"], help_heading = "Output")]
    pub(crate) record: Option<PathBuf>,
    /// Cut the picture into about so many zones; default: by the number of agents.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 20), help_heading = "Work")]
    pub(crate) zones: Option<u32>,
    /// Say nothing but errors.
    #[arg(short, long, conflicts_with = "json", help_heading = "Output")]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
pub(crate) struct AnalyzeArgs {
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Folder for the pictures: the cost map, the visual importance, every channel, the zones of each level; and for
    /// index.json, which says what is what.
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) output: PathBuf,
    /// Paint every zone of these levels, again and again, and tell how well its time was predicted: by the map alone, and
    /// after profiling. One processor does it, unless --threads says otherwise.
    #[arg(long, value_name = "LEVELS", num_args = 0..=1, require_equals = true, default_missing_value = "1,2,3", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=3), help_heading = "Work")]
    pub(crate) verify: Vec<u8>,
    /// How often --verify paints a zone; of its times the shortest counts, because what disturbs only adds.
    #[arg(long, value_name = "N", default_value_t = 4, requires = "verify", value_parser = clap::value_parser!(u8).range(2..=100), help_heading = "Work")]
    pub(crate) repeat: u8,
    /// Samples a pixel of --verify.
    #[arg(long, value_name = "N", default_value_t = 64, requires = "verify", value_parser = clap::value_parser!(u32).range(2..=1 << 16), help_heading = "Work")]
    pub(crate) spp: u32,
    /// Agents that the zones are meant for; default: one for every two processors.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Work")]
    pub(crate) agents: Option<u16>,
    /// Show how much photons and lighting agents differ from those near them: their local useful data density by these
    /// criteria: normal,power,direction,irradiance,importance.
    #[arg(long, value_name = "CRITERIA", value_delimiter = ',', value_parser = parse_criterion, help_heading = "Useful data density")]
    pub(crate) ludd: Vec<Criterion>,
    /// How near, as a share of the radius of what the camera sees, or of the scene where that is not much wider.
    #[arg(long, value_name = "R", default_value_t = 0.05, requires = "ludd", value_parser = parse_share, help_heading = "Useful data density")]
    pub(crate) ludd_radius: f32,
    /// Photons that leave the lights.
    #[arg(long, value_name = "N", default_value_t = 100_000, requires = "ludd", value_parser = clap::value_parser!(u32).range(1..=10_000_000), help_heading = "Useful data density")]
    pub(crate) photons: u32,
    /// Lighting agents that the lights cast.
    #[arg(long, value_name = "N", default_value_t = AgentSettings::default().cast, requires = "ludd", value_parser = clap::value_parser!(u32).range(0..=10_000_000), help_heading = "Useful data density")]
    pub(crate) lighting_agents: u32,
}

#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// The picture to judge: EXR, PNG or HDR.
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) picture: PathBuf,
    /// The picture that it should equal. Only --seams can do without.
    #[arg(value_hint = ValueHint::FilePath, required_unless_present = "seams")]
    pub(crate) reference: Option<PathBuf>,
    /// Say whether the edges of zones can be seen: the zones are those in the index.json that `bottega analyze` writes.
    #[arg(long, value_name = "INDEX.json", value_hint = ValueHint::FilePath)]
    pub(crate) seams: Option<PathBuf>,
    /// The level of partition of --seams.
    #[arg(long, value_name = "LEVEL", default_value_t = 3, requires = "seams", value_parser = clap::value_parser!(u8).range(1..=3))]
    pub(crate) level: u8,
    /// Write where they differ (FLIP, dark: equal, bright: different) as a PNG.
    #[arg(short, long, value_name = "FILE.png", value_hint = ValueHint::FilePath, requires = "reference")]
    pub(crate) output: Option<PathBuf>,
    /// Exit with 1 when the mean FLIP error is above this.
    #[arg(long, value_name = "FLIP", requires = "reference")]
    pub(crate) fail_above: Option<f32>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    #[command(flatten)]
    pub(crate) file: FileArgs,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    #[command(subcommand)]
    pub(crate) what: BenchCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// Rays per second by kind of ray, and paths per second.
    Rays {
        /// Scenes to measure; whose paths a second are measured beside the rays of built-in ones.
        #[arg(value_hint = ValueHint::FilePath)]
        scenes: Vec<PathBuf>,
        /// Repetitions, interleaved; the median is printed.
        #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=100))]
        repeat: u16,
        /// The GPU whose name contains this is measured too, by itself: its rays do not travel.
        #[arg(long, value_name = "NAME")]
        gpu: Option<String>,
        /// Print one JSON object instead of text for people.
        #[arg(long)]
        json: bool,
    },
    /// Error and time beside other renderers on the same triangles: efficiencies, and ours over theirs.
    Peers(PeersArgs),
    /// What it costs that bottega has another engine paint in zones, beside the same picture as one window.
    Engines(EnginesBenchArgs),
    /// Awards a second, and how long an agent waits for one, in a farm of many agents on a real NATS server.
    Farm(Box<FarmBenchArgs>),
    /// The tables of the HRA paper: rays by direct calls, through the allocator, and with a GPU beside the processors.
    Hra(HraBenchArgs),
    /// The tables of the MAGarRO paper: time by agents, partition and optimization, and what optimization does to the picture.
    Magarro(MagarroArgs),
    /// The tables and figures of the paper on Autonomous Lighting Agents: photon mapping, its agents, and ours.
    Ala(AlaArgs),
}

#[derive(Debug, Args)]
pub(crate) struct PeersArgs {
    /// Folder with the scenes: SCENE.json (ours, and Cycles'), SCENE.xml (Mitsuba's), SCENE.scn (LuxCore's), the PLY meshes
    /// that they name, and reference/ref_SCENE.exr.
    #[arg(value_hint = ValueHint::DirPath)]
    pub(crate) folder: PathBuf,
    /// A scene by name; may be given more than once. Default: all.
    #[arg(long, value_name = "NAME")]
    pub(crate) scene: Vec<String>,
    /// Samples a pixel.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub(crate) spp: u32,
    /// Repetitions, interleaved; medians of the times and means of the errors are printed.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    pub(crate) repeat: u16,
    /// Only those others whose names begin so (`mitsuba`, `mitsuba llvm`, `cycles`, `luxcore`); may be given more than
    /// once.
    #[arg(long, value_name = "NAME")]
    pub(crate) peer: Vec<String>,
    /// What our paths learn beforehand; the time for it counts.
    #[arg(long, value_enum, default_value_t = GuideArg::Ala)]
    pub(crate) guide: GuideArg,
    /// Numbers of threads to paint with. Default: one, and as many as there are processors.
    #[arg(long, value_delimiter = ',', value_parser = parse_threads)]
    pub(crate) threads: Vec<usize>,
    /// The Python that has the modules of the others (mitsuba, bpy, pyluxcore); who is missing is left out.
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    pub(crate) python: String,
    /// Compare the time of the processors, not of the clock: for a machine that has other work as well.
    #[arg(long)]
    pub(crate) processor_time: bool,
    /// How long one picture of another renderer may take, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 3600)]
    pub(crate) timeout: u64,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

impl PeersArgs {
    /// Whether another renderer is to be run.
    pub(crate) fn includes(&self, name: &str) -> bool {
        self.peer.is_empty() || self.peer.iter().any(|wanted| name.starts_with(wanted.as_str()))
    }
}

fn parse_threads(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(threads @ 1..=1024) => Ok(threads),
        _ => Err("a number from 1 to 1024 is needed".to_owned()),
    }
}

#[derive(Debug, Args)]
pub(crate) struct DevicesArgs {
    /// Measure what work costs on each of them, and who would do how much of it; what is learnt is kept for `render`.
    #[arg(long)]
    pub(crate) bench: bool,
    /// Measure the GPUs whose names contain this, software too; default: all that are no software.
    #[arg(long, value_name = "NAME", requires = "bench")]
    pub(crate) gpu: Option<String>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}
