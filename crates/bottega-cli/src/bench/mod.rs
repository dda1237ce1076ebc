//! `bottega bench`: figures of this program on this machine.

mod ala;
mod engines;
mod farm;
mod guide;
mod hra;
mod learning;
mod magarro;
mod peers;
mod rays;
mod result;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use self::{
    ala::AlaArgs, engines::EnginesBenchArgs, farm::FarmBenchArgs, guide::GuideBenchArgs, hra::HraBenchArgs,
    learning::LearningArgs, magarro::MagarroArgs, peers::PeersArgs, rays::RaysArgs,
};
use crate::error::CliError;

#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    #[command(subcommand)]
    what: BenchCommand,
}

#[derive(Debug, Subcommand)]
enum BenchCommand {
    /// Rays per second by kind of ray, and paths per second.
    Rays(RaysArgs),
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
    /// How well the time of a zone is known before anybody has seen it: in a first job, and in a second of its kind.
    Learning(LearningArgs),
    /// What the guide of paths is worth: error × time of --guide ala over --guide none, learning included.
    Guide(GuideBenchArgs),
    /// The tables and figures of the paper on Autonomous Lighting Agents: photon mapping, its agents, and ours.
    Ala(AlaArgs),
}

pub(crate) fn run(args: &BenchArgs) -> Result<ExitCode, CliError> {
    match &args.what {
        BenchCommand::Rays(args) => rays::run(args),
        BenchCommand::Peers(args) => peers::run(args),
        BenchCommand::Engines(args) => engines::run(args),
        BenchCommand::Farm(args) => farm::run(args),
        BenchCommand::Hra(args) => hra::run(args),
        BenchCommand::Learning(args) => learning::run(args),
        BenchCommand::Guide(args) => guide::run(args),
        BenchCommand::Ala(args) => ala::run(args),
        BenchCommand::Magarro(args) => magarro::run(args),
    }
}
