//! `bottega board`: traces rays for another process.

use std::{net::SocketAddr, process::ExitCode};

use bottega::devices::processors;
use bottega_board::{BoardOptions, BoardServer};
use clap::Args;

use crate::{error::CliError, option_value::InvalidValue};

/// Options of `bottega board`.
#[derive(Debug, Args)]
#[command(after_help = "For example:\n  bottega board --listen 10.0.0.7:7070\nand on another machine:\n  \
                        bottega render scene.glb -o picture.exr --devices cpu,tcp://10.0.0.7:7070")]
pub(crate) struct BoardArgs {
    /// Address to listen at. Every client of the same build is served: use it only in a network that you trust.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:7070")]
    listen: SocketAddr,
    /// Processors that trace rays; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Limit of the cable in each direction, in MB per second, to try how the allocator uses a slower cable.
    #[arg(long, value_name = "MB", value_parser = parse_bandwidth)]
    bandwidth: Option<f64>,
    /// Memory for the shapes of scenes, in MiB.
    #[arg(long, value_name = "MIB", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(1..))]
    memory: u32,
}

fn parse_bandwidth(text: &str) -> Result<f64, InvalidValue> {
    let allowed = || "a number of MB/s above 0 is needed, such as 12.5".into();
    text.parse::<f64>().ok().filter(|value| *value > 0.0 && value.is_finite()).ok_or_else(allowed)
}

pub(crate) fn run(args: &BoardArgs) -> Result<ExitCode, CliError> {
    let options = BoardOptions {
        threads: args.threads.map_or_else(processors, usize::from),
        bandwidth: args.bandwidth.map(|mb| mb * 1e6),
        memory: u64::from(args.memory) << 20,
        build: bottega::identity::identity().to_owned(),
    };
    let board = BoardServer::listen(args.listen, options).map_err(bottega::Error::from)?;
    let address = board.address().map_err(bottega::Error::from)?;
    println!("a board that follows rays: render with --devices cpu,tcp://{address}");
    board.serve().map_err(bottega::Error::from)?;
    Ok(ExitCode::SUCCESS)
}
