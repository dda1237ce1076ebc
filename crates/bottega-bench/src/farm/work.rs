//! The work of the agents, as passed to all processes.

use std::time::Duration;

use bottega::{
    request::{AuctionChoice, WordChoice},
    settings::auction_rule,
};
use bottega_farm::JobSettings;
use clap::Args;

use super::idle_engine;
use crate::arguments::{choice, parse_time};

/// The zones of the picture, and how agents get them.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct FarmWork {
    /// About how many zones.
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..=1 << 18))]
    zones: u32,
    /// Mean time of a zone over all agents; zones differ by half of it, agents in speed from 0.6 to 1.4.
    #[arg(long, value_name = "TIME", default_value = "450ms", value_parser = parse_time)]
    pub(super) zone_time: Duration,
    /// The rule that gives zones to agents.
    #[arg(long, value_name = "RULE", value_parser = choice::<AuctionChoice>(), default_value = "finishing-time")]
    auction: AuctionChoice,
}

impl FarmWork {
    /// Returns the settings of the job.
    pub(super) fn settings(&self) -> JobSettings {
        idle_engine::settings(self.zones, auction_rule(self.auction))
    }

    /// Returns the arguments that pass the work to another process of this program.
    pub(super) fn words(&self) -> [String; 3] {
        [
            format!("--zones={}", self.zones),
            format!("--zone-time={}s", self.zone_time.as_secs_f64()),
            format!("--auction={}", self.auction.word()),
        ]
    }
}
