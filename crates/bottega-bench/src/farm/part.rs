//! A process with some of the agents.

use std::{env, fmt, io::Write, net::SocketAddr, path::PathBuf, process::Command, str::FromStr, sync::Arc, thread};

use bottega_cluster::{Credentials, own_server::Entry};
use bottega_farm::{JobError, JobSettings, StopSwitch, assist};
use clap::Args;
use serde::{Deserialize, Serialize};

use super::{
    access::{AgentLink, ServerAccess, ServerLinks},
    idle_engine::IdleEngine,
    watch::{AgentWatch, Wait},
    work::FarmWork,
};
use crate::{
    error::Error,
    part_process::{end_with_parent, say, say_ready, this_program},
};

/// The stack size of a thread that only waits.
const STACK_BYTES: usize = 256 << 10;
/// The environment variable that passes the farm to a process with agents.
const FARM: &str = "BOTTEGA_FARM";

/// Some of the agents, as the process with the Master asks for them.
#[derive(Clone, Debug, Args)]
pub(crate) struct PartOptions {
    /// The agents of this process: `WORK:FIRST:COUNT`.
    #[arg(long)]
    share: AgentShare,
    #[command(flatten)]
    work: FarmWork,
    /// The address of the server that the process with the Master has started; default: the farm that BOTTEGA_FARM names.
    #[arg(long, requires = "state")]
    at: Option<SocketAddr>,
    /// The folder of the server's state.
    #[arg(long, requires = "at")]
    state: Option<PathBuf>,
    /// Credentials for the servers of the farm.
    #[arg(long)]
    creds: Option<PathBuf>,
}

/// Returns the command that starts this program with some of the agents.
pub(super) fn part_command(share: AgentShare, work: &FarmWork, access: &ServerAccess) -> Result<Command, Error> {
    let mut command = this_program()?;
    command.arg("farm-part").arg("--share").arg(share.to_string()).args(work.words());
    match access {
        ServerAccess::Started(Entry { folder, address }) => {
            command.arg("--at").arg(address.to_string()).arg("--state").arg(folder);
        }
        ServerAccess::Farm(farm, credentials) => {
            // Not in the arguments, which all users can see: the address may contain a secret.
            command.env(FARM, farm.to_string());
            if let Some(creds) = &credentials.creds {
                command.arg("--creds").arg(creds);
            }
        }
    }
    Ok(command)
}

/// The agents of one process. As text: `WORK:FIRST:COUNT`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct AgentShare {
    /// The id of the work that all agents paint.
    pub(super) work: u64,
    /// The number of the first agent.
    pub(super) first: u32,
    /// The number of agents.
    pub(super) count: u32,
}

impl fmt::Display for AgentShare {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.work, self.first, self.count)
    }
}

impl FromStr for AgentShare {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (work, rest) = text.split_once(':')?;
            let (first, count) = rest.split_once(':')?;
            Some(Self { work: work.parse().ok()?, first: first.parse().ok()?, count: count.parse().ok()? })
        };
        read().ok_or_else(|| "WORK:FIRST:COUNT is needed".to_owned())
    }
}

/// The observations of a process.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct PartReport {
    pub(super) waits: Vec<Wait>,
    pub(super) answers: Vec<Wait>,
    pub(super) messages: u64,
    pub(super) bytes: u64,
}

impl PartOptions {
    /// Returns the address of the server.
    fn access(&self) -> Result<ServerAccess, Error> {
        if let (Some(address), Some(folder)) = (self.at, &self.state) {
            return Ok(ServerAccess::Started(Entry { folder: folder.clone(), address }));
        }
        let farm = env::var(FARM).ok().and_then(|farm| farm.parse().ok()).ok_or(Error::NoFarm)?;
        Ok(ServerAccess::Farm(Box::new(farm), Credentials { creds: self.creds.clone(), ..Credentials::default() }))
    }

    /// Runs these agents until the work is done, or until standard input ends because the process with the Master is gone.
    ///
    /// - `output`: read by that process: a line when all agents are connected, and one with the observations.
    ///
    /// # Errors
    /// An agent cannot be started, or fails.
    pub(crate) fn run(&self, output: &mut dyn Write) -> Result<(), Error> {
        let share = self.share;
        let links = ServerLinks::new(self.access()?)?;
        let settings = self.work.settings();
        let links = (0..share.count).map(|i| links.link(share.work, share.first + i)).collect::<Result<Vec<_>, _>>()?;
        say_ready(output)?;
        let stops: Vec<StopSwitch> = links.iter().map(|_| StopSwitch::new()).collect();
        end_with_parent(stops.clone())?;
        let mut agents = Vec::new();
        for ((link, stop), agent) in links.into_iter().zip(stops).zip(share.first..) {
            let engine = IdleEngine::new(self.work.zone_time, agent).map_err(Error::Thread)?;
            let settings = settings.clone();
            let live = move || live(&settings, engine, &stop, &link);
            agents.push(thread::Builder::new().stack_size(STACK_BYTES).spawn(live).map_err(Error::Thread)?);
        }
        let mut report = PartReport::default();
        for agent in agents {
            let seen = agent.join().map_err(|_| Error::Panic { thread: "an agent" })?;
            let PartReport { waits, answers, messages, bytes } = seen.map_err(bottega::Error::Job)?;
            report.waits.extend(waits);
            report.answers.extend(answers);
            report.messages += messages;
            report.bytes += bytes;
        }
        say(output, &serde_json::to_string(&report).unwrap_or_default())
    }
}

/// Runs one agent like a machine that has joined a farm.
fn live(
    settings: &JobSettings,
    engine: IdleEngine,
    stop: &StopSwitch,
    link: &AgentLink,
) -> Result<PartReport, JobError> {
    let watch = Arc::new(AgentWatch::default());
    assist(settings, Arc::new(engine), Arc::clone(&watch) as _, stop, link.link.clone())?;
    let traffic = link.uplink.traffic();
    let [waits, answers] = watch.take();
    Ok(PartReport {
        waits,
        answers,
        messages: traffic.messages_in + traffic.messages_out,
        bytes: traffic.bytes_in + traffic.bytes_out,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_read_as_it_is_written() {
        let share = AgentShare { work: u64::MAX, first: 3, count: 9 };
        assert_eq!(share.to_string().parse(), Ok(share));
        for wrong in ["", "1:2", "1:2:x", "1:2:3:4", "-1:2:3"] {
            assert!(wrong.parse::<AgentShare>().is_err(), "{wrong}");
        }
    }
}
