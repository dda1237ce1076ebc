//! The farm as agents of the platform: one for its jobs, and one for each machine.
//!
//! The agents are state machines; this module connects them to the farm. A single thread reads the notices, reports changes
//! to the agents, and applies the changes that they request, one after another: so an agent that is told that its change
//! was made sees it in all later reports.

mod failure;
mod jobs_agent;
mod ontology;
mod progress;
mod render_agent;
mod rows;
#[cfg(test)]
mod tests;

use std::{
    collections::BTreeMap,
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bottega_agents::{
    AgentId,
    driver::node::{Node, Reports},
};
use failure::FarmFailure;
use jobs_agent::{ChangeJob, JobsAgent, JobsEffect, JobsReport};
use ontology::JobChange;
use render_agent::{GiveOrder, MachineReport, RenderAgent, Surroundings};
use rows::JobRows;

use bottega::Event;

use super::{host::HostClaim, talk, terms};
use crate::{
    client::jobs::{set_priority, steer},
    error::Error,
    job::{
        board::JobBoard,
        machines::{MachineOrder, Roster},
        record::JobState,
        view::{FarmView, JobView, MachineView},
    },
};

/// Interval between reads of the farm's state.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Reserved names, of the platform's own agents, which no machine may have.
const RESERVED: [&str; 5] = ["ams", "df", "start", "acc", jobs_agent::LOCAL_NAME];
/// The longest name of a machine, in bytes.
const NAME_BYTES_MAX: usize = 200;

/// A function that reads the rows of a job.
type ReadRows = Box<dyn FnOnce() -> Result<JobRows, FarmFailure> + Send>;

/// The interface of a farm to its agents.
trait Farm: Send + 'static {
    /// Returns the current state; `None`: its server does not answer.
    fn look(&mut self) -> Option<FarmView>;
    /// Gives a machine a command.
    fn give(&self, machine: &str, order: &MachineOrder) -> Result<(), FarmFailure>;
    /// Changes a job.
    ///
    /// - `by`: the name of the agent that requests it.
    fn change(&self, number: u32, change: JobChange, by: &str) -> Result<(), FarmFailure>;
    /// Returns a function that reads the rows of a job's zones and agents, which may take long.
    fn rows(&self, number: u32) -> ReadRows;
    /// Renews the claim to host the agents.
    fn attend(&mut self) {}
    /// Releases that claim.
    fn leave(&mut self) {}
}

/// A farm accessed through its notices.
struct BoardFarm {
    board: JobBoard,
    roster: Roster,
    claim: HostClaim,
}

impl Farm for BoardFarm {
    fn look(&mut self) -> Option<FarmView> {
        // Without a connection, the known state may be outdated.
        self.board.uplink.is_connected().then(|| FarmView::of(&self.board, &mut self.roster))
    }

    fn give(&self, machine: &str, order: &MachineOrder) -> Result<(), FarmFailure> {
        Ok(self.board.tell(machine, order)?)
    }

    fn change(&self, number: u32, change: JobChange, by: &str) -> Result<(), FarmFailure> {
        let by = &format!("the agent {by}");
        let changed = match change {
            JobChange::Pause => steer(&self.board, number, &JobState::Paused, by),
            JobChange::Resume => steer(&self.board, number, &JobState::Active, by),
            JobChange::Cancel => steer(&self.board, number, &JobState::Cancelled, by),
            JobChange::Priority(priority) => set_priority(&self.board, number, priority, by),
        };
        Ok(changed?)
    }

    fn rows(&self, number: u32) -> ReadRows {
        let board = self.board.clone();
        Box::new(move || {
            let job = board.get(number).ok_or(FarmFailure::NoJob { number })?;
            let mut rows = JobRows::default();
            for row in board.rows(&job)? {
                match row {
                    Event::Zone(zone) => rows.zones.push(*zone),
                    Event::Agent(agent) => rows.agents.push(agent),
                    _ => {}
                }
            }
            Ok(rows)
        })
    }

    fn attend(&mut self) {
        self.claim.renew(&self.board);
    }

    fn leave(&mut self) {
        self.claim.release(&self.board);
    }
}

/// Returns the name of the jobs agent.
pub(super) fn jobs_id(platform: &str) -> AgentId {
    AgentId::new(format!("{}@{platform}", jobs_agent::LOCAL_NAME))
}

/// A request of an agent to the farm.
enum SteeringWish {
    Give { machine: String, give: GiveOrder },
    Change(ChangeJob),
    ReadRows { ticket: u64, number: u32 },
    End,
}

/// The agents of a farm on a platform; they receive no more reports when this is dropped.
pub(super) struct FarmAgents {
    wishes: Sender<SteeringWish>,
    thread: Option<JoinHandle<()>>,
}

impl FarmAgents {
    /// Starts the agents of the farm on the platform.
    ///
    /// - `trusted`: agents of other platforms that may change things.
    pub(super) fn begin(
        node: &Arc<Node>,
        platform: &str,
        board: JobBoard,
        claim: HostClaim,
        trusted: &[AgentId],
    ) -> Result<Self, Error> {
        Self::over(node, platform, BoardFarm { board, roster: Roster::default(), claim }, trusted)
    }

    fn over(node: &Arc<Node>, platform: &str, mut farm: impl Farm, trusted: &[AgentId]) -> Result<Self, Error> {
        let (wishes, wished) = channel();
        let address: Arc<[String]> = Arc::new([node.address().to_owned()]);
        let around = Surroundings {
            ams: node.ams().clone(),
            df: node.df().clone(),
            jobs: AgentId { addresses: Arc::clone(&address), ..jobs_id(platform) },
            trusted: trusted.into(),
        };
        let seen = Arc::new(farm.look().unwrap_or_default());
        let agent = JobsAgent::new(around.clone(), platform.to_owned(), Arc::clone(&seen));
        let wish = wishes.clone();
        let perform = move |effect| {
            let wanted = match effect {
                JobsEffect::Change(change) => SteeringWish::Change(change),
                JobsEffect::ReadRows { ticket, number } => SteeringWish::ReadRows { ticket, number },
            };
            // At shutdown the receiver is gone.
            _ = wish.send(wanted);
        };
        let jobs = node.add_worldly(&around.jobs, agent, perform).map_err(|taken| {
            Error::failed(taken.to_string(), "report this as a bug: it is the first agent of its platform")
        })?;
        let (node, platform, wish) = (Arc::clone(node), platform.to_owned(), wishes.clone());
        let watch = Watch {
            farm,
            node,
            platform,
            address,
            around,
            jobs,
            seen,
            is_silent: false,
            machines: BTreeMap::new(),
            wishes: wish,
        };
        let thread = thread::Builder::new().name("farm".to_owned()).spawn(move || watch.run(&wished));
        let thread = thread.map_err(|error| {
            Error::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once")
        })?;
        Ok(Self { wishes, thread: Some(thread) })
    }
}

impl Drop for FarmAgents {
    fn drop(&mut self) {
        // The thread may have ended already.
        _ = self.wishes.send(SteeringWish::End);
        if let Some(thread) = self.thread.take() {
            // The thread has reported a panic itself.
            _ = thread.join();
        }
    }
}

/// The agent of a machine.
struct KnownMachine {
    reports: Reports<MachineReport>,
    /// The last report to the agent; `None`: that the machine is gone.
    reported: Option<(MachineView, Option<Box<JobView>>)>,
}

struct Watch<F> {
    farm: F,
    node: Arc<Node>,
    platform: String,
    address: Arc<[String]>,
    around: Surroundings,
    jobs: Reports<JobsReport>,
    seen: Arc<FarmView>,
    /// True if the agents know that the farm does not answer.
    is_silent: bool,
    /// The agents by name in lower case, as the platform compares names. `None`: the name cannot be an agent's.
    machines: BTreeMap<String, Option<KnownMachine>>,
    wishes: Sender<SteeringWish>,
}

impl<F: Farm> Watch<F> {
    fn run(mut self, wished: &Receiver<SteeringWish>) {
        let mut look_at = Instant::now();
        loop {
            if look_at <= Instant::now() {
                look_at = Instant::now() + LOOK_EVERY;
                self.farm.attend();
                self.look();
            }
            match wished.recv_timeout(look_at.saturating_duration_since(Instant::now())) {
                Ok(SteeringWish::End) | Err(RecvTimeoutError::Disconnected) => return self.farm.leave(),
                Err(RecvTimeoutError::Timeout) => {}
                Ok(SteeringWish::Change(ChangeJob { ticket, number, change, by })) => {
                    let result = self.farm.change(number, change, &by);
                    // Report the new state first, so that the agent sees its change before it is confirmed.
                    self.look();
                    self.jobs.tell(JobsReport::Changed { ticket, result });
                }
                Ok(SteeringWish::ReadRows { ticket, number }) => self.read_rows(ticket, number),
                Ok(SteeringWish::Give { machine, give: GiveOrder { ticket, order } }) => {
                    let result = self.farm.give(&machine, &order);
                    self.look();
                    if let Some(Some(known)) = self.machines.get(&machine.to_lowercase()) {
                        known.reports.tell(MachineReport::Given { ticket, result });
                    }
                }
            }
        }
    }

    /// Reads the rows of a job on a thread of its own, so that nothing else waits.
    fn read_rows(&self, ticket: u64, number: u32) {
        let (read, jobs) = (self.farm.rows(number), self.jobs.clone());
        let begun = thread::Builder::new().name("rows".to_owned()).spawn(move || {
            jobs.tell(JobsReport::Rows { ticket, rows: read() });
        });
        if let Err(error) = begun {
            let failure = FarmFailure::NoThread { problem: error.to_string() };
            self.jobs.tell(JobsReport::Rows { ticket, rows: Err(failure) });
        }
    }

    /// Reports changes to the agents.
    fn look(&mut self) {
        let Some(now) = self.farm.look() else {
            self.fall_silent();
            return;
        };
        // After a silence, report everything again.
        let again = std::mem::take(&mut self.is_silent);
        let mut gone: Vec<String> = self.machines.keys().cloned().collect();
        for machine in &now.machines {
            let name = machine.presence.name.to_lowercase();
            gone.retain(|other| *other != name);
            let job = machine.presence.job.and_then(|number| now.job(number));
            self.see(name, (machine.clone(), job.cloned().map(Box::new)), again);
        }
        for name in gone {
            if let Some(Some(known)) = self.machines.get_mut(&name)
                && known.reported.take().is_some()
            {
                known.reports.tell(MachineReport::Gone);
            }
        }
        if *self.seen != now || again {
            self.seen = Arc::new(now);
            self.jobs.tell(JobsReport::Farm(Arc::clone(&self.seen)));
        }
    }

    fn fall_silent(&mut self) {
        if std::mem::replace(&mut self.is_silent, true) {
            return;
        }
        tracing::warn!("the server of the farm does not answer");
        self.jobs.tell(JobsReport::Silent);
        for known in self.machines.values().flatten() {
            known.reports.tell(MachineReport::Silent);
        }
    }

    fn see(&mut self, name: String, seen: (MachineView, Option<Box<JobView>>), again: bool) {
        match self.machines.get_mut(&name) {
            Some(None) => {}
            Some(Some(known)) if known.reported.as_ref() == Some(&seen) && !again => {}
            Some(Some(known)) => {
                known.reported = Some(seen.clone());
                known.reports.tell(MachineReport::Seen(seen.0, seen.1));
            }
            None => {
                let reports = self.add(&seen.0, seen.1.clone());
                self.machines.insert(name, reports.map(|reports| KnownMachine { reports, reported: Some(seen) }));
            }
        }
    }

    /// Adds an agent for a machine.
    fn add(&self, machine: &MachineView, job: Option<Box<JobView>>) -> Option<Reports<MachineReport>> {
        let name = &machine.presence.name;
        if !can_be_name(name) {
            tracing::warn!(name, "no agent represents this machine: its name is not a valid agent name");
            return None;
        }
        let id = AgentId { name: format!("{name}@{}", self.platform).into(), addresses: Arc::clone(&self.address) };
        let agent = RenderAgent::new(id.clone(), self.around.clone(), machine.clone(), job);
        let (wishes, machine) = (self.wishes.clone(), name.clone());
        let perform = move |give| {
            // At shutdown the receiver is gone.
            _ = wishes.send(SteeringWish::Give { machine: machine.clone(), give });
        };
        self.node
            .add_worldly(&id, agent, perform)
            .inspect_err(|error| tracing::warn!(%error, "no agent represents this machine"))
            .ok()
    }
}

fn can_be_name(name: &str) -> bool {
    let fits = |byte: u8| byte.is_ascii_alphanumeric() || b"-._".contains(&byte);
    !name.is_empty()
        && name.len() <= NAME_BYTES_MAX
        && name.bytes().all(fits)
        && !RESERVED.iter().any(|reserved| reserved.eq_ignore_ascii_case(name))
}
