//! The command line. All arguments are checked before any work begins.

mod choice;
mod engine;
mod fields;
mod render;
mod request;
mod scene;
mod values;
mod words;

use std::path::PathBuf;

use bottega_cluster::build::build;
use bottega_render::ala::Criterion;
use clap::{ArgGroup, Args, Parser, Subcommand, ValueHint};

use self::values::{parse_criterion, parse_share};
pub(crate) use self::{
    choice::choice,
    fields::SET_FIELDS,
    render::RenderArgs,
    request::{RequestCommand, RequestCommandArgs, read as read_request},
    scene::{ImportArgs, SceneArgs},
    values::{Size, parse_define, parse_size},
    words::{line, words},
};
use crate::{
    board::BoardArgs,
    config::{ConfigArgs, PROFILE_VARIABLE},
    engines::EnginesArgs,
    farm::{BlackboardArgs, JobsArgs, JoinArgs, MachinesArgs, TokensArgs, UpArgs, WebCommandArgs},
    manual::ManualArgs,
    platform::PlatformArgs,
    rules::RulesArgs,
    simulate::args::SimulateArgs,
};

/// A physically based renderer whose work is shared out by agents.
#[derive(Debug, Parser)]
#[command(
    name = "bottega",
    version = build().description()
)]
pub(crate) struct Cli {
    /// Add the options of this profile: see `bottega config`.
    #[arg(long, value_name = "NAME", global = true, env = PROFILE_VARIABLE, hide_env = true)]
    profile: Option<String>,
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Paint a picture of a scene.
    Render(Box<RenderArgs>),
    /// Print, check and read requests: descriptions of pictures in JSON.
    Request(RequestCommandArgs),
    /// Draw the importance map, zones and predicted cost of a scene.
    Analyze(AnalyzeArgs),
    /// Compare two pictures by RMSE, relMSE and FLIP, or look for seams.
    Diff(DiffArgs),
    /// Print the contents of a scene file.
    Info(InfoArgs),
    /// Replay a recorded or a synthetic work with other agents.
    Simulate(Box<SimulateArgs>),
    /// Start a farm on this machine: many machines paint one picture.
    Up(UpArgs),
    /// Serve the page and the HTTP API of a farm that is up.
    Web(WebCommandArgs),
    /// Offer this machine to a farm.
    Join(JoinArgs),
    /// See and steer the jobs of a farm.
    Jobs(JobsArgs),
    /// Show the zones and agents of a farm's job, row by row.
    Blackboard(BlackboardArgs),
    /// See and steer the machines of a farm.
    Machines(MachinesArgs),
    /// List, make and revoke the tokens of a farm's page and API.
    Tokens(TokensArgs),
    /// List, check and try external render engines.
    Engines(EnginesArgs),
    /// Check, evaluate and draw expert rules.
    Rules(RulesArgs),
    /// Run a FIPA agent platform, or query one.
    Platform(PlatformArgs),
    /// List the devices that can take part in rendering.
    Devices(DevicesArgs),
    /// Trace rays for another process, as a board behind a cable.
    Board(BoardArgs),
    /// Print the path and the contents of the configuration file.
    Config(ConfigArgs),
    /// Write man pages, or print the reference of all commands.
    Manual(ManualArgs),
    /// Print completions for a shell.
    #[command(
        after_help = "For example: bottega completions bash > ~/.local/share/bash-completion/completions/bottega"
    )]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

#[derive(Debug, Args)]
#[command(group = ArgGroup::new("of_agents").args(["ludd", "network"]).multiple(true))]
pub(crate) struct AnalyzeArgs {
    /// The scene: glTF (.glb, .gltf), USD (.usd, .usda, .usdc, .usdz), Mitsuba 3 (.xml), pbrt-v4 (.pbrt), or a mesh (.obj, .ply).
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene_file: PathBuf,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    /// Folder for the pictures (the cost map, the visual importance, every channel, the zones of each level) and for
    /// index.json, which describes them.
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) output: PathBuf,
    /// Paint every zone of these levels several times, and report how well its time was predicted: by the map alone, and
    /// after profiling. Uses one processor, unless --threads is given.
    #[arg(long, value_name = "LEVELS", num_args = 0..=1, require_equals = true, default_missing_value = "1,2,3", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=3), help_heading = "Work")]
    pub(crate) verify: Vec<u8>,
    /// Number of times that --verify paints each zone. The shortest time counts, because disturbances only add time.
    #[arg(long, value_name = "N", default_value_t = 4, requires = "verify", value_parser = clap::value_parser!(u8).range(2..=100), help_heading = "Work")]
    pub(crate) repeat: u8,
    /// Samples per pixel of --verify.
    #[arg(long, value_name = "N", default_value_t = 64, requires = "verify", value_parser = clap::value_parser!(u32).range(2..=1 << 16), help_heading = "Work")]
    pub(crate) spp: u32,
    /// Measure the noise of a render: pictures of the error by pixel, and a table of what causes it, by the number of bounces and
    /// by what found the light. The picture is rendered this many times, at most 512 pixels wide and high.
    #[arg(long, value_name = "RENDERS", num_args = 0..=1, require_equals = true, default_missing_value = "16", value_parser = clap::value_parser!(u32).range(2..=1024), help_heading = "Noise")]
    pub(crate) noise: Option<u32>,
    /// Samples per pixel of --noise.
    #[arg(long, value_name = "N", default_value_t = 16, requires = "noise", value_parser = clap::value_parser!(u32).range(1..=1 << 16), help_heading = "Noise")]
    pub(crate) noise_spp: u32,
    /// Number of agents to cut zones for; default: one for every two processors.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Work")]
    pub(crate) agents: Option<u16>,
    /// Draw the local useful data density of photons and lighting agents (how much they differ from their neighbors) by these
    /// criteria: normal,power,direction,irradiance,importance.
    #[arg(long, value_name = "CRITERIA", value_delimiter = ',', value_parser = parse_criterion, help_heading = "Useful data density")]
    pub(crate) ludd: Vec<Criterion>,
    /// Radius of the neighborhood, as a share of the radius of what the camera sees, or of the scene's if that is not much
    /// larger.
    #[arg(long, value_name = "R", default_value_t = 0.05, requires = "ludd", value_parser = parse_share, help_heading = "Useful data density")]
    pub(crate) ludd_radius: f32,
    /// Compare this many of the nearest samples, instead of all within a radius.
    #[arg(long, value_name = "N", requires = "ludd", conflicts_with = "ludd_radius", value_parser = clap::value_parser!(u16).range(2..=512), help_heading = "Useful data density")]
    pub(crate) ludd_nearest: Option<u16>,
    /// Photons that leave the lights.
    #[arg(long, value_name = "N", default_value_t = 100_000, requires = "ludd", value_parser = clap::value_parser!(u32).range(1..=10_000_000), help_heading = "Useful data density")]
    pub(crate) photons: u32,
    /// Draw the lighting agents where the camera sees them, with the links of their network, colored by their answer: lit,
    /// shaded, or trace a shadow ray.
    #[arg(long, help_heading = "Lighting agents")]
    pub(crate) network: bool,
    /// Lighting agents that the lights cast; default: 50,000 for --ludd, 2,500 for --network, because the links of many
    /// cannot be seen.
    #[arg(long, value_name = "N", requires = "of_agents", value_parser = clap::value_parser!(u32).range(0..=10_000_000), help_heading = "Lighting agents")]
    pub(crate) lighting_agents: Option<u32>,
}

#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// The picture to judge: EXR, PNG or HDR.
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) picture: PathBuf,
    /// The reference picture. Only --seams works without it.
    #[arg(value_hint = ValueHint::FilePath, required_unless_present = "seams")]
    pub(crate) reference: Option<PathBuf>,
    /// Report whether the edges of zones can be seen: the zones of the index.json that `bottega analyze` writes.
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
    /// The scene: glTF (.glb, .gltf), USD (.usd, .usda, .usdc, .usdz), Mitsuba 3 (.xml), pbrt-v4 (.pbrt), or a mesh (.obj, .ply).
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene_file: PathBuf,
    #[command(flatten)]
    pub(crate) import: ImportArgs,
    /// Print a table of what is read of the scene, and what is replaced or left out, and how.
    #[arg(long)]
    pub(crate) support: bool,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct DevicesArgs {
    /// Measure the cost of work on each device, and the share of the work that it gets. `render` uses the measured costs.
    #[arg(long)]
    pub(crate) bench: bool,
    /// Measure the GPUs whose names contain this, including software GPUs; default: all hardware GPUs.
    #[arg(long, value_name = "NAME", requires = "bench")]
    pub(crate) gpu: Option<String>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}
