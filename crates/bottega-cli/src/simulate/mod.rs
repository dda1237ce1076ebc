//! `bottega simulate`: replays work with other agents in virtual time.

pub(crate) mod args;
mod gantt;

use std::{
    fs,
    io::Read,
    path::Path,
    process::ExitCode,
    sync::Arc,
    time::{Duration, Instant},
};

use bottega::{
    events::AuctionEvent,
    request::RulesSource,
    rule_texts::rule_texts,
    rules::experts,
    settings::{adaptation_rule, auction_rule},
    text::duration,
};
use bottega_agents::driver::Faults;
use bottega_farm::simulate::{FarmSpec, Plan, Record, SimulationOutcome, SyntheticSpread, Workpiece, simulate};
use bottega_farm::{AuctionTally, Expert};
use serde_json::{Value, json};

use self::args::SimulateArgs;
use crate::error::CliError;

/// The maximum size of a record or a list of agents, in bytes.
const FILE_BYTES_MAX: u64 = 1 << 30;
/// The maximum number of agents that are listed individually.
const LISTED_MAX: usize = 16;
/// The maximum relative difference between a replay and the measurement.
const VALID_WITHIN: f64 = 0.05;

pub(crate) fn run(args: &SimulateArgs) -> Result<ExitCode, CliError> {
    let record = args.record.as_deref().map(read_record).transpose()?;
    let piece = Arc::new(workpiece(args, record.as_ref())?);
    let mut farm = farm_spec(args, record.as_ref())?;
    if args.fail > 0.0 {
        let until = farm.least_time(Duration::ZERO, piece.zone_seconds().sum()).unwrap_or_default();
        farm.fail_some(args.fail, until, args.seed);
    }
    let plan = Plan {
        experts: args.rules.as_deref().map(experts_of).transpose()?.unwrap_or_default(),
        faults: Faults { latency_min: args.latency, latency_extra_mean: args.jitter, ..faults(args) },
        benchmark_error: args.benchmark_error,
        auction: auction_rule(args.auction),
        adaptation: adaptation_rule(args.adaptation),
        prefetch: args.prefetch,
        verify: args.verify,
        inexact: args.inexact,
        trace: args.trace.is_some(),
        ..Plan::calm(farm, args.seed)
    };
    let plan = if args.as_in_paper { plan.as_in_paper() } else { plan };
    let begun = Instant::now();
    let outcome = simulate(&piece, &plan).map_err(CliError::Simulation)?;
    let took = begun.elapsed();
    let write =
        |path: &Path, text: &str| fs::write(path, text).map_err(|source| CliError::write(path.to_owned(), source));
    if let Some(path) = &args.output {
        write(path, &gantt::svg(&outcome))?;
    }
    if let Some(path) = &args.trace {
        write(path, &outcome.trace)?;
    }
    let measured = record.as_ref().filter(|_| args.validate).map(|record| record.total);
    if args.json {
        println!("{}", as_json(&outcome, took, measured));
    } else {
        print!("{}", as_text(&outcome, took, measured));
    }
    let valid = measured.is_none_or(|measured| difference(&outcome, measured).abs() <= VALID_WITHIN);
    Ok(ExitCode::from(u8::from(!valid)))
}

/// Reads the agents' knowledge. Warnings about rules are left to `bottega rules check`.
fn experts_of(rules: &Path) -> Result<Vec<Expert>, CliError> {
    let (experts, _) = experts(rule_texts(&[RulesSource::File(rules.to_owned())])?)?;
    Ok(experts)
}

fn faults(args: &SimulateArgs) -> Faults {
    // Losses last to the end: the farm must complete the work.
    let until = bottega_agents::Time::since_start(Duration::from_secs(1 << 32));
    Faults { loss: args.loss, until, ..Faults::NONE }
}

fn read_text(path: &Path) -> Result<String, CliError> {
    let failed = |source| CliError::read(path.to_owned(), source);
    let mut text = String::new();
    let file = fs::File::open(path).map_err(failed)?;
    file.take(FILE_BYTES_MAX).read_to_string(&mut text).map_err(failed)?;
    Ok(text)
}

pub(crate) fn read_record(path: &Path) -> Result<Record, CliError> {
    let text = read_text(path)?;
    Record::from_json(&text).map_err(|source| bottega::Error::Record { path: path.to_owned(), source }.into())
}

fn workpiece(args: &SimulateArgs, record: Option<&Record>) -> Result<Workpiece, CliError> {
    let piece = match (record, args.synthetic) {
        (Some(record), _) => Workpiece::recorded(record, args.zones_scale),
        (None, zones) => {
            let spread = SyntheticSpread {
                zones: args.zone_spread,
                mean_seconds: args.zone_seconds,
                ..SyntheticSpread::default()
            };
            Workpiece::synthetic(zones.unwrap_or_default(), &spread, args.seed)
        }
    };
    piece.map_err(|error| CliError::usage(error.to_string(), "give other numbers to --synthetic or --zones-scale"))
}

/// Returns the agents: as given in the options; else those of the record; else one.
fn farm_spec(args: &SimulateArgs, record: Option<&Record>) -> Result<FarmSpec, CliError> {
    if args.agents.is_empty() {
        let farm = record.map(|record| FarmSpec::sharing(record.agents, record.processors as u32));
        return Ok(farm.unwrap_or_else(|| FarmSpec::equal(1)));
    }
    let mut words = Vec::new();
    for spec in &args.agents {
        let path = Path::new(spec);
        words.push(if path.is_file() { read_text(path)? } else { spec.clone() });
    }
    let mut farm: FarmSpec = words.join("\n").parse().map_err(|error: bottega_farm::simulate::FarmSpecError| {
        CliError::usage(error.to_string(), "see `bottega simulate --help` for what --agents takes")
    })?;
    if let Some(processors) = args.shared {
        let shared = FarmSpec::sharing(farm.agents.len(), processors);
        farm.machines = shared.machines;
        farm.agents.iter_mut().for_each(|agent| agent.machine = 0);
    }
    Ok(farm)
}

/// Returns the relative difference between the simulated and a measured time.
fn difference(outcome: &SimulationOutcome, measured: Duration) -> f64 {
    outcome.makespan.as_secs_f64() / measured.as_secs_f64().max(1e-12) - 1.0
}

fn as_text(outcome: &SimulationOutcome, took: Duration, measured: Option<Duration>) -> String {
    let SimulationOutcome { makespan, least, longest_zone, work, zones, messages, .. } = outcome;
    let agents = &outcome.agents;
    let mut text = format!(
        "{} zones, {} of processor time; {} agents\n\
         makespan        {:.3} s\n\
         lower bounds    {} s by all speed together, {:.3} s by the most expensive zone in one piece\n\
         efficiency      {:.1} %\n\
         messages        {messages}, {:.1} a zone\n",
        zones,
        duration(*work),
        agents.len(),
        makespan.as_secs_f64(),
        least.map_or("no".to_owned(), |least| format!("{:.3}", least.as_secs_f64())),
        longest_zone.as_secs_f64(),
        100.0 * outcome.efficiency(),
        outcome.messages_per_zone(),
    );
    if !outcome.rounds.is_empty() {
        let tally = AuctionTally::of(&outcome.rounds);
        text += &format!(
            "auction         {} rounds, {} with several bidders ({:.0} % of the first half), {} zones outbid, {} rounds decided by \
             credit; {:.1} bidders and {:.1} bids a round\n",
            tally.rounds,
            tally.contested,
            100.0 * AuctionTally::contested_of_first_half(&outcome.rounds),
            tally.outbid,
            tally.credit_decided,
            tally.bidders as f64 / tally.rounds as f64,
            tally.bids as f64 / tally.rounds as f64,
        );
    }
    if !outcome.thefts.is_empty() {
        let stolen: u32 = outcome.thefts.iter().map(|theft| theft.zones).sum();
        text += &format!("stealing        {stolen} zones changed hands in {} thefts\n", outcome.thefts.len());
    }
    if outcome.failed > 0 {
        text += &format!("given up        {} zones\n", outcome.failed);
    }
    if outcome.wrong > 0 {
        text += &format!("painted wrong   {} zones of the picture\n", outcome.wrong);
    }
    if outcome.lacked_machines {
        text += "zones waited for more agents, to compare what these paint\n";
    }
    for agent in agents {
        if let Some(reason) = &agent.left_out {
            text += &format!("left out        {}: {reason}\n", agent.name);
        }
    }
    if agents.len() <= LISTED_MAX {
        for (agent, share) in agents.iter().zip(busy_shares(outcome)) {
            let bar = "█".repeat((share * 40.0).round() as usize);
            text += &format!(
                "{:<12} speed {:<5} V_cp {:<6.3} credit {:>8.2} s, held {:>4.2}; {:>5.1} % busy, {:>3} orders  {bar}\n",
                agent.name,
                agent.speed,
                agent.power.get(),
                agent.credit.sum,
                agent.credit.reliability(),
                100.0 * share,
                agent.orders
            );
        }
    } else {
        let mut shares = busy_shares(outcome);
        shares.sort_by(f64::total_cmp);
        let at = |quantile: f64| 100.0 * shares[((shares.len() - 1) as f64 * quantile) as usize];
        text += &format!(
            "busy            {:.1} % at least, {:.1} % a tenth, {:.1} % the median, {:.1} % at most\n",
            at(0.0),
            at(0.1),
            at(0.5),
            at(1.0)
        );
    }
    if let Some(measured) = measured {
        text += &format!(
            "measured        {:.3} s, the replay {:+.1} %; zones took {:.1} % of the processors' time measured\n",
            measured.as_secs_f64(),
            100.0 * difference(outcome, measured),
            100.0 * outcome.work.as_secs_f64()
                / (measured.as_secs_f64() * agents.iter().map(|agent| agent.lanes).sum::<f64>())
        );
    }
    text + &format!("simulated in    {:.2} s; all invariants hold after the run\n", took.as_secs_f64())
}

/// Returns the utilization of each agent: busy time over the time of its processors.
fn busy_shares(outcome: &SimulationOutcome) -> Vec<f64> {
    let makespan = outcome.makespan.as_secs_f64().max(1e-12);
    outcome
        .agents
        .iter()
        .map(|agent| (agent.busy.as_secs_f64() / (makespan * agent.lanes.max(1e-12))).min(1.0))
        .collect()
}

fn as_json(outcome: &SimulationOutcome, took: Duration, measured: Option<Duration>) -> Value {
    let agents: Vec<Value> = outcome
        .agents
        .iter()
        .zip(busy_shares(outcome))
        .map(|(agent, share)| {
            json!({
                "name": agent.name, "speed": agent.speed, "processors": agent.lanes, "orders": agent.orders,
                "busy_seconds": agent.busy.as_secs_f64(), "busy_share": share, "left_out": agent.left_out,
                "power": agent.power.get(), "credit": agent.credit.sum, "reliability": agent.credit.reliability(),
            })
        })
        .collect();
    let has_auction = !outcome.rounds.is_empty() || !outcome.thefts.is_empty();
    json!({
        "zones": outcome.zones,
        "zones_failed": outcome.failed,
        "zones_wrong": outcome.wrong,
        "lacked_machines": outcome.lacked_machines,
        "work_seconds": outcome.work.as_secs_f64(),
        "makespan_seconds": outcome.makespan.as_secs_f64(),
        "least_seconds": outcome.least.map(|least| least.as_secs_f64()),
        "longest_zone_seconds": outcome.longest_zone.as_secs_f64(),
        "efficiency": outcome.efficiency(),
        "messages": outcome.messages,
        "messages_per_zone": outcome.messages_per_zone(),
        "auction": has_auction.then(|| AuctionEvent::of(&outcome.rounds, &outcome.thefts)),
        "measured_seconds": measured.map(|measured| measured.as_secs_f64()),
        "difference": measured.map(|measured| difference(outcome, measured)),
        "simulated_in_seconds": took.as_secs_f64(),
        "agents": agents,
    })
}
