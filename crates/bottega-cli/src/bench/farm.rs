//! `bottega bench farm`: awards a second in a farm of many agents.

use std::{
    env, io,
    path::PathBuf,
    process::{Command, ExitCode},
    time::Duration,
};

use bottega::{
    StopSwitch,
    request::{AuctionChoice, WordChoice},
    settings::auction_rule,
};
use bottega_bench::farm::{AgentShare, FarmOptions, PartOptions, ServerAccess, ServerChoice, measure, run_part};
use bottega_cluster::{FarmAddress, own_server::Entry};
use clap::{Args, ValueHint};

use super::result::print;
use crate::{
    cli::choice, error::CliError, farm::LoginArgs, output::ResultWriter, signals::stop_on_signal,
    simulate::args::parse_time,
};

/// A farm of many agents.
#[derive(Debug, Args)]
#[command(
    after_help = "Each agent has a connection of its own, and everything that a machine of a farm has but an engine: instead of \
    painting, it waits. A zone is profiled by one agent and painted by another, both with pixels that travel, so nothing of \
    the protocol is left out.\n\n\
    An award is an order to paint a zone, which counts when it is written on the blackboard. Awards a second are those between \
    the first tenth of all and the last. An award takes from the agent's bid until it has the order in hand: the round of the \
    auction ends, the award is written, and sent. What an agent waits for an award is the time from when it says that it has painted a \
    zone until it has the next one in hand: its report goes to the Master, a round of the auction is held, the award is written \
    by compare-and-set, and sent. Meanwhile it has another zone to paint, and zones go to those who would have them \
    soonest: so one that has just begun its next zone is not in a hurry, and the longest waits are about as long as a zone. All agents together cannot ask for more than (agents / \
    seconds of a zone) awards a second: with more than the farm can give, the wait is that of a queue.\n\n\
    For example:\n  bottega bench farm\n  bottega bench farm --agents 500 --zone-time 100ms    # the most that it can give"
)]
pub(super) struct FarmBenchArgs {
    /// How many agents.
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..=1 << 13))]
    agents: u32,
    /// About how many zones.
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..=1 << 18))]
    zones: u32,
    /// Mean time of a zone over all agents; zones differ by half of it, agents in speed from 0.6 to 1.4.
    #[arg(long, value_name = "TIME", default_value = "450ms", value_parser = parse_time)]
    zone_time: Duration,
    /// How zones find their agents.
    #[arg(long, value_name = "RULE", value_parser = choice::<AuctionChoice>(), default_value = "finishing-time")]
    auction: AuctionChoice,
    /// Processes in which the agents live, beside the one with the Master.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=256))]
    processes: u32,
    /// The program of the NATS server to start; default: `nats-server`, where systems put it.
    #[arg(long, value_name = "PROGRAM", value_hint = ValueHint::ExecutablePath, conflicts_with = "farm")]
    server: Option<PathBuf>,
    /// A farm that is there already; nobody should use it meanwhile.
    #[arg(long, value_name = "ADDRESS")]
    farm: Option<FarmAddress>,
    #[command(flatten)]
    login: LoginArgs,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
    /// This process is to have so many of the agents: `WORK:FIRST:COUNT`.
    #[arg(long, hide = true)]
    share: Option<AgentShare>,
    /// The address of the server that the process with the Master has started.
    #[arg(long, hide = true, requires = "state")]
    at: Option<std::net::SocketAddr>,
    /// Its folder.
    #[arg(long, hide = true)]
    state: Option<PathBuf>,
}

/// The variable of the environment in which a process with agents finds the farm.
const FARM: &str = "BOTTEGA_FARM";

pub(super) fn run(args: &FarmBenchArgs) -> Result<ExitCode, CliError> {
    if let Some(share) = args.share {
        let auction = auction_rule(args.auction);
        let (zones, zone_time) = (args.zones, args.zone_time);
        let part = PartOptions { share, zones, zone_time, auction, access: args.access()? };
        run_part(&part, &mut ResultWriter)?;
        return Ok(ExitCode::SUCCESS);
    }
    let server = match &args.farm {
        Some(farm) => ServerChoice::Farm(Box::new(farm.clone()), args.login.credentials(Some(farm))),
        None => ServerChoice::Started(args.server.clone()),
    };
    let FarmBenchArgs { agents, zones, zone_time, processes, .. } = *args;
    let auction = auction_rule(args.auction);
    let options = FarmOptions { agents, zones, zone_time, auction, processes, server };
    let stop = StopSwitch::new();
    stop_on_signal(&stop)?;
    let command = |part: &PartOptions| part_command(part, args);
    Ok(print(&measure(&options, &command, &stop)?, args.json))
}

impl FarmBenchArgs {
    /// The way to the server, in a process with some of the agents.
    fn access(&self) -> Result<ServerAccess, CliError> {
        if let (Some(address), Some(folder)) = (self.at, &self.state) {
            return Ok(ServerAccess::Started(Entry { folder: folder.clone(), address }));
        }
        let told = || env::var(FARM).ok()?.parse().ok();
        let farm: Option<FarmAddress> = self.farm.clone().or_else(told);
        let farm =
            farm.ok_or_else(|| CliError::usage("no farm is named", "run `bottega bench farm` without --share"))?;
        let credentials = self.login.credentials(Some(&farm));
        Ok(ServerAccess::Farm(Box::new(farm), credentials))
    }
}

/// This program, with some of the agents.
fn part_command(part: &PartOptions, args: &FarmBenchArgs) -> io::Result<Command> {
    let mut command = Command::new(env::current_exe()?);
    command.args(["bench", "farm", "--share", &part.share.to_string()]);
    command.args(["--zones", &part.zones.to_string()]);
    command.args(["--zone-time", &format!("{}s", part.zone_time.as_secs_f64())]);
    command.args(["--auction", args.auction.word()]);
    match &part.access {
        ServerAccess::Started(Entry { folder, address }) => {
            command.arg("--at").arg(address.to_string()).arg("--state").arg(folder);
        }
        ServerAccess::Farm(farm, _) => {
            // It may hold a word that is for nobody else's eyes: all can see what a program is started with.
            command.env(FARM, farm.to_string());
            args.login.tell(&mut command);
        }
    }
    Ok(command)
}
