//! The second agent of a measured pair: a process of its own, which paints on one processor over a NATS server.

use std::{
    collections::BTreeMap,
    fmt, io,
    io::Write,
    path::Path,
    process::Command,
    str::FromStr,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use bottega_agents::AgentId;
use bottega_cluster::own_server::{Entry, OwnServer};
use bottega_farm::{AgentRow, Level, Link, Observer, Optimization, StopSwitch, assist, lead};
use serde::{Deserialize, Serialize};

use super::{
    report::Ways,
    scene::{MagarroOptions, MagarroScene},
};
use crate::{
    Error,
    farm::{Folder, ServerAccess, ServerLinks, unix_micros},
    part_process::{PartProcess, end_with_parent, say, say_ready},
};

/// A way to paint, which both processes must agree on. As text: `LEVEL:OPTIMIZATION:WAYS:WORK`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SharedRow {
    pub(super) level: Level,
    pub(super) optimization: Optimization,
    pub(super) ways: Ways,
    /// The work that both paint.
    pub(super) work: u64,
}

impl fmt::Display for SharedRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}:{}", self.level as u8, self.optimization, self.ways.name(), self.work)
    }
}

impl FromStr for SharedRow {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let [level, optimization, ways, work] = text.split(':').collect::<Vec<_>>().try_into().ok()?;
            Some(Self {
                level: level.parse().ok()?,
                optimization: optimization.parse().ok()?,
                ways: Ways::named(ways)?,
                work: work.parse().ok()?,
            })
        };
        read().ok_or_else(|| "LEVEL:OPTIMIZATION:WAYS:WORK is needed".to_owned())
    }
}

/// Makes the command of a process that calls [`run_second_agent`] with these options.
pub type SecondAgentCommand<'a> = &'a dyn Fn(&SharedRow, &Entry) -> io::Result<Command>;

/// The words of the second process when its work is done.
#[derive(Debug, Serialize, Deserialize)]
struct SecondAgentReport {
    /// Whether the work had come to its end.
    ended: bool,
}

/// A pair of agents, measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasuredPair {
    /// The time of both together.
    pub(super) seconds: f64,
    /// How long after the beginning the second one was known to the Master.
    pub(super) joins: Duration,
}

/// Two agents on one server, which lives as long as this.
pub(super) struct AgentPair<'a> {
    server: OwnServer,
    _folder: Folder,
    command: SecondAgentCommand<'a>,
}

impl<'a> AgentPair<'a> {
    /// Starts the server.
    ///
    /// - `program`: that of the server; `None`: `nats-server`, where systems put it.
    pub(super) fn start(program: Option<&Path>, command: SecondAgentCommand<'a>) -> Result<Self, Error> {
        let folder = Folder::new()?;
        Ok(Self { server: OwnServer::start(program, &folder.0)?, _folder: folder, command })
    }

    /// Paints with both agents together, from when both have loaded the scene. `None`: one had painted all before the other was there.
    pub(super) fn measure(
        &self,
        scene: &MagarroScene<'_>,
        level: Level,
        optimization: Optimization,
        ways: Ways,
    ) -> Result<Option<MeasuredPair>, Error> {
        let row = SharedRow { level, optimization, ways, work: unix_micros() };
        let entry = self.server.entry.clone();
        let link = link(&entry, row.work, 0)?;
        let settings = scene.settings(level, optimization, ways);
        let engine = scene.engine(&settings, 0)?;
        let mut second = PartProcess::start((self.command)(&row, &entry))?;
        second.until_ready()?;
        let arrivals = Arc::new(Arrivals { begun: Instant::now(), agents: Mutex::default() });
        let observer = Arc::clone(&arrivals) as _;
        let painted = lead(&settings, engine, observer, &StopSwitch::new(), None, None, Some(link.clone()));
        let report = painted.map_err(bottega::Error::Job);
        let told = report.is_ok().then(|| second.report::<SecondAgentReport>());
        link.forget();
        let report = report?;
        // Where all was painted before the Master came to know the second agent, there is no pair.
        let took_part = told.transpose()?.is_some_and(|SecondAgentReport { ended }| ended);
        let seconds = report.times.total.as_secs_f64();
        let last = arrivals.agents().values().copied().max().unwrap_or_default();
        Ok(took_part.then_some(MeasuredPair { seconds, joins: last }))
    }
}

/// When agents were known to the Master.
struct Arrivals {
    begun: Instant,
    agents: Mutex<BTreeMap<AgentId, Duration>>,
}

impl Arrivals {
    fn agents(&self) -> MutexGuard<'_, BTreeMap<AgentId, Duration>> {
        self.agents.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Observer for Arrivals {
    fn agent_changed(&self, row: &AgentRow) {
        let now = self.begun.elapsed();
        self.agents().entry(row.agent.clone()).or_insert(now);
    }
}

/// Paints as the second agent until the work is done, or standard input ends because the first process is gone.
///
/// - `output`: the first process reads it.
///
/// # Errors
/// The scene cannot be painted, or the farm not be reached.
pub fn run_second_agent(
    options: &MagarroOptions,
    row: &SharedRow,
    entry: &Entry,
    output: &mut dyn Write,
) -> Result<(), Error> {
    let scene = MagarroScene::load(options)?;
    let settings = scene.settings(row.level, row.optimization, row.ways);
    let engine = scene.engine(&settings, 0)?;
    let link = link(entry, row.work, 1)?;
    let stop = StopSwitch::new();
    say_ready(output)?;
    end_with_parent(vec![stop.clone()])?;
    let ended = assist(&settings, engine, Arc::new(()), &stop, link).map_err(bottega::Error::Job)?;
    say(output, &serde_json::to_string(&SecondAgentReport { ended }).unwrap_or_default())
}

fn link(entry: &Entry, work: u64, agent: u32) -> Result<Link, Error> {
    Ok(ServerLinks::new(ServerAccess::Started(entry.clone()))?.link(work, agent)?.link)
}

/// How far a replay may be off a measured pair.
pub(super) const REPLAY_OFF_MAX: f64 = 0.05;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_read_as_it_is_written() {
        for (ways, optimization) in [(Ways::Ours, Optimization::VeryBig), (Ways::Papers, Optimization::Normal)] {
            let row = SharedRow { level: Level::Joined, optimization, ways, work: 7 };
            assert_eq!(row.to_string().parse(), Ok(row), "{row}");
        }
        for wrong in ["", "3:n:ours", "4:n:ours:1", "3:x:ours:1", "3:n:theirs:1", "3:n:ours:1:2"] {
            assert!(wrong.parse::<SharedRow>().is_err(), "{wrong}");
        }
    }
}
