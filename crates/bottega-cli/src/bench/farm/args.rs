//! What `bottega bench farm` takes.

use std::{path::PathBuf, time::Duration};

use clap::{Args, ValueHint};

use bottega_cluster::FarmAddress;

use crate::{farm::LoginArgs, simulate::args::parse_time};

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
pub(crate) struct FarmBenchArgs {
    /// How many agents.
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..=1 << 13))]
    pub(crate) agents: u32,
    /// About how many zones.
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..=1 << 18))]
    pub(crate) zones: u32,
    /// Mean time of a zone over all agents; zones differ by half of it, agents in speed from 0.6 to 1.4.
    #[arg(long, value_name = "TIME", default_value = "450ms", value_parser = parse_time)]
    pub(crate) zone_time: Duration,
    /// Processes in which the agents live, beside the one with the Master.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=256))]
    pub(crate) processes: u32,
    /// The program of the NATS server to start; default: `nats-server`, where systems put it.
    #[arg(long, value_name = "PROGRAM", value_hint = ValueHint::ExecutablePath, conflicts_with = "farm")]
    pub(crate) server: Option<PathBuf>,
    /// A farm that is there already; nobody should use it meanwhile.
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) farm: Option<FarmAddress>,
    #[command(flatten)]
    pub(crate) login: LoginArgs,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
    /// This process is to have so many of the agents: `WORK:FIRST:COUNT`.
    #[arg(long, hide = true, value_parser = parse_share)]
    pub(crate) share: Option<Share>,
    /// The address of the server that the process with the Master has started.
    #[arg(long, hide = true, requires = "state")]
    pub(crate) at: Option<std::net::SocketAddr>,
    /// Its folder.
    #[arg(long, hide = true)]
    pub(crate) state: Option<PathBuf>,
}

/// Agents of one process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Share {
    pub(crate) work: u64,
    pub(crate) first: u32,
    pub(crate) count: u32,
}

impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}:{}", self.work, self.first, self.count)
    }
}

fn parse_share(text: &str) -> Result<Share, String> {
    let read = || {
        let (work, rest) = text.split_once(':')?;
        let (first, count) = rest.split_once(':')?;
        Some(Share { work: work.parse().ok()?, first: first.parse().ok()?, count: count.parse().ok()? })
    };
    read().ok_or_else(|| "WORK:FIRST:COUNT is needed".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_read_as_it_is_written() {
        let share = Share { work: u64::MAX, first: 3, count: 9 };
        assert_eq!(parse_share(&share.to_string()), Ok(share));
        for wrong in ["", "1:2", "1:2:x", "1:2:3:4", "-1:2:3"] {
            assert!(parse_share(wrong).is_err(), "{wrong}");
        }
    }
}
