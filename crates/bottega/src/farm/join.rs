//! `bottega join`: this machine paints what the farm is asked for.

use std::{path::PathBuf, process::ExitCode};

use bottega_farm::StopSwitch;
use clap::{Args, ValueHint};

use super::{
    address::{FarmAddress, state_folder},
    cache::Cache,
    job_board::JobBoard,
    link::{FarmLink, LoginArgs, link},
    part::Member,
    refusals::Refusals,
    studio::Own,
    worker::{CACHE_BYTES, Worker},
};
use crate::{
    devices::{DeviceChoice, processors},
    error::CliError,
    render,
};

/// Offer this machine to a farm.
#[derive(Debug, Args)]
#[command(
    after_help = "For example, with the line that `bottega up` printed:\n  bottega join bottega://WORD@10.0.0.7:4222\n\nor, in the same local network, with the word alone. \
    The machine paints for the jobs of the farm by their priorities, and leads one where nobody does. Ctrl-C hands back \
    what it has in hand. `bottega machines` may suspend, resume and end it."
)]
pub(crate) struct JoinArgs {
    /// Where the farm is; default: the one that `bottega up` runs on this machine.
    #[arg(env = "BOTTEGA_FARM", hide_env_values = true)]
    farm: Option<FarmAddress>,
    /// Processors to use; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Who paints on this machine: `auto` (the processors, and the best GPU if there is one), or a list of `cpu` and parts of
    /// GPUs' names. Jobs that ask for `--exact` have processors alone.
    #[arg(long, value_name = "LIST", default_value = "auto")]
    devices: DeviceChoice,
    /// Where scenes are kept; default: a folder of the user's state.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    cache: Option<PathBuf>,
    /// How much of them, in gigabytes; what was used longest ago goes first. [default: 20]
    #[arg(long, value_name = "GB", value_parser = parse_gigabytes)]
    cache_size: Option<f64>,
    /// Paint until one job is over, and leave.
    #[arg(long)]
    once: bool,
    #[command(flatten)]
    login: LoginArgs,
}

pub(crate) fn run(args: &JoinArgs) -> Result<ExitCode, CliError> {
    let FarmLink { uplink, name, servers } = link(args.farm.as_ref(), &args.login)?;
    let stop = StopSwitch::new();
    render::stop_on_signal(&stop)?;
    let how = if uplink.is_guest() { "as a guest: " } else { "" };
    println!("joined {servers} (NATS {}) as {name}; {how}waiting for work", uplink.server_version());
    let member = Member {
        board: JobBoard { uplink },
        name,
        threads: args.threads.map_or_else(processors, usize::from),
        stop,
        refusals: Refusals::default(),
    };
    let folder = args.cache.clone().unwrap_or_else(|| state_folder().join("cache"));
    let cache = Cache::new(folder, args.cache_size.map_or(CACHE_BYTES, |gigabytes| (gigabytes * 1e9) as u64));
    let own = Own { threads: args.threads, devices: args.devices.clone() };
    let mut worker = Worker::new(member, cache, own, None, Box::new(|line| println!("{line}")));
    worker.work(args.once);
    worker.leave();
    println!("left the farm");
    Ok(ExitCode::SUCCESS)
}

pub(super) fn parse_gigabytes(text: &str) -> Result<f64, String> {
    let size = text.parse().ok().filter(|size: &f64| (0.0..=1e6).contains(size));
    size.ok_or_else(|| "a number of gigabytes is needed, such as 20".to_owned())
}
