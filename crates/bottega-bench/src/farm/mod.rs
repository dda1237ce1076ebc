//! Throughput and latency of awards in a farm of many agents.
//!
//! A real NATS server, a real Master and real Render Agents, through the same entry points as a job and a worker of a farm; only
//! the engine does nothing. The agents run in a few processes, each with a link, a platform and an engine of its own.

mod access;
mod figures;
mod idle_engine;
mod part;
mod watch;
mod work;

use std::{io::Write, path::PathBuf, process, sync::Arc};

use bottega_cluster::{Credentials, FarmAddress, own_server::OwnServer};
use bottega_farm::{JobReport, StopSwitch, ZoneState, lead};
use clap::Args;
use serde_json::Value;

pub(crate) use self::{
    access::{AgentLink, ServerAccess, ServerLinks},
    part::PartOptions,
    watch::unix_micros,
};
use self::{
    figures::{FarmRun, Figures},
    idle_engine::IdleEngine,
    part::{AgentShare, PartReport, part_command},
    watch::MasterWatch,
    work::FarmWork,
};
use crate::{
    error::Error,
    files::temporary_folder,
    part_process::PartProcess,
    report::{Measurement, Report},
};

/// Awards per second, and the time that an agent waits for one, in a farm of many agents on a real NATS server.
#[derive(Clone, Debug, Args)]
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
    For example:\n  bottega-bench farm\n  bottega-bench farm --agents 500 --zone-time 100ms    # the most that it can give"
)]
pub(crate) struct FarmOptions {
    /// Number of agents.
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..=1 << 13))]
    agents: u32,
    #[command(flatten)]
    work: FarmWork,
    /// Processes in which the agents live, beside the one with the Master.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=256))]
    processes: u32,
    /// The program of the NATS server to start; default: `nats-server`, where systems put it.
    #[arg(long, value_name = "PROGRAM", conflicts_with = "farm")]
    server: Option<PathBuf>,
    /// A farm that is there already; nobody should use it meanwhile.
    #[arg(long, value_name = "ADDRESS")]
    farm: Option<FarmAddress>,
    /// Credentials for its servers, where others run them: a `.creds` file.
    #[arg(long, value_name = "FILE", requires = "farm")]
    creds: Option<PathBuf>,
}

/// The results of a farm.
#[derive(Clone, Debug)]
struct FarmBenchReport {
    run: FarmRun,
    figures: Figures,
}

impl Measurement for FarmOptions {
    /// Runs a job with all agents, whose engines only wait. Ctrl-C stops it.
    fn measure(&self, _log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        let stop = StopSwitch::new();
        stop_on_signal(&stop)?;
        let folder = temporary_folder()?;
        let (_server, access) = match &self.farm {
            None => {
                let server = OwnServer::start(self.server.as_deref(), folder.path())?;
                let access = ServerAccess::Started(server.entry.clone());
                (Some(server), access)
            }
            Some(farm) => {
                let credentials = Credentials { creds: self.creds.clone(), ..Credentials::default() };
                (None, ServerAccess::Farm(Box::new(farm.clone()), credentials))
            }
        };
        let run = run(self, &access, &stop)?;
        let figures = Figures::of(&run);
        Ok(Box::new(FarmBenchReport { run, figures }))
    }
}

/// Stops the work on Ctrl-C or SIGTERM; a second signal ends the process at once.
fn stop_on_signal(stop: &StopSwitch) -> Result<(), Error> {
    let stop = stop.clone();
    let handler = move || {
        if stop.is_requested() {
            process::exit(Error::Stopped.exit_code().into());
        }
        stop.request();
    };
    Ok(ctrlc::set_handler(handler)?)
}

impl Report for FarmBenchReport {
    fn as_text(&self) -> String {
        self.figures.as_text(&self.run)
    }

    fn as_json(&self) -> Value {
        self.figures.as_json(&self.run)
    }
}

fn run(options: &FarmOptions, access: &ServerAccess, stop: &StopSwitch) -> Result<FarmRun, Error> {
    let work = watch::unix_micros();
    let links = ServerLinks::new(access.clone())?;
    // The Master's process has an agent, too, as in a farm.
    let AgentLink { link, uplink } = links.link(work, 0)?;
    let others = options.agents.saturating_sub(1);
    let processes = options.processes.min(others);
    let mut parts = Vec::new();
    for i in 0..processes {
        let (first, end) = (share_of(others, processes, i), share_of(others, processes, i + 1));
        let share = AgentShare { work, first: 1 + first, count: end - first };
        parts.push(PartProcess::start(part_command(share, &options.work, access)?)?);
    }
    parts.iter_mut().try_for_each(PartProcess::until_ready)?;
    let zone_time = options.work.zone_time;
    let engine = Arc::new(IdleEngine::new(zone_time, 0).map_err(Error::Thread)?);
    let watch = Arc::new(MasterWatch::default());
    let settings = options.work.settings();
    let painted = lead(&settings, engine, Arc::clone(&watch) as _, stop, None, None, Some(link.clone()));
    let report = painted.map_err(bottega::Error::Job);
    let is_whole = report.as_ref().is_ok_and(|report| !report.stopped);
    let reports =
        is_whole.then(|| parts.iter_mut().map(PartProcess::report::<PartReport>).collect::<Result<Vec<_>, _>>());
    link.forget();
    let report = report?;
    check(&report)?;
    let reports = reports.transpose()?.unwrap_or_default();
    let traffic = uplink.traffic();
    let own = traffic.messages_in + traffic.messages_out;
    let own_bytes = traffic.bytes_in + traffic.bytes_out;
    let [mut waits, mut answers] = watch.agent.take();
    waits.extend(reports.iter().flat_map(|report| &report.waits));
    answers.extend(reports.iter().flat_map(|report| &report.answers));
    Ok(FarmRun {
        server: uplink.server_version(),
        agents: options.agents,
        processes: processes + 1,
        zones: report.rows.len(),
        zone_seconds: zone_time.as_secs_f64(),
        seconds: report.times.total.as_secs_f64(),
        awards: watch.awards(),
        profiles: watch.profiles(),
        waits,
        answers,
        messages: own + reports.iter().map(|report| report.messages).sum::<u64>(),
        bytes: own_bytes + reports.iter().map(|report| report.bytes).sum::<u64>(),
    })
}

/// Returns the start of the `i`-th of `count` shares.
fn share_of(all: u32, count: u32, i: u32) -> u32 {
    (u64::from(all) * u64::from(i) / u64::from(count.max(1))) as u32
}

/// Checks that every pixel was painted exactly once; otherwise the results are invalid.
fn check(report: &JobReport) -> Result<(), Error> {
    if report.stopped {
        return Err(Error::Stopped);
    }
    let zones = report.rows.iter().filter(|row| row.state != ZoneState::Done).count();
    let pixels = report.film.rect().pixels().filter(|&(x, y)| report.film.weight(x, y) != 1.0).count();
    if zones > 0 || pixels > 0 {
        return Err(Error::Unpainted { zones, pixels });
    }
    Ok(())
}
