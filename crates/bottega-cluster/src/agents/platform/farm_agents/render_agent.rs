//! A machine of the farm as an agent of the platform.
//!
//! A life cycle request of the AMS becomes a command in the farm, and a command given elsewhere in the farm becomes a state
//! in the white pages. If both conflict, the farm decides: its state after this agent's command was applied counts.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
    time::Duration,
};

use bottega_agents::{
    ActionOf, AgentId, Event, EventOf, Performative, StateMachine, Time,
    gateway::PlainContent,
    platform::{
        AmsAgentDescription, DfAgentDescription, Function, LifeCycleRequest, LifeCycleState, ManagementContent, Page,
        PageAsk, Property, ServiceDescription, directory_request,
    },
    sl::Term,
};

use super::{
    failure::FarmFailure,
    ontology::{MachineFunction, ONTOLOGY, machine_term, read_machine_function},
    talk::{self, Message},
    terms::{Unread, reason},
};
use crate::job::{
    machines::MachineOrder,
    presence::PresenceState,
    view::{JobView, MachineView},
};

/// The service type of machines.
pub(super) const SERVICE_TYPE: &str = "bottega-render";
/// The ownership of these agents, by which their entries are recognized when the platform restarts.
pub(super) const OWNERSHIP: &str = "bottega-farm";
/// The most messages that are kept while it is suspended; more are lost.
const KEPT_MAX: usize = 1 << 10;
/// The most concurrent changes.
const CHANGES_MAX: usize = 64;
/// The time within which a machine must obey, before a failure is reported.
const OBEYS_WITHIN: Duration = Duration::from_secs(60);

/// The agents that the farm's agents talk to.
#[derive(Clone, Debug)]
pub(super) struct Surroundings {
    pub(super) ams: AgentId,
    pub(super) df: AgentId,
    /// The jobs agent, which may change all entries: only the platform may resume.
    pub(super) jobs: AgentId,
    /// Agents of other platforms that may change things.
    pub(super) trusted: Arc<[AgentId]>,
}

/// A command for the machine; answered by [`MachineReport::Given`] with the same ticket.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GiveOrder {
    pub(super) ticket: u64,
    pub(super) order: MachineOrder,
}

/// A report of the farm to the agent.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum MachineReport {
    /// The current state of the machine, and the job that it works on.
    Seen(MachineView, Option<Box<JobView>>),
    /// The machine is gone.
    Gone,
    /// The farm's server does not answer, so the state of the machine is unknown.
    Silent,
    /// A command was given, or why it was not. The last state reported includes it.
    Given { ticket: u64, result: Result<(), FarmFailure> },
}

/// A request whose sender waits for the machine to obey.
#[derive(Debug)]
struct Change {
    message: Message,
    request: Term,
    standing: PresenceState,
    until: Time,
}

/// The state machine of a machine's agent.
pub(super) struct RenderAgent {
    id: AgentId,
    around: Surroundings,
    /// The state of the machine, while it is present.
    machine: Option<MachineView>,
    /// The job that it works on.
    job: Option<Box<JobView>>,
    /// Time since which the farm does not answer.
    silent: Option<Time>,
    white: Page<LifeCycleState>,
    yellow: Page<DfAgentDescription>,
    /// True if the AMS has suspended it.
    is_suspended: bool,
    kept: VecDeque<Message>,
    /// True if the AMS has destroyed it.
    is_destroyed: bool,
    next_number: u64,
    /// Commands that are being given, by ticket.
    giving: BTreeMap<u64, Option<Change>>,
    /// Commands that were given and that the machine has not obeyed yet.
    changes: Vec<Change>,
}

type RenderActions = Vec<ActionOf<RenderAgent>>;

impl RenderAgent {
    /// Makes the agent of a machine.
    ///
    /// - `id`: its name, with the addresses of the platform.
    /// - `job`: the job that the machine works on.
    pub(super) fn new(id: AgentId, around: Surroundings, machine: MachineView, job: Option<Box<JobView>>) -> Self {
        let mut this = Self {
            id,
            around,
            machine: None,
            job: None,
            silent: None,
            // The AMS registers local agents itself.
            white: Page::there(),
            yellow: Page::absent(),
            is_suspended: false,
            kept: VecDeque::new(),
            is_destroyed: false,
            next_number: 1,
            giving: BTreeMap::new(),
            changes: Vec::new(),
        };
        this.see(Some(machine), job);
        this
    }

    fn number(&mut self) -> u64 {
        self.next_number += 1;
        self.next_number - 1
    }

    /// Records the state of the machine; `None`: it is gone.
    fn see(&mut self, machine: Option<MachineView>, job: Option<Box<JobView>>) {
        (self.machine, self.job, self.silent) = (machine, job, None);
        self.is_destroyed &= self.machine.is_some();
        self.want();
    }

    /// Updates the wanted directory entries from the state of the farm, unless commands are pending.
    fn want(&mut self) {
        let listed = self.machine.as_ref().filter(|_| !self.is_destroyed);
        self.yellow.want(listed.map(|machine| offer(&self.id, machine)));
        match listed.map(|machine| machine.ordered) {
            None => self.white.want(None),
            Some(_) if !self.giving.is_empty() => {}
            // It keeps its state until it is gone.
            Some(PresenceState::Terminated) if self.white.wanted().is_some() => {}
            Some(PresenceState::Suspended) => self.white.want(Some(LifeCycleState::Suspended)),
            Some(_) => self.white.want(Some(LifeCycleState::Active)),
        }
    }

    fn takes_orders(&self) -> bool {
        self.machine.as_ref().is_some_and(|machine| machine.presence.takes_orders)
    }

    fn give(&mut self, standing: PresenceState, by: String, change: Option<Change>, actions: &mut RenderActions) {
        let ticket = self.number();
        self.giving.insert(ticket, change);
        actions.push(bottega_agents::Action::Effect(GiveOrder { ticket, order: MachineOrder { standing, by } }));
    }

    /// Carries out a life cycle request of the AMS.
    fn obey(&mut self, message: &Message, wish: LifeCycleRequest, now: Time, actions: &mut RenderActions) {
        let done = PlainContent::Management(ManagementContent::LifeCycleDone(wish));
        actions.push(talk::send(message.reply(Performative::Inform, self.id.clone(), done)));
        let standing = match wish {
            LifeCycleRequest::Suspend => PresenceState::Suspended,
            LifeCycleRequest::Resume => PresenceState::Active,
            LifeCycleRequest::Quit | LifeCycleRequest::Destroy => PresenceState::Terminated,
        };
        // The entry may have been changed as a whole.
        self.white.changed(wish != LifeCycleRequest::Destroy);
        self.is_destroyed = wish == LifeCycleRequest::Destroy && self.takes_orders();
        match wish {
            LifeCycleRequest::Suspend => self.is_suspended = true,
            LifeCycleRequest::Resume => self.is_suspended = false,
            LifeCycleRequest::Quit | LifeCycleRequest::Destroy => {}
        }
        if self.takes_orders() {
            let ordered = self.machine.as_ref().map(|machine| machine.ordered);
            if ordered != Some(standing) || !self.giving.is_empty() {
                self.give(standing, format!("{} of the platform", self.around.ams), None, actions);
            }
            match standing {
                PresenceState::Active => self.white.want(Some(LifeCycleState::Active)),
                PresenceState::Suspended => self.white.want(Some(LifeCycleState::Suspended)),
                PresenceState::Terminated => {}
            }
        }
        self.want();
        if !self.is_suspended {
            for message in std::mem::take(&mut self.kept) {
                self.hear(&message, now, actions);
            }
        }
    }

    /// Handles a message from another platform. A suspended machine only describes itself; other requests wait until it is
    /// resumed.
    fn hear(&mut self, message: &Message, now: Time, actions: &mut RenderActions) {
        let Some(wire) = talk::foreign(message) else { return };
        let read = match message.performative {
            Performative::Request => talk::expression(wire, ONTOLOGY),
            act => Err(talk::unsupported(act)),
        };
        let describes = |request: &Term| read_machine_function(request) == Ok(MachineFunction::Describe);
        if self.is_suspended && !read.as_ref().is_ok_and(describes) {
            if self.kept.len() < KEPT_MAX {
                self.kept.push_back(message.clone());
            }
            return;
        }
        match read {
            Ok(request) => {
                if let Err(why) = self.perform(message, &request, now, actions) {
                    actions.push(talk::send(talk::rejection(message, &self.id, Some(&request), why)));
                }
            }
            Err(why) => actions.push(talk::send(talk::rejection(message, &self.id, None, why))),
        }
    }

    fn perform(
        &mut self,
        message: &Message,
        request: &Term,
        now: Time,
        actions: &mut RenderActions,
    ) -> Result<(), Unread> {
        let function = read_machine_function(request)?;
        if let Some(since) = self.silent {
            actions.push(talk::send(talk::silent(message, &self.id, request, now.since(since))));
            return Ok(());
        }
        let Some(machine) = &self.machine else {
            actions.push(talk::send(talk::failure(message, &self.id, request, "the machine has gone")));
            return Ok(());
        };
        let standing = match function {
            MachineFunction::Describe => {
                let machine = machine_term(machine, self.job.as_deref());
                actions.push(talk::send(talk::result(message, &self.id, request, machine)));
                return Ok(());
            }
            MachineFunction::Suspend => PresenceState::Suspended,
            MachineFunction::Terminate => PresenceState::Terminated,
        };
        if !talk::is_trusted(&self.around.trusted, &message.sender) {
            return Err(Unread::Refused(reason("unauthorised", [])));
        }
        if !self.takes_orders() {
            return Err(Unread::Refused(reason("takes-no-orders", [])));
        }
        if self.giving.len() + self.changes.len() >= CHANGES_MAX {
            actions.push(talk::send(talk::failure(message, &self.id, request, "too many requests at the same time")));
            return Ok(());
        }
        actions.push(talk::send(talk::agree(message, &self.id, request)));
        let change = Change { message: message.clone(), request: request.clone(), standing, until: now + OBEYS_WITHIN };
        self.give(standing, message.sender.to_string(), Some(change), actions);
        Ok(())
    }

    fn given(&mut self, ticket: u64, result: Result<(), FarmFailure>, actions: &mut RenderActions) {
        let change = self.giving.remove(&ticket).flatten();
        match (change, result) {
            (Some(change), Ok(())) => self.changes.push(change),
            (Some(change), Err(why)) => {
                actions.push(talk::send(talk::failure(&change.message, &self.id, &change.request, &why.to_string())));
            }
            // The machine stays as it was, and the directories will show so.
            (None, Err(_)) => self.is_destroyed = false,
            (None, Ok(())) => {}
        }
        self.want();
    }

    /// Answers the requests that were carried out, or that have failed.
    fn settle(&mut self, now: Time, actions: &mut RenderActions) {
        let standing = self.machine.as_ref().map(|machine| machine.presence.standing);
        for change in std::mem::take(&mut self.changes) {
            let Change { message, request, .. } = &change;
            let is_so = match change.standing {
                PresenceState::Terminated => standing.is_none(),
                wanted => standing == Some(wanted),
            };
            if is_so {
                actions.push(talk::send(talk::done(message, &self.id, request)));
            } else if change.until <= now || standing.is_none() {
                actions.push(talk::send(talk::failure(message, &self.id, request, "the machine did not obey")));
            } else {
                self.changes.push(change);
            }
        }
    }

    /// Updates the directories.
    fn keep_pages(&mut self, now: Time, actions: &mut RenderActions) {
        let number = self.next_number;
        if let Some(ask) = self.white.next(now, number) {
            let entry = |state| AmsAgentDescription {
                name: Some(self.id.clone()),
                ownership: Some(OWNERSHIP.to_owned()),
                state: Some(state),
            };
            let resumes = self.is_suspended && ask == PageAsk::Change(LifeCycleState::Active);
            let from = if resumes { &self.around.jobs } else { &self.id };
            let function = match ask {
                // An agent is always registered as active.
                PageAsk::Enter(_) => Function::RegisterAgent(entry(LifeCycleState::Active)),
                PageAsk::Change(state) => Function::ModifyAgent(entry(state)),
                PageAsk::TakeOut => Function::DeregisterAgent(entry(LifeCycleState::Active)),
            };
            actions.push(talk::send(directory_request(number, from, &self.around.ams, function)));
            self.next_number += 1;
        }
        let number = self.next_number;
        if let Some(ask) = self.yellow.next(now, number) {
            let function = match ask {
                PageAsk::Enter(offer) => Function::Register(offer),
                PageAsk::Change(offer) => Function::Modify(offer),
                PageAsk::TakeOut => {
                    Function::Deregister(DfAgentDescription { name: Some(self.id.clone()), ..Default::default() })
                }
            };
            actions.push(talk::send(directory_request(number, &self.id, &self.around.df, function)));
            self.next_number += 1;
        }
    }

    fn take(&mut self, message: &Message, now: Time, actions: &mut RenderActions) {
        let PlainContent::Management(content) = &message.content else {
            self.hear(message, now, actions);
            return;
        };
        if let ManagementContent::LifeCycle(wish) = content
            && message.performative == Performative::Request
        {
            if message.sender == self.around.ams {
                self.obey(message, *wish, now, actions);
            }
            return;
        }
        if let Some(PageAsk::Enter(_)) = self.white.hear(now, message) {
            // It was registered as active, whatever state is wanted.
            self.is_suspended = false;
            self.white.changed(true);
        }
        self.yellow.hear(now, message);
    }
}

impl StateMachine for RenderAgent {
    type Content = PlainContent;
    type Value = String;
    type Effect = GiveOrder;
    type Completion = MachineReport;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut RenderActions) {
        match event {
            Event::Message(message) => self.take(&message, now, actions),
            Event::Completed(MachineReport::Seen(machine, job)) => self.see(Some(machine), job),
            Event::Completed(MachineReport::Gone) => self.see(None, None),
            Event::Completed(MachineReport::Silent) => _ = self.silent.get_or_insert(now),
            Event::Completed(MachineReport::Given { ticket, result }) => {
                self.given(ticket, result, actions);
            }
            Event::Start | Event::Deadline | Event::Store { .. } | Event::Presence { .. } => {}
        }
        self.settle(now, actions);
        self.keep_pages(now, actions);
    }

    fn next_deadline(&self) -> Option<Time> {
        let changes = self.changes.iter().map(|change| change.until).min();
        [changes, self.white.next_deadline(), self.yellow.next_deadline()].into_iter().flatten().min()
    }
}

/// Returns the services of a machine.
fn offer(id: &AgentId, machine: &MachineView) -> DfAgentDescription {
    let presence = &machine.presence;
    let property = |name: &str, value| Property { name: name.to_owned(), value };
    let number = |number: u64| Term::Bare(number.to_string());
    let mut properties = vec![
        property("threads", number(presence.threads as u64)),
        property("version", Term::text(&presence.version)),
        property("state", Term::text(presence.standing.word())),
    ];
    properties.extend(presence.job.map(|job| property("job", number(job.into()))));
    described(id, &presence.name, SERVICE_TYPE, &["fipa-request"], properties)
}

/// Returns the yellow page entry of an agent of the farm.
pub(super) fn described(
    id: &AgentId,
    name: &str,
    service_type: &str,
    protocols: &[&str],
    properties: Vec<Property>,
) -> DfAgentDescription {
    let texts = |texts: &[&str]| texts.iter().map(|&text| text.to_owned()).collect::<Vec<String>>();
    let service = ServiceDescription {
        name: Some(name.to_owned()),
        service_type: Some(service_type.to_owned()),
        protocols: texts(protocols),
        ontologies: texts(&[ONTOLOGY]),
        languages: texts(&["fipa-sl0"]),
        ownership: None,
        properties,
    };
    DfAgentDescription {
        name: Some(id.clone()),
        protocols: texts(protocols),
        ontologies: texts(&[ONTOLOGY]),
        languages: texts(&["fipa-sl0"]),
        services: vec![service],
        ..DfAgentDescription::default()
    }
}
