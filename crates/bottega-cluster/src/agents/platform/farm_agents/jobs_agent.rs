//! The jobs agent of the platform: describes the farm's jobs, and changes them on request.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use bottega_agents::{
    ActionOf, Event, EventOf, Performative, StateMachine, Time,
    gateway::PlainContent,
    platform::{
        AmsAgentDescription, DfAgentDescription, Function, ManagementContent, Outcome, Page, PageAsk,
        SearchConstraints, directory_request,
    },
    sl::Term,
};

use super::{
    failure::FarmFailure,
    ontology::{JobChange, JobsFunction, ONTOLOGY, job_term, machine_term, no_such_job, read_jobs_function, read_wish},
    progress::{JobSubscriptions, SubscriberKey},
    render_agent::{OWNERSHIP, Surroundings, described},
    rows::{JobRows, row_terms},
    talk::{self, Message},
    terms::{Unread, reason},
};
use crate::job::view::FarmView;

/// The local name of the agent.
pub(super) const LOCAL_NAME: &str = "jobs";
/// The service types of the agent.
pub(super) const SERVICE_TYPE: &str = "bottega-jobs";
const BLACKBOARD_TYPE: &str = "bottega-blackboard";
/// The most concurrent reads of rows.
const READS_MAX: usize = 16;
/// The most concurrent changes.
const CHANGES_MAX: usize = 256;
/// The time until all live machines have announced themselves: registered ones that have not by then are gone.
const SETTLED_AFTER: Duration = Duration::from_secs(5);

/// A change of a job; answered by [`JobsReport::Changed`] with the same ticket.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ChangeJob {
    pub(super) ticket: u64,
    pub(super) number: u32,
    pub(super) change: JobChange,
    /// The name of the agent that requested it.
    pub(super) by: String,
}

/// An action that the agent requests of the farm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum JobsEffect {
    Change(ChangeJob),
    /// Read the rows of a job; answered by [`JobsReport::Rows`] with the same ticket.
    ReadRows {
        ticket: u64,
        number: u32,
    },
}

/// A report of the farm to the agent.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum JobsReport {
    /// The rows of a job, or why they cannot be read.
    Rows { ticket: u64, rows: Result<JobRows, FarmFailure> },
    /// The current state of the farm.
    Farm(Arc<FarmView>),
    /// The farm's server does not answer: the last state may be outdated.
    Silent,
    /// A change was made, or why it was not.
    Changed { ticket: u64, result: Result<(), FarmFailure> },
}

/// The agent that waits for rows.
enum RowReader {
    /// It sent this message with this request, for one zone or all.
    Asker(Box<Message>, Term, Option<u32>),
    Subscriber(SubscriberKey),
}

/// The state machine of the jobs agent.
pub(super) struct JobsAgent {
    id: bottega_agents::AgentId,
    around: Surroundings,
    /// The name of the platform: the part after `@`.
    platform: String,
    farm: Arc<FarmView>,
    /// Time since which the farm does not answer.
    silent: Option<Time>,
    yellow: Page<DfAgentDescription>,
    changing: BTreeMap<u64, (Message, Term)>,
    /// Pending reads of rows, by ticket.
    reading: BTreeMap<u64, RowReader>,
    progress: JobSubscriptions,
    next_number: u64,
    /// The time to search for entries of machines that are gone; `None`: done.
    clean_at: Option<Time>,
    /// The number of that search.
    search: Option<u64>,
}

type JobsActions = Vec<ActionOf<JobsAgent>>;

impl JobsAgent {
    /// Makes the agent.
    ///
    /// - `platform`: the name of the platform: the part after `@`.
    /// - `farm`: the current state of the farm.
    pub(super) fn new(around: Surroundings, platform: String, farm: Arc<FarmView>) -> Self {
        let id = around.jobs.clone();
        let mut yellow = Page::absent();
        let protocols = ["fipa-request", "fipa-subscribe"];
        let mut entry = described(&id, LOCAL_NAME, SERVICE_TYPE, &protocols, Vec::new());
        let board = described(&id, "blackboard", BLACKBOARD_TYPE, &protocols, Vec::new());
        entry.services.extend(board.services);
        yellow.want(Some(entry));
        Self {
            id,
            around,
            platform,
            farm,
            silent: None,
            yellow,
            changing: BTreeMap::new(),
            reading: BTreeMap::new(),
            progress: JobSubscriptions::default(),
            next_number: 1,
            clean_at: None,
            search: None,
        }
    }

    fn number(&mut self) -> u64 {
        self.next_number += 1;
        self.next_number - 1
    }

    fn hear(&mut self, now: Time, message: &Message, send: &mut Vec<Message>, actions: &mut JobsActions) {
        let Some(wire) = talk::foreign(message) else { return };
        if message.performative == Performative::Cancel {
            // The conversation says which subscription is cancelled.
            if let Err(why) = self.progress.cancel(message, &self.id, send) {
                send.push(talk::rejection(message, &self.id, None, why));
            }
            return;
        }
        let request = match message.performative {
            Performative::Request | Performative::Subscribe => talk::expression(wire, ONTOLOGY),
            act => Err(talk::unsupported(act)),
        };
        let request = match request {
            Ok(request) => request,
            Err(why) => {
                send.push(talk::rejection(message, &self.id, None, why));
                return;
            }
        };
        let heard = match message.performative {
            Performative::Subscribe => self.subscribe(now, message, &request, send),
            _ => self.perform(now, message, &request, send, actions),
        };
        if let Err(why) = heard {
            send.push(talk::rejection(message, &self.id, Some(&request), why));
        }
    }

    /// Answers with a failure while the farm does not answer, because its state may be outdated. Returns `true` if so.
    fn fails_silent(&self, now: Time, message: &Message, request: &Term, send: &mut Vec<Message>) -> bool {
        let silent = self.silent.map(|since| talk::silent(message, &self.id, request, now.since(since)));
        let fails = silent.is_some();
        send.extend(silent);
        fails
    }

    fn subscribe(&mut self, now: Time, message: &Message, wish: &Term, send: &mut Vec<Message>) -> Result<(), Unread> {
        let (number, followed, action) = read_wish(wish)?;
        if self.fails_silent(now, message, wish, send) {
            return Ok(());
        }
        if self.farm.job(number).is_none() {
            return Err(no_such_job(action));
        }
        self.progress.subscribe(message, wish, (number, followed), &self.id, send)
    }

    fn perform(
        &mut self,
        now: Time,
        message: &Message,
        request: &Term,
        send: &mut Vec<Message>,
        actions: &mut JobsActions,
    ) -> Result<(), Unread> {
        let function = read_jobs_function(request)?;
        if self.fails_silent(now, message, request, send) {
            return Ok(());
        }
        let found = match function {
            JobsFunction::ListJobs => Term::call("sequence", self.farm.jobs.iter().map(job_term)),
            JobsFunction::ListMachines => {
                Term::call("sequence", self.farm.machines.iter().map(|machine| machine_term(machine, None)))
            }
            JobsFunction::Describe(number) => job_term(self.farm.job(number).ok_or_else(|| no_such_job(request))?),
            JobsFunction::ReadRows(number, zone) => {
                return self.read_rows(message, request, (number, zone), send, actions);
            }
            JobsFunction::Change(number, change) => {
                return self.change(message, request, number, change, send, actions);
            }
        };
        send.push(talk::result(message, &self.id, request, found));
        Ok(())
    }

    fn change(
        &mut self,
        message: &Message,
        request: &Term,
        number: u32,
        change: JobChange,
        send: &mut Vec<Message>,
        actions: &mut JobsActions,
    ) -> Result<(), Unread> {
        if !talk::is_trusted(&self.around.trusted, &message.sender) {
            return Err(Unread::Refused(reason("unauthorised", [])));
        }
        let job = self.farm.job(number).ok_or_else(|| no_such_job(request))?;
        if job.is_over {
            return Err(Unread::Refused(reason("job-is-over", [job.state])));
        }
        if self.changing.len() >= CHANGES_MAX {
            send.push(talk::failure(message, &self.id, request, "too many requests at the same time"));
            return Ok(());
        }
        send.push(talk::agree(message, &self.id, request));
        let ticket = self.number();
        self.changing.insert(ticket, (message.clone(), request.clone()));
        let by = message.sender.name.to_string();
        actions.push(bottega_agents::Action::Effect(JobsEffect::Change(ChangeJob { ticket, number, change, by })));
        Ok(())
    }

    fn read_rows(
        &mut self,
        message: &Message,
        request: &Term,
        (number, zone): (u32, Option<u32>),
        send: &mut Vec<Message>,
        actions: &mut JobsActions,
    ) -> Result<(), Unread> {
        self.farm.job(number).ok_or_else(|| no_such_job(request))?;
        if self.reading.len() >= READS_MAX {
            send.push(talk::failure(message, &self.id, request, "too many read at the same time"));
            return Ok(());
        }
        let ticket = self.number();
        self.reading.insert(ticket, RowReader::Asker(Box::new(message.clone()), request.clone(), zone));
        actions.push(bottega_agents::Action::Effect(JobsEffect::ReadRows { ticket, number }));
        Ok(())
    }

    fn read(&mut self, now: Time, ticket: u64, rows: Result<JobRows, FarmFailure>, send: &mut Vec<Message>) {
        match self.reading.remove(&ticket) {
            Some(RowReader::Asker(message, request, zone)) => send.push(match rows {
                Ok(rows) => {
                    let wanted = row_terms(&rows, zone).into_values();
                    talk::result(&message, &self.id, &request, Term::call("sequence", wanted))
                }
                Err(why) => talk::failure(&message, &self.id, &request, &why.to_string()),
            }),
            Some(RowReader::Subscriber(key)) => self.progress.report_rows(now, &key, rows.as_ref(), &self.id, send),
            None => {}
        }
    }

    /// Reports to subscribers what is due, and reads the rows of those who follow a Blackboard.
    fn report(&mut self, now: Time, send: &mut Vec<Message>, actions: &mut JobsActions) {
        let farm = Arc::clone(&self.farm);
        let room = READS_MAX.saturating_sub(self.reading.len());
        for (key, number) in self.progress.report(now, &farm, room, &self.id, send) {
            let ticket = self.number();
            self.reading.insert(ticket, RowReader::Subscriber(key));
            actions.push(bottega_agents::Action::Effect(JobsEffect::ReadRows { ticket, number }));
        }
    }

    fn changed(&mut self, ticket: u64, result: Result<(), FarmFailure>, send: &mut Vec<Message>) {
        let Some((message, request)) = self.changing.remove(&ticket) else { return };
        send.push(match result {
            Ok(()) => talk::done(&message, &self.id, &request),
            Err(why) => talk::failure(&message, &self.id, &request, &why.to_string()),
        });
    }

    fn hear_management(&mut self, now: Time, message: &Message, content: &ManagementContent, send: &mut Vec<Message>) {
        self.yellow.hear(now, message);
        match content {
            ManagementContent::Undelivered { receiver, .. } => self.progress.lost(now, receiver, &self.id, send),
            ManagementContent::Done(_, Outcome::Agents(agents)) if self.search == Some(message.in_reply_to) => {
                self.search = None;
                self.clean(agents, send);
            }
            _ => {}
        }
    }

    /// Deregisters machines that are gone: a platform that was killed leaves their pages behind.
    fn clean(&mut self, agents: &[AmsAgentDescription], send: &mut Vec<Message>) {
        for name in agents.iter().filter_map(|agent| agent.name.as_ref()) {
            let local = name.name.strip_suffix(&format!("@{}", self.platform));
            let is_there = |machine: &crate::job::view::MachineView| local == Some(&*machine.presence.name);
            if local.is_none() || self.farm.machines.iter().any(is_there) {
                continue;
            }
            let white = AmsAgentDescription { name: Some(name.clone()), ..Default::default() };
            let yellow = DfAgentDescription { name: Some(name.clone()), ..Default::default() };
            let number = self.number();
            send.push(directory_request(number, &self.id, &self.around.ams, Function::DeregisterAgent(white)));
            send.push(directory_request(number, &self.id, &self.around.df, Function::Deregister(yellow)));
        }
    }

    /// Does what is due.
    fn tick(&mut self, now: Time, send: &mut Vec<Message>) {
        if self.clean_at.is_some_and(|at| at <= now) {
            self.clean_at = None;
            let number = self.number();
            self.search = Some(number);
            let ours = AmsAgentDescription { ownership: Some(OWNERSHIP.to_owned()), ..Default::default() };
            let all = SearchConstraints { max_results: Some(-1), ..Default::default() };
            send.push(directory_request(number, &self.id, &self.around.ams, Function::SearchAgents(ours, all)));
        }
        let number = self.next_number;
        if let Some(ask) = self.yellow.next(now, number) {
            self.next_number += 1;
            let function = match ask {
                PageAsk::Enter(offer) => Function::Register(offer),
                PageAsk::Change(offer) => Function::Modify(offer),
                // The entry is always wanted.
                PageAsk::TakeOut => return,
            };
            send.push(directory_request(number, &self.id, &self.around.df, function));
        }
    }
}

impl StateMachine for JobsAgent {
    type Content = PlainContent;
    type Value = String;
    type Effect = JobsEffect;
    type Completion = JobsReport;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut JobsActions) {
        let mut send = Vec::new();
        match event {
            Event::Start => self.clean_at = Some(now + SETTLED_AFTER),
            Event::Message(message) => match &message.content {
                PlainContent::Management(content) => self.hear_management(now, &message, content, &mut send),
                PlainContent::Foreign(_) => self.hear(now, &message, &mut send, actions),
            },
            Event::Completed(JobsReport::Farm(farm)) => (self.farm, self.silent) = (farm, None),
            Event::Completed(JobsReport::Silent) => _ = self.silent.get_or_insert(now),
            Event::Completed(JobsReport::Rows { ticket, rows }) => self.read(now, ticket, rows, &mut send),
            Event::Completed(JobsReport::Changed { ticket, result }) => self.changed(ticket, result, &mut send),
            Event::Deadline | Event::Store { .. } | Event::Presence { .. } => {}
        }
        self.tick(now, &mut send);
        self.report(now, &mut send, actions);
        actions.extend(send.into_iter().map(talk::send));
    }

    fn next_deadline(&self) -> Option<Time> {
        [self.clean_at, self.yellow.next_deadline(), self.progress.next_deadline()].into_iter().flatten().min()
    }
}
