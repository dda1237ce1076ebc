//! Options of `bottega simulate`.

use std::{path::PathBuf, time::Duration};

use bottega::request::{AdaptationChoice, AuctionChoice};
use clap::{Args, ValueHint};

use crate::{cli::choice, option_value::InvalidValue};

/// One of a record and a synthetic work is needed.
#[derive(Debug, Args)]
#[command(after_help = "For example:\n  bottega render scene.glb -o picture.png --record run.json\n  \
    bottega simulate run.json --agents 4x1.0,4x0.25 -o gantt.svg\n  \
    bottega simulate run.json --agents 8,agent-3@fail=12s,agent-7@join=5s\n  \
    bottega simulate --synthetic 10000 --agents 1000 --fail 5%")]
pub(crate) struct SimulateArgs {
    /// The record of a run, written by `bottega render … --record FILE`.
    #[arg(value_hint = ValueHint::FilePath, required_unless_present = "synthetic", conflicts_with = "synthetic")]
    pub(crate) record: Option<PathBuf>,
    /// Number of synthetic zones, instead of a record; their costs have a log-normal distribution.
    #[arg(long, value_name = "ZONES", help_heading = "Work")]
    pub(crate) synthetic: Option<usize>,
    /// Mean cost of a synthetic zone on a processor of speed 1, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = parse_positive, help_heading = "Work")]
    pub(crate) zone_seconds: f64,
    /// Standard deviation of the logarithm of the costs of synthetic zones.
    #[arg(long, value_name = "SIGMA", default_value_t = 0.5, value_parser = parse_spread, help_heading = "Work")]
    pub(crate) zone_spread: f64,
    /// Cut each recorded zone into this many.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1 << 20), help_heading = "Work")]
    pub(crate) zones_scale: u32,

    /// The agents: `8`, `4x1.0,4x0.25` (number x speed), `2x1:8` (with eight processors each), `agent-3@join=5s`,
    /// `agent-3@leave=20s`, `agent-3@fail=12s`, `agent-3@slow=10s:4` (four times slower from then on), `agent-3@hang=8s`
    /// (sends heartbeats, but paints nothing), `agent-3@break=5s:0.5` (half of its orders fail), `agent-3@lie=5s:0.1` (a
    /// tenth of its paintings is wrong), `agent-3@boast=0s:2` (promises twice its speed), `agent-3@load=0s:60` (spends 60 s
    /// of its next zone on loading, and reports that as painting); or a file with such words. Default: as in the record.
    #[arg(long, value_name = "SPEC", num_args = 1.., help_heading = "Agents")]
    pub(crate) agents: Vec<String>,
    /// All agents share one machine with this many processors, as those of one process do. Default: each has its own.
    #[arg(long, value_name = "PROCESSORS", value_parser = clap::value_parser!(u32).range(1..=4096), help_heading = "Agents")]
    pub(crate) shared: Option<u32>,
    /// Share of the agents that fail, each at some time before the end, and do not come back.
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = parse_share, help_heading = "Agents")]
    pub(crate) fail: f64,
    /// Number of agents that paint each zone and are compared, until they have earned trust: as `bottega render --verify`.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(bottega_farm::VERIFY_MAX)), help_heading = "Agents")]
    pub(crate) verify: u32,
    /// Agents do not give the same bits, like engines that are not exact: their pixels are compared by their look.
    #[arg(long, requires = "verify", help_heading = "Agents")]
    pub(crate) inexact: bool,
    /// The rule that finds the winner of an auction.
    #[arg(long, value_name = "RULE", value_parser = choice::<AuctionChoice>(), default_value = "finishing-time", help_heading = "Agents")]
    pub(crate) auction: AuctionChoice,
    /// The rule by which agents learn their speed.
    #[arg(long, value_name = "RULE", value_parser = choice::<AdaptationChoice>(), default_value = "ratio", help_heading = "Agents")]
    pub(crate) adaptation: AdaptationChoice,
    /// The expert rules of all agents, as `bottega render --rules`. Default: those of the recorded work.
    #[arg(long, value_name = "FILE", value_hint = clap::ValueHint::FilePath, help_heading = "Agents")]
    pub(crate) rules: Option<PathBuf>,
    /// Zones that an agent works on at once; in most auctions one more may wait in its hand.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=1024), help_heading = "Agents")]
    pub(crate) prefetch: u32,
    /// Share out the work as `bottega render --as-in-paper`: the paper's auction and adaptation, one zone per agent at a
    /// time, none cut or taken over.
    #[arg(long, conflicts_with_all = ["auction", "adaptation", "prefetch"], help_heading = "Agents")]
    pub(crate) as_in_paper: bool,
    /// Largest relative error of an agent's first measure of its speed.
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = parse_share, help_heading = "Agents")]
    pub(crate) benchmark_error: f64,

    /// Least time that a message takes, such as 1ms.
    #[arg(long, value_name = "TIME", default_value = "0.1ms", value_parser = parse_time, help_heading = "Network")]
    pub(crate) latency: Duration,
    /// Mean of a random time added to the latency; a few messages take five times as long, and others overtake them.
    #[arg(long, value_name = "TIME", default_value = "0ms", value_parser = parse_time, help_heading = "Network")]
    pub(crate) jitter: Duration,
    /// Share of messages that are lost.
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = parse_share, help_heading = "Network")]
    pub(crate) loss: f64,
    /// Seed of all random numbers: the same seed gives the same run.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Network")]
    pub(crate) seed: u64,

    /// Draw which agent painted which zone when.
    #[arg(short, long, value_name = "FILE.svg", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub(crate) output: Option<PathBuf>,
    /// Write every message and every other event to this file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub(crate) trace: Option<PathBuf>,
    /// Replay the record as it was, agents and all, and say how far the time is from the one that was measured.
    #[arg(long, requires = "record", conflicts_with_all = ["agents", "shared", "fail", "zones_scale"], help_heading = "Output")]
    pub(crate) validate: bool,
    /// Print one JSON object instead of text for people.
    #[arg(long, help_heading = "Output")]
    pub(crate) json: bool,
}

fn parse_share(text: &str) -> Result<f64, InvalidValue> {
    let share = match text.strip_suffix('%') {
        Some(percent) => percent.parse::<f64>().map(|percent| percent / 100.0),
        None => text.parse(),
    };
    match share {
        Ok(share) if (0.0..1.0).contains(&share) => Ok(share),
        _ => Err("a share from 0 to below 1 is needed, such as 0.05 or 5%".into()),
    }
}

fn parse_time(text: &str) -> Result<Duration, InvalidValue> {
    let (number, unit) = match (text.strip_suffix("ms"), text.strip_suffix('s')) {
        (Some(number), _) => (number, 1e-3),
        (_, Some(number)) => (number, 1.0),
        _ => return Err("a time with its unit is needed, such as 5ms or 0.1s".into()),
    };
    match number.parse::<f64>().map(|number| number * unit) {
        Ok(seconds) if (0.0..=3600.0).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("a time from 0 to an hour is needed, such as 5ms or 0.1s".into()),
    }
}

fn parse_positive(text: &str) -> Result<f64, InvalidValue> {
    match text.parse::<f64>() {
        Ok(number) if (1e-6..=1e6).contains(&number) => Ok(number),
        _ => Err("a number from 0.000001 to 1000000 is needed".into()),
    }
}

fn parse_spread(text: &str) -> Result<f64, InvalidValue> {
    match text.parse::<f64>() {
        Ok(number) if (0.0..=4.0).contains(&number) => Ok(number),
        _ => Err("a number from 0 to 4 is needed".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_times_are_checked() {
        assert_eq!(parse_share("5%"), Ok(0.05));
        assert_eq!(parse_share("0.25"), Ok(0.25));
        assert_eq!(parse_time("0.5ms"), Ok(Duration::from_micros(500)));
        assert_eq!(parse_time("2s"), Ok(Duration::from_secs(2)));
        for absurd in ["", "%", "100%", "-1", "nan", "1.5"] {
            assert!(parse_share(absurd).is_err(), "{absurd}");
        }
        for absurd in ["", "5", "ms", "-1s", "1e9s", "nans"] {
            assert!(parse_time(absurd).is_err(), "{absurd}");
        }
    }
}
