//! The second agent of a measured pair: a process that paints on one processor over a NATS server.

use std::{
    collections::BTreeMap,
    fmt,
    io::Write,
    net::SocketAddr,
    path::{Path, PathBuf},
    str::FromStr,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use bottega_agents::AgentId;
use bottega_cluster::own_server::{Entry, OwnServer};
use bottega_farm::{AgentRow, Level, Link, Observer, Optimization, StopSwitch, assist, lead};
use clap::Args;
use serde::{Deserialize, Serialize};
use tempfile::TempDir;

use super::{options::MagarroPicture, report::Ways, scene::MagarroScene};
use crate::{
    error::Error,
    farm::{ServerAccess, ServerLinks, unix_micros},
    files::temporary_folder,
    part_process::{PartProcess, end_with_parent, say, say_ready, this_program},
};

/// A method that both processes agree on. As text: `LEVEL:OPTIMIZATION:WAYS:WORK`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SharedRow {
    pub(super) level: Level,
    pub(super) optimization: Optimization,
    pub(super) ways: Ways,
    /// The id of the work.
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

/// The second agent, as the first process asks for it.
#[derive(Clone, Debug, Args)]
pub(crate) struct SecondAgentOptions {
    #[command(flatten)]
    picture: MagarroPicture,
    /// The row that both paint: `LEVEL:OPTIMIZATION:WAYS:WORK`.
    #[arg(long)]
    row: SharedRow,
    /// The address of the server that the first process has started.
    #[arg(long)]
    at: SocketAddr,
    /// The folder of the server's state.
    #[arg(long)]
    state: PathBuf,
}

/// The final message of the second process.
#[derive(Debug, Serialize, Deserialize)]
struct SecondAgentReport {
    /// True if the work was complete.
    ended: bool,
}

/// The measurement of a pair of agents.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasuredPair {
    /// The time of both together, in seconds.
    pub(super) seconds: f64,
    /// The time from the start until the Master knew the second agent.
    pub(super) joins: Duration,
}

/// Two agents with a server that lives as long as this value.
pub(super) struct AgentPair {
    server: OwnServer,
    _folder: TempDir,
}

impl AgentPair {
    /// Starts the server.
    ///
    /// - `program`: the server's program; `None`: the installed `nats-server`.
    pub(super) fn start(program: Option<&Path>) -> Result<Self, Error> {
        let folder = temporary_folder()?;
        Ok(Self { server: OwnServer::start(program, folder.path())?, _folder: folder })
    }

    /// Paints with both agents; time starts when both have loaded the scene. `None`: one agent finished before the other joined.
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
        let mut command = this_program()?;
        command.arg("magarro-part").args(scene.options.words(scene.path.clone())).arg("--row").arg(row.to_string());
        command.arg("--at").arg(entry.address.to_string()).arg("--state").arg(&entry.folder);
        let mut second = PartProcess::start(command)?;
        second.until_ready()?;
        let arrivals = Arc::new(Arrivals { begun: Instant::now(), agents: Mutex::default() });
        let observer = Arc::clone(&arrivals) as _;
        let painted = lead(&settings, engine, observer, &StopSwitch::new(), None, None, Some(link.clone()));
        let report = painted.map_err(bottega::Error::Job);
        let report_of_second = report.is_ok().then(|| second.report::<SecondAgentReport>());
        link.forget();
        let report = report?;
        // If everything was painted before the Master knew the second agent, there is no pair.
        let took_part = report_of_second.transpose()?.is_some_and(|SecondAgentReport { ended }| ended);
        let seconds = report.times.total.as_secs_f64();
        let last = arrivals.agents().values().copied().max().unwrap_or_default();
        Ok(took_part.then_some(MeasuredPair { seconds, joins: last }))
    }
}

/// The times at which agents became known to the Master.
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

impl SecondAgentOptions {
    /// Paints as the second agent until the work is done, or until standard input ends because the first process is gone.
    ///
    /// - `output`: read by the first process.
    ///
    /// # Errors
    /// The scene cannot be rendered, or the farm cannot be reached.
    pub(crate) fn run(&self, output: &mut dyn Write) -> Result<(), Error> {
        let Self { picture, row, at, state } = self;
        let scene = MagarroScene::load(picture)?;
        let settings = scene.settings(row.level, row.optimization, row.ways);
        let engine = scene.engine(&settings, 0)?;
        let link = link(&Entry { folder: state.clone(), address: *at }, row.work, 1)?;
        let stop = StopSwitch::new();
        say_ready(output)?;
        end_with_parent(vec![stop.clone()])?;
        let ended = assist(&settings, engine, Arc::new(()), &stop, link).map_err(bottega::Error::Job)?;
        say(output, &serde_json::to_string(&SecondAgentReport { ended }).unwrap_or_default())
    }
}

fn link(entry: &Entry, work: u64, agent: u32) -> Result<Link, Error> {
    Ok(ServerLinks::new(ServerAccess::Started(entry.clone()))?.link(work, agent)?.link)
}

/// The maximum relative difference between a replay and a measured pair.
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
