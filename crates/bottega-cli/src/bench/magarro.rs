//! `bottega bench magarro`: the tables of the MAGarRO paper.

use std::{
    env, io,
    net::SocketAddr,
    path::PathBuf,
    process::{Command, ExitCode},
};

use bottega_bench::magarro::{MagarroOptions, SCENE, SharedRow, measure, measure_equal_time, run_second_agent};
use bottega_cluster::own_server::Entry;
use clap::{Args, ValueHint};

use super::result::{no_scene, print};
use crate::{
    error::CliError,
    output::{LogWriter, ResultWriter},
};

/// The tables of the MAGarRO paper.
#[derive(Debug, Args)]
#[command(
    after_help = "An agent is a process with one thread. Times of one and of two agents are measured, over a NATS server that is \
    started for it; times of four and eight are replayed in the simulator from what the zones took, and so are those of two, which \
    tells how good the replay is. --equal-time measures something else: error for time, against a converged reference, of \
    `--optimize n`, `b` and `vb` beside uniform samples.\n\n\
    For example:\n  bottega bench magarro --scenes ../scenes -o magarro/\n  bottega bench magarro room.xml --scale 0.25 --equal-time"
)]
pub(super) struct MagarroArgs {
    /// The scene. Default: magarro/magarro.pbrt in the folder of scenes.
    #[arg(value_hint = ValueHint::FilePath)]
    scene: Option<PathBuf>,
    /// The folder of scenes. Default: what the environment variable BOTTEGA_SCENES names.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath, env = "BOTTEGA_SCENES")]
    scenes: Option<PathBuf>,
    /// Sides of the picture, as a share of what the scene file asks for.
    #[arg(long, value_name = "S", default_value_t = 0.5, value_parser = parse_scale)]
    scale: f64,
    /// Samples a pixel: the paper's eight levels of oversampling, along both axes.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    spp: u32,
    /// Light samples at each bounce. The paper has 1024 for a pixel: 16 for each of 64 samples.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1024))]
    light_samples: u32,
    /// Bounces: the paper's eight levels of recursion.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(0..=1024))]
    max_depth: u32,
    /// Zones that the partition aims at, for all numbers of agents.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    zones: u32,
    /// Folder for magarro.json, magarro.svg, and the pictures.
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    output: Option<PathBuf>,
    /// Error for time instead of the tables, against a reference of so many samples a pixel.
    #[arg(long, value_name = "SPP", num_args = 0..=1, default_missing_value = "8192",
        value_parser = clap::value_parser!(u32).range(1..=1 << 20), conflicts_with_all = ["output", "replay"])]
    equal_time: Option<u32>,
    /// Replay two agents, too, instead of painting with two processes.
    #[arg(long)]
    replay: bool,
    /// The program of the NATS server to start; default: `nats-server`, where systems put it.
    #[arg(long, value_name = "PROGRAM", value_hint = ValueHint::ExecutablePath)]
    server: Option<PathBuf>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
    /// This process is the second agent of a row: `LEVEL:OPTIMIZATION:WAYS:WORK`.
    #[arg(long, hide = true, requires_all = ["at", "state"])]
    row: Option<SharedRow>,
    /// The address of the server that the first process has started.
    #[arg(long, hide = true)]
    at: Option<SocketAddr>,
    /// Its folder.
    #[arg(long, hide = true)]
    state: Option<PathBuf>,
}

pub(super) fn run(args: &MagarroArgs) -> Result<ExitCode, CliError> {
    let in_folder = || args.scenes.as_ref().map(|folder| folder.join(SCENE));
    let options = MagarroOptions {
        scene: args.scene.clone().or_else(in_folder).ok_or_else(no_scene)?,
        scale: args.scale,
        spp: args.spp,
        light_samples: args.light_samples,
        max_depth: args.max_depth,
        zones: args.zones,
        output: args.output.clone(),
        server: args.server.clone(),
    };
    if let (Some(row), Some(address), Some(folder)) = (&args.row, args.at, &args.state) {
        run_second_agent(&options, row, &Entry { folder: folder.clone(), address }, &mut ResultWriter)?;
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(samples) = args.equal_time {
        return Ok(print(&measure_equal_time(&options, samples, &mut LogWriter)?, args.json));
    }
    let second = |row: &SharedRow, server: &Entry| second_agent(&options, row, server);
    let report = measure(&options, (!args.replay).then_some(&second as _), &mut LogWriter)?;
    Ok(print(&report, args.json))
}

/// This program as the second agent.
fn second_agent(options: &MagarroOptions, row: &SharedRow, server: &Entry) -> io::Result<Command> {
    let MagarroOptions { scene, scale, spp, light_samples, max_depth, zones, .. } = options;
    let mut command = Command::new(env::current_exe()?);
    command.args(["bench", "magarro"]).arg(scene).args(["--row", &row.to_string()]);
    command.arg("--at").arg(server.address.to_string()).arg("--state").arg(&server.folder);
    command.args(["--scale", &scale.to_string(), "--spp", &spp.to_string(), "--zones", &zones.to_string()]);
    command.args(["--light-samples", &light_samples.to_string(), "--max-depth", &max_depth.to_string()]);
    Ok(command)
}

fn parse_scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(scale) if (0.02..=8.0).contains(&scale) => Ok(scale),
        _ => Err("a number from 0.02 to 8 is needed".to_owned()),
    }
}
