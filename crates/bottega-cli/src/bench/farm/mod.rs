//! `bottega bench farm`: what the protocol of a farm can do on this machine.
//!
//! A real NATS server, a real Master and real Render Agents, by the same entry points as `render --farm` and `join`; only the
//! engine does nothing. Agents live in a few processes, each with a link, a platform and an engine of its own.

mod args;
mod figures;
mod idle_engine;
mod part;
mod watch;
mod ways;

use std::{env, fs, path::PathBuf, process, process::ExitCode, sync::Arc};

use bottega_farm::{JobReport, StopSwitch, ZoneState, lead};

pub(crate) use self::args::FarmBenchArgs;
use self::{
    args::Share,
    figures::{Figures, Seen},
    idle_engine::IdleEngine,
    part::Part,
    watch::MasterWatch,
    ways::Ways,
};
use bottega_cluster::own_server::OwnServer;

use crate::{error::CliError, signals::stop_on_signal};

pub(crate) fn run(args: &FarmBenchArgs) -> Result<ExitCode, CliError> {
    if let Some(share) = args.share {
        return part::run(args, share).map(|()| ExitCode::SUCCESS);
    }
    let folder = Folder::new()?;
    let own = match &args.farm {
        Some(_) => None,
        None => Some(OwnServer::start(args.server.as_deref(), &folder.0)?),
    };
    let ways = match &own {
        Some(server) => Ways::own(server.entry.clone())?,
        None => Ways::of(args)?,
    };
    let seen = measure(args, &ways)?;
    let figures = Figures::of(&seen);
    if args.json {
        println!("{}", figures.as_json(&seen));
    } else {
        print!("{}", figures.as_text(&seen));
    }
    Ok(ExitCode::SUCCESS)
}

/// Has a picture painted by all agents.
fn measure(args: &FarmBenchArgs, ways: &Ways) -> Result<Seen, CliError> {
    let stop = StopSwitch::new();
    stop_on_signal(&stop)?;
    let work = watch::unix_micros();
    // The Master's process has an agent too, as everywhere.
    let link = ways.link(work, 0)?;
    let others = args.agents - 1;
    let processes = args.processes.min(others);
    let mut parts = Vec::new();
    for i in 0..processes {
        let (first, end) = (share_of(others, processes, i), share_of(others, processes, i + 1));
        parts.push(Part::start(args, ways, Share { work, first: 1 + first, count: end - first })?);
    }
    parts.iter_mut().try_for_each(Part::until_ready)?;
    let engine = Arc::new(IdleEngine::new(args.zone_time, 0).map_err(|error| {
        CliError::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once")
    })?);
    let watch = Arc::new(MasterWatch::default());
    let settings = idle_engine::settings(args.zones);
    let painted = lead(&settings, engine, Arc::clone(&watch) as _, &stop, None, None, Some(link.clone()));
    let report = painted.map_err(bottega::Error::Job);
    let told = report.is_ok().then(|| parts.iter_mut().map(Part::told).collect::<Result<Vec<_>, _>>());
    link.forget();
    let (report, told) = (report?, told.transpose()?.unwrap_or_default());
    check(&report)?;
    let traffic = link.uplink.traffic();
    let own = traffic.messages_in + traffic.messages_out;
    let own_bytes = traffic.bytes_in + traffic.bytes_out;
    let [mut waits, mut answers] = watch.agent.take();
    waits.extend(told.iter().flat_map(|told| &told.waits));
    answers.extend(told.iter().flat_map(|told| &told.answers));
    Ok(Seen {
        server: link.uplink.server_version(),
        agents: args.agents,
        processes: processes + 1,
        zones: report.rows.len(),
        zone_seconds: args.zone_time.as_secs_f64(),
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

/// A figure of a picture that is not there is none.
fn check(report: &JobReport) -> Result<(), CliError> {
    let wrong = |what: String| CliError::failed(what, "ask for fewer agents or zones, or report it");
    if report.stopped {
        return Err(wrong("stopped before the picture was there".to_owned()));
    }
    let undone = report.rows.iter().filter(|row| row.state != ZoneState::Done).count();
    let not_once = report.film.rect().pixels().filter(|&(x, y)| report.film.weight(x, y) != 1.0).count();
    if undone > 0 || not_once > 0 {
        return Err(wrong(format!("{undone} zones are not painted, {not_once} pixels not once")));
    }
    Ok(())
}

/// A folder for the server, which goes with this.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Result<Self, CliError> {
        let path = env::temp_dir().join(format!("bottega-bench-{}", process::id()));
        fs::create_dir_all(&path).map_err(|source| CliError::write(path.clone(), source))?;
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
