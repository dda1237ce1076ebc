//! Some of the agents, in a process of their own.

use std::{
    fmt,
    io::{self, Write},
    process::Command,
    str::FromStr,
    sync::Arc,
    thread,
    time::Duration,
};

use bottega_farm::{AuctionRule, JobError, JobSettings, StopSwitch, assist};
use serde::{Deserialize, Serialize};

use super::{
    access::{AgentLink, ServerAccess, ServerLinks},
    idle_engine::{self, IdleEngine},
    watch::{AgentWatch, Wait},
};
use crate::{
    Error,
    part_process::{end_with_parent, say, say_ready},
};

/// The stack of a thread that waits.
const STACK_BYTES: usize = 256 << 10;

/// The orders of a process with some of the agents.
#[derive(Clone, Debug)]
pub struct PartOptions {
    /// Which agents.
    pub share: AgentShare,
    /// About how many zones the picture has.
    pub zones: u32,
    /// Mean time of a zone over all agents.
    pub zone_time: Duration,
    /// How zones find their agents.
    pub auction: AuctionRule,
    /// The way to the server.
    pub access: ServerAccess,
}

/// Makes the command of a process that calls [`run_part`] with these options.
pub type PartCommand<'a> = &'a dyn Fn(&PartOptions) -> io::Result<Command>;

/// Agents of one process. As text: `WORK:FIRST:COUNT`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AgentShare {
    /// The work that all agents paint.
    pub work: u64,
    /// The number of the first agent.
    pub first: u32,
    /// How many there are.
    pub count: u32,
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

/// What a process has seen.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct PartReport {
    pub(super) waits: Vec<Wait>,
    pub(super) answers: Vec<Wait>,
    pub(super) messages: u64,
    pub(super) bytes: u64,
}

/// Lives as these agents until the work is done, or standard input ends because the process with the Master is gone.
///
/// - `output`: that process reads it: a line when all agents are linked, and one with what they have seen.
///
/// # Errors
/// An agent cannot live or fails.
pub fn run_part(options: &PartOptions, output: &mut dyn Write) -> Result<(), Error> {
    let share = options.share;
    let links = ServerLinks::new(options.access.clone())?;
    let settings = idle_engine::settings(options.zones, options.auction);
    let links = (0..share.count).map(|i| links.link(share.work, share.first + i)).collect::<Result<Vec<_>, _>>()?;
    say_ready(output)?;
    let stops: Vec<StopSwitch> = links.iter().map(|_| StopSwitch::new()).collect();
    end_with_parent(stops.clone())?;
    let mut agents = Vec::new();
    for ((link, stop), agent) in links.into_iter().zip(stops).zip(share.first..) {
        let engine = IdleEngine::new(options.zone_time, agent).map_err(Error::Thread)?;
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

/// One agent, as a machine that has joined has it.
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
