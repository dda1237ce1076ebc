//! Awards a second of a farm of many agents, and how long an agent waits for one.
//!
//! A real NATS server, a real Master and real Render Agents, by the same entry points as a job and a worker of a farm; only the
//! engine does nothing. Agents live in a few processes, each with a link, a platform and an engine of its own.

mod access;
mod figures;
mod idle_engine;
mod part;
mod watch;

use std::{env, fs, path::PathBuf, process, sync::Arc, time::Duration};

use bottega_cluster::{Credentials, FarmAddress, own_server::OwnServer};
use bottega_farm::{AuctionRule, JobReport, StopSwitch, ZoneState, lead};
use serde_json::Value;

pub use self::{
    access::ServerAccess,
    part::{AgentShare, PartCommand, PartOptions, run_part},
};
pub(crate) use self::{
    access::{AgentLink, ServerLinks},
    watch::unix_micros,
};
use self::{
    figures::{FarmRun, Figures},
    idle_engine::IdleEngine,
    part::PartReport,
    watch::MasterWatch,
};
use crate::{Error, Report, part_process::PartProcess, write_error};

/// The number of agents and the amount of work.
#[derive(Clone, Debug)]
pub struct FarmOptions {
    /// Agents, at least 1.
    pub agents: u32,
    /// About how many zones.
    pub zones: u32,
    /// Mean time of a zone over all agents; zones differ by half of it, agents in speed from 0.6 to 1.4.
    pub zone_time: Duration,
    /// How zones find their agents.
    pub auction: AuctionRule,
    /// Processes in which the agents live, beside the one with the Master.
    pub processes: u32,
    /// Which server.
    pub server: ServerChoice,
}

/// The server that carries the farm.
#[derive(Clone, Debug)]
pub enum ServerChoice {
    /// One that is started for this, by a program; `None`: `nats-server`, where systems put it.
    Started(Option<PathBuf>),
    /// That of a farm; nobody should use it meanwhile.
    Farm(Box<FarmAddress>, Credentials),
}

/// The figures of a farm.
#[derive(Clone, Debug)]
pub struct FarmBenchReport {
    run: FarmRun,
    figures: Figures,
}

/// Has a picture painted by all agents, which paint nothing and take their time for it.
///
/// - `command`: starts processes with some of the agents, which call [`run_part`].
/// - `stop`: ends the work before its time, which is an error.
///
/// # Errors
/// There is no server, not all agents can live, or the picture was not painted.
pub fn measure(options: &FarmOptions, command: PartCommand<'_>, stop: &StopSwitch) -> Result<FarmBenchReport, Error> {
    let folder = Folder::new()?;
    let (_server, access) = match &options.server {
        ServerChoice::Started(program) => {
            let server = OwnServer::start(program.as_deref(), &folder.0)?;
            let access = ServerAccess::Started(server.entry.clone());
            (Some(server), access)
        }
        ServerChoice::Farm(address, credentials) => (None, ServerAccess::Farm(address.clone(), credentials.clone())),
    };
    let run = run(options, &access, command, stop)?;
    let figures = Figures::of(&run);
    Ok(FarmBenchReport { run, figures })
}

impl Report for FarmBenchReport {
    fn as_text(&self) -> String {
        self.figures.as_text(&self.run)
    }

    fn as_json(&self) -> Value {
        self.figures.as_json(&self.run)
    }
}

fn run(
    options: &FarmOptions,
    access: &ServerAccess,
    command: PartCommand<'_>,
    stop: &StopSwitch,
) -> Result<FarmRun, Error> {
    let work = watch::unix_micros();
    let links = ServerLinks::new(access.clone())?;
    // The Master's process has an agent too, as everywhere.
    let AgentLink { link, uplink } = links.link(work, 0)?;
    let others = options.agents.saturating_sub(1);
    let processes = options.processes.min(others);
    let mut parts = Vec::new();
    for i in 0..processes {
        let (first, end) = (share_of(others, processes, i), share_of(others, processes, i + 1));
        let share = AgentShare { work, first: 1 + first, count: end - first };
        let FarmOptions { zones, zone_time, auction, .. } = *options;
        let part = PartOptions { share, zones, zone_time, auction, access: access.clone() };
        parts.push(PartProcess::start(command(&part))?);
    }
    parts.iter_mut().try_for_each(PartProcess::until_ready)?;
    let engine = Arc::new(IdleEngine::new(options.zone_time, 0).map_err(Error::Thread)?);
    let watch = Arc::new(MasterWatch::default());
    let settings = idle_engine::settings(options.zones, options.auction);
    let painted = lead(&settings, engine, Arc::clone(&watch) as _, stop, None, None, Some(link.clone()));
    let report = painted.map_err(bottega::Error::Job);
    let told =
        report.is_ok().then(|| parts.iter_mut().map(PartProcess::report::<PartReport>).collect::<Result<Vec<_>, _>>());
    link.forget();
    let (report, told) = (report?, told.transpose()?.unwrap_or_default());
    check(&report)?;
    let traffic = uplink.traffic();
    let own = traffic.messages_in + traffic.messages_out;
    let own_bytes = traffic.bytes_in + traffic.bytes_out;
    let [mut waits, mut answers] = watch.agent.take();
    waits.extend(told.iter().flat_map(|told| &told.waits));
    answers.extend(told.iter().flat_map(|told| &told.answers));
    Ok(FarmRun {
        server: uplink.server_version(),
        agents: options.agents,
        processes: processes + 1,
        zones: report.rows.len(),
        zone_seconds: options.zone_time.as_secs_f64(),
        seconds: report.times.total.as_secs_f64(),
        awards: watch.awards(),
        profiles: watch.profiles(),
        waits,
        answers,
        messages: own + told.iter().map(|told| told.messages).sum::<u64>(),
        bytes: own_bytes + told.iter().map(|told| told.bytes).sum::<u64>(),
    })
}

/// Where the share of the `i`-th of `count` begins.
fn share_of(all: u32, count: u32, i: u32) -> u32 {
    (u64::from(all) * u64::from(i) / u64::from(count.max(1))) as u32
}

/// Checks that every pixel was painted once: else the figures are of no picture.
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

/// A folder for the server, which goes with this.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new() -> Result<Self, Error> {
        let path = env::temp_dir().join(format!("bottega-bench-{}", process::id()));
        fs::create_dir_all(&path).map_err(|source| write_error(&path, source))?;
        Ok(Self(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if let Err(error) = fs::remove_dir_all(&self.0) {
            tracing::warn!(%error, "the folder {} was not removed", self.0.display());
        }
    }
}
