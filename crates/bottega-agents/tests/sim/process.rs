//! A process of a platform as one machine of the simulator: its agents talk to each other as on threads, without loss and in
//! order, die together, and reach others through their gateway alone.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    time::Duration,
};

use bottega_agents::{
    AclMessage, Action, ActionOf, AgentId, BoxedMachine, Entry, Event, EventOf, Key, StateMachine, StoreReply,
    StoreRequest, Ticket, Time,
    gateway::{ChannelEffect, ChannelReport, PlainContent},
};

/// An agent of a process.
pub(crate) type Inner = BoxedMachine<PlainContent, String, ChannelEffect, ChannelReport>;

/// The effects of a process on the world.
pub(crate) enum Deed {
    /// The process listens for connections.
    Up,
    /// The gateway sends a message.
    Channel(ChannelEffect),
}

struct Member {
    id: AgentId,
    machine: Option<Inner>,
    deadline: Option<Time>,
}

type InnerEvent = Event<PlainContent, String, ChannelReport>;

pub(crate) struct Process {
    /// The gateway is the first.
    members: Vec<Member>,
    index: BTreeMap<AgentId, usize>,
    mail: VecDeque<(usize, InnerEvent)>,
    /// Requests to the store, with the requesting agent and its ticket.
    requests: BTreeMap<Ticket, (usize, Ticket)>,
    /// The next ticket, greater than all of the previous life.
    first_ticket: u64,
    watchers: BTreeSet<usize>,
    /// The prefix of this platform's keys: all platforms of a simulation share one store.
    folder: String,
}

const GATEWAY: usize = 0;
const AT_LEAST: Duration = Duration::from_millis(1);

impl Process {
    /// - `agents`: the gateway first.
    pub(crate) fn new(platform: &str, agents: Vec<(AgentId, Inner)>) -> Self {
        let index = agents.iter().enumerate().map(|(number, (id, _))| (id.clone(), number)).collect();
        let member = |(id, machine)| Member { id, machine: Some(machine), deadline: None };
        let members = agents.into_iter().map(member).collect();
        let (mail, requests, watchers) = (VecDeque::new(), BTreeMap::new(), BTreeSet::from([GATEWAY]));
        Self { members, index, mail, requests, first_ticket: 0, watchers, folder: format!("{platform}:") }
    }

    fn is_here(&self, agent: usize) -> bool {
        self.members[agent].machine.is_some()
    }

    fn publish(&mut self, message: AclMessage<PlainContent>) {
        let mut elsewhere = Vec::new();
        for receiver in &message.receivers {
            match self.index.get(receiver) {
                Some(&to) if to != GATEWAY && self.is_here(to) => {
                    self.mail.push_back((to, Event::Message(message.clone())));
                }
                _ => elsewhere.push(receiver.clone()),
            }
        }
        if !elsewhere.is_empty() {
            self.mail.push_back((GATEWAY, Event::Message(AclMessage { receivers: elsewhere, ..message })));
        }
    }

    fn tell_presence(&mut self, agent: usize, present: bool) {
        for &watcher in self.watchers.iter().filter(|watcher| **watcher != agent) {
            let event = Event::Presence { agent: self.members[agent].id.clone(), present };
            self.mail.push_back((watcher, event));
        }
    }

    fn carry_out(
        &mut self,
        agent: usize,
        action: Action<PlainContent, String, ChannelEffect>,
        actions: &mut Vec<ActionOf<Self>>,
    ) {
        match action {
            Action::Send(message) => self.publish(message),
            Action::Store { ticket, request } => {
                let own = Ticket(self.first_ticket + self.requests.len() as u64);
                self.requests.insert(own, (agent, ticket));
                actions.push(Action::Store { ticket: own, request: self.within(request) });
            }
            Action::Effect(effect) => actions.push(Action::Effect(Deed::Channel(effect))),
            Action::WatchPresence => {
                self.watchers.insert(agent);
                for other in (0..self.members.len()).filter(|other| *other != agent) {
                    if self.is_here(other) {
                        let event = Event::Presence { agent: self.members[other].id.clone(), present: true };
                        self.mail.push_back((agent, event));
                    }
                }
            }
            Action::Stop => {
                self.members[agent].machine = None;
                self.tell_presence(agent, false);
            }
            Action::Enqueue { .. } | Action::JoinQueue(_) => unreachable!("nobody on a platform has queues"),
        }
    }

    fn within(&self, request: StoreRequest<String>) -> StoreRequest<String> {
        use StoreRequest as S;
        let own = |key: Key| Key::from(format!("{}{key}", self.folder));
        match request {
            S::Get { key } => S::Get { key: own(key) },
            S::Put { key, value } => S::Put { key: own(key), value },
            S::CompareAndSet { key, expected_revision, value } => {
                S::CompareAndSet { key: own(key), expected_revision, value }
            }
            S::Watch { prefix } => S::Watch { prefix: own(prefix) },
        }
    }

    fn without(&self, reply: StoreReply<String>) -> StoreReply<String> {
        use StoreReply as R;
        let key = |key: Key| Key::from(key.to_string().split_off(self.folder.len()));
        let entry = |entry: Entry<String>| Entry { key: key(entry.key), ..entry };
        match reply {
            R::Got { key: of, entry: found } => R::Got { key: key(of), entry: found.map(entry) },
            R::Written { key: of, revision } => R::Written { key: key(of), revision },
            R::Conflict { key: of, entry: found } => R::Conflict { key: key(of), entry: found.map(entry) },
            R::Changed(found) => R::Changed(entry(found)),
            R::CaughtUp => R::CaughtUp,
            R::Unavailable => R::Unavailable,
        }
    }

    fn start(&mut self, actions: &mut Vec<ActionOf<Self>>) {
        actions.push(Action::Effect(Deed::Up));
        for agent in 0..self.members.len() {
            self.mail.push_back((agent, Event::Start));
            if agent != GATEWAY {
                let event = Event::Presence { agent: self.members[agent].id.clone(), present: true };
                self.mail.push_back((GATEWAY, event));
            }
        }
    }
}

impl StateMachine for Process {
    type Content = PlainContent;
    type Value = String;
    type Effect = Deed;
    type Completion = ChannelReport;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Start => {
                self.first_ticket = now.elapsed().as_nanos() as u64;
                self.start(actions);
            }
            Event::Completed(report) => self.mail.push_back((GATEWAY, Event::Completed(report))),
            Event::Store { ticket, reply } => {
                // Ignore answers to requests of the previous life.
                let Some(&(agent, ticket)) = self.requests.get(&ticket) else { return };
                self.mail.push_back((agent, Event::Store { ticket, reply: self.without(reply) }));
            }
            Event::Deadline => {
                let due = |(agent, member): (usize, &Member)| member.deadline.filter(|at| *at <= now).map(|_| agent);
                let due: Vec<usize> = self.members.iter().enumerate().filter_map(due).collect();
                self.mail.extend(due.into_iter().map(|agent| (agent, Event::Deadline)));
            }
            Event::Message(message) => self.publish(message),
            Event::Presence { .. } => {}
        }
        let mut wanted = Vec::new();
        while let Some((agent, event)) = self.mail.pop_front() {
            let Some(machine) = &mut self.members[agent].machine else { continue };
            machine.handle(now, event, &mut wanted);
            // A deadline that is over was just answered.
            self.members[agent].deadline = machine.next_deadline().map(|at| at.max(now + AT_LEAST));
            for action in wanted.drain(..) {
                self.carry_out(agent, action, actions);
            }
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.members.iter().filter(|member| member.machine.is_some()).filter_map(|member| member.deadline).min()
    }
}
