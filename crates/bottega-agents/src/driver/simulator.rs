//! Agents in virtual time, over a network that delays, loses, doubles and cuts, among agents that die and come back.
//!
//! All chance comes from one seed: the same seed gives the same run, event for event. The store is the one thing that
//! does not fail, as it is meant to be in the world; but requests and answers on the way to it may be lost.

use std::{
    collections::{BTreeSet, HashMap},
    fmt::Debug,
    time::Duration,
};

pub use super::network::{Faults, PLANNED_MAX, PRESENCE_TIMEOUT, STORE_TIMEOUT};
use super::{
    network::{Happening, Life, Network, RETRY_AFTER},
    random::Random,
};
use crate::{
    AclMessage, AgentId, Event, EventOf, StateMachine, StoreReply, StoreRequest, Ticket, Time,
    bus::{Beyond, Bus, carry_out},
    store::MemoryStore,
};

/// What answers the effects of agents in a simulation.
pub trait World<M: StateMachine> {
    /// Begins an effect of `agent`; appends what will be reported of it, and after how long. Reports to an agent that
    /// crashes in between are lost.
    fn perform(
        &mut self,
        now: Time,
        agent: &AgentId,
        effect: M::Effect,
        random: &mut Random,
        reports: &mut Vec<(Duration, M::Completion)>,
    );

    /// When something will happen in the world by itself: something of which could not be said how long it takes when it
    /// was begun. `None`: nothing will.
    fn next_change(&self) -> Option<Time> {
        None
    }

    /// What was to happen does; appends what is reported of it, and to whom.
    fn change(&mut self, _now: Time, _reports: &mut Vec<(AgentId, M::Completion)>) {}

    /// An agent is dead: what it had begun is of no use to anybody.
    fn gone(&mut self, _now: Time, _agent: &AgentId) {}
}

impl<M, F> World<M> for F
where
    M: StateMachine,
    F: FnMut(Time, &AgentId, M::Effect, &mut Random, &mut Vec<(Duration, M::Completion)>),
{
    fn perform(
        &mut self,
        now: Time,
        agent: &AgentId,
        effect: M::Effect,
        random: &mut Random,
        reports: &mut Vec<(Duration, M::Completion)>,
    ) {
        self(now, agent, effect, random, reports);
    }
}
struct Node<M> {
    /// Absent while the agent is dead.
    machine: Option<M>,
    make: Box<dyn FnMut() -> M>,
    may_crash: bool,
    /// The timer that is planned.
    timer: Option<Time>,
}

/// Runs machines in virtual time.
pub struct Simulator<M: StateMachine, W> {
    /// A hash map, for speed; what goes through all agents goes by `names`.
    nodes: HashMap<AgentId, Node<M>>,
    names: BTreeSet<AgentId>,
    network: Network<M>,
    world: W,
    /// How often each agent has lived.
    births: u64,
    actions: Vec<crate::ActionOf<M>>,
    /// Kept for its memory; empty between two changes of the world.
    reports: Vec<(AgentId, M::Completion)>,
}

impl<M: StateMachine, W: World<M>> Simulator<M, W>
where
    M::Content: Clone,
    M::Value: Clone,
{
    /// An empty platform in a world that answers effects.
    pub fn new(seed: u64, faults: Faults, world: W) -> Self {
        let network = Network::new(seed, faults);
        Self {
            nodes: HashMap::new(),
            names: BTreeSet::new(),
            network,
            world,
            births: 0,
            actions: Vec::new(),
            reports: Vec::new(),
        }
    }

    /// Adds an agent, made anew at each of its lives. `may_crash`: whether the faults may kill it.
    pub fn add(&mut self, id: &AgentId, may_crash: bool, make: impl FnMut() -> M + 'static) {
        let node = Node { machine: None, make: Box::new(make), may_crash, timer: None };
        let before = self.nodes.insert(id.clone(), node);
        assert!(before.is_none(), "an agent's name is given once");
        self.names.insert(id.clone());
        self.start(id);
    }

    /// Writes down from now on what happens.
    pub fn record_trace(&mut self) {
        self.network.trace = Some(Vec::new());
    }

    /// What was written down, a line for each message, crash, cut and their like; times in milliseconds.
    pub fn trace(&self) -> String {
        self.network.trace.as_ref().map_or_else(String::new, |lines| lines.join("\n"))
    }

    /// The present.
    pub fn now(&self) -> Time {
        self.network.now
    }

    /// The machine of an agent, while it lives.
    pub fn machine(&self, id: &AgentId) -> Option<&M> {
        self.nodes.get(id)?.machine.as_ref()
    }

    /// The store, as it is.
    pub fn store(&self) -> &MemoryStore<M::Value, AgentId> {
        &self.network.store
    }

    /// The world.
    pub fn world(&self) -> &W {
        &self.world
    }

    /// The world, to change something in it. It must not bring forward what it has named as its next change.
    pub fn world_mut(&mut self) -> &mut W {
        &mut self.world
    }

    /// Messages that agents have sent, counted by receiver; those too that were lost.
    pub fn message_count(&self) -> u64 {
        self.network.message_count
    }

    /// Writes an entry into the store at once, as somebody outside of the platform.
    pub fn put(&mut self, key: crate::Key, value: M::Value) {
        self.network.put(key, value);
    }

    /// The bus, to say something from outside.
    pub fn bus(&mut self) -> &mut impl Bus<Content = M::Content, Value = M::Value> {
        &mut self.network
    }

    /// Kills an agent with all it knows. It stays dead until [`Self::start`].
    pub fn crash(&mut self, id: &AgentId) {
        self.end(id, "crashes");
    }

    /// Kills an agent for good.
    pub fn retire(&mut self, id: &AgentId) {
        self.end(id, "is gone");
        self.nodes.remove(id);
        self.names.remove(id);
    }

    fn end(&mut self, id: &AgentId, how: &str) {
        let Some(node) = self.nodes.get_mut(id) else { return };
        if node.machine.take().is_none() {
            return;
        }
        node.timer = None;
        self.network.bury(id, how);
        self.world.gone(self.network.now, id);
    }

    /// Gives a dead agent a new life, without memory.
    pub fn start(&mut self, id: &AgentId) {
        let Some(node) = self.nodes.get_mut(id) else { return };
        if node.machine.is_some() {
            return;
        }
        node.machine = Some((node.make)());
        self.births += 1;
        self.network.lives.insert(id.clone(), Some(self.births));
        self.network.note(|| format!("{id} starts"));
        self.network.tell_presence(id, true);
        self.feed(id, Event::Start);
    }

    /// Parts these agents from all others and from the store, until [`Self::heal`].
    pub fn cut_off(&mut self, agents: impl IntoIterator<Item = AgentId>) {
        self.network.cut_off = agents.into_iter().collect();
        for agent in self.network.cut_off.clone() {
            self.network.note(|| format!("{agent} cut off"));
            self.network.plan(PRESENCE_TIMEOUT, Happening::Silent(agent));
        }
    }

    /// Ends all cuts.
    pub fn heal(&mut self) {
        self.network.note(|| "healed".to_owned());
        for agent in std::mem::take(&mut self.network.cut_off) {
            if self.network.life(&agent).is_some() {
                self.network.tell_presence(&agent, true);
            }
        }
    }

    /// Runs while `going_on` says so, until `end` at the longest or until nothing can happen any more. Returns
    /// whether `going_on` said to stop.
    pub fn run_while(&mut self, end: Time, mut going_on: impl FnMut(&Self) -> bool) -> bool {
        while going_on(self) {
            let change = self.world.next_change().filter(|&at| at <= end);
            if let Some(at) = change.filter(|&at| self.network.next_time().is_none_or(|next| at < next)) {
                self.change(at);
                continue;
            }
            let Some(what) = self.network.next(end) else { return false };
            self.happen(what);
        }
        true
    }

    /// Something happens in the world by itself.
    fn change(&mut self, at: Time) {
        self.network.now = self.network.now.max(at);
        let mut reports = std::mem::take(&mut self.reports);
        self.world.change(at, &mut reports);
        for (agent, completion) in reports.drain(..) {
            self.feed(&agent, Event::Completed(completion));
        }
        self.reports = reports;
        assert!(self.world.next_change().is_none_or(|next| next > at), "the world names a change again that has come");
    }

    /// Runs until `end`.
    pub fn run_until(&mut self, end: Time) {
        self.run_while(end, |_| true);
        self.network.now = self.network.now.max(end);
    }

    fn happen(&mut self, what: Happening<M>) {
        match what {
            Happening::Message { to, message } => self.arrive(&to, message),
            Happening::FromStore { to, ticket, reply } => self.arrive_from_store(&to, ticket, reply),
            Happening::Report { to } => self.arrive_report(to),
            Happening::ToStore { from, ticket, request } => {
                let watch = matches!(request, StoreRequest::Watch { .. });
                if !self.network.is_alive(&from) && watch {
                    return;
                }
                if !self.network.cut_off.contains(&from.agent) {
                    self.network.serve_store(&from, ticket, request);
                } else if watch {
                    self.network.plan(RETRY_AFTER, Happening::ToStore { from, ticket, request });
                }
            }
            Happening::Event { to, event } => {
                if self.network.is_alive(&to) {
                    self.feed(&to.agent, event);
                }
            }
            Happening::Timer { of, at } => {
                let Some(node) = self.nodes.get_mut(&of.agent) else { return };
                if node.timer == Some(at) && self.network.is_alive(&of) {
                    node.timer = None;
                    self.feed(&of.agent, Event::Deadline);
                    let named = self.nodes.get(&of.agent).and_then(|node| node.machine.as_ref()?.next_deadline());
                    assert!(
                        named.is_none_or(|named| named > at),
                        "{} names a deadline again that it was told of",
                        of.agent
                    );
                }
            }
            Happening::CrashSome => self.crash_some(),
            Happening::Restart(id) => self.start(&id),
            Happening::PartitionSome => self.partition_some(),
            Happening::Heal => self.heal(),
            Happening::Silent(id) => {
                if self.network.life(&id).is_none() || self.network.cut_off.contains(&id) {
                    self.network.tell_presence(&id, false);
                }
            }
        }
    }

    fn arrive(&mut self, to: &AgentId, message: AclMessage<M::Content>) {
        let (from, word) = (&message.sender, message.performative);
        let stranger = !self.nodes.contains_key(from);
        if !stranger && self.network.cut_between(from, to) || self.network.life(to).is_none() {
            self.network.note(|| format!("{from} -> {to}  {word} lost"));
            return;
        }
        let conversation = message.conversation_id;
        self.network.note(|| format!("{from} -> {to}  {word} #{conversation}"));
        self.feed(to, Event::Message(message));
    }

    fn arrive_from_store(&mut self, to: &Life, ticket: Ticket, reply: StoreReply<M::Value>) {
        // That it is unavailable the agent finds out by itself.
        let cut = !matches!(reply, StoreReply::Unavailable) && self.network.cut_off.contains(&to.agent);
        if !cut && self.network.is_alive(to) && self.network.open.remove(&(to.number, ticket)) {
            self.feed(&to.agent, Event::Store { ticket, reply });
        }
    }

    fn arrive_report(&mut self, to: Life) {
        if !self.network.is_alive(&to) {
            return;
        }
        if self.network.cut_off.contains(&to.agent) {
            self.network.plan(RETRY_AFTER, Happening::Report { to });
            return;
        }
        let next = self.network.reports.get_mut(&to.agent).and_then(std::collections::VecDeque::pop_front);
        let (ticket, reply) = next.expect("a report is planned for each that is on its way");
        self.feed(&to.agent, Event::Store { ticket, reply });
    }

    fn crash_some(&mut self) {
        let Some(mean) = self.network.faults.crash_every else { return };
        if !self.network.faulty() {
            return;
        }
        let is_mortal =
            |id: &&AgentId| self.nodes.get(*id).is_some_and(|node| node.may_crash && node.machine.is_some());
        let mortal: Vec<AgentId> = self.names.iter().filter(is_mortal).cloned().collect();
        if !mortal.is_empty() {
            let id = mortal[self.network.random.below(mortal.len())].clone();
            self.crash(&id);
            let down = self.network.faults.down_max.mul_f64(self.network.random.unit());
            self.network.plan(down, Happening::Restart(id));
        }
        let after = self.network.around(mean);
        self.network.plan(after, Happening::CrashSome);
    }

    fn partition_some(&mut self) {
        let Some(mean) = self.network.faults.partition_every else { return };
        if !self.network.faulty() {
            return;
        }
        let mut parted = Vec::new();
        for id in &self.names {
            if self.network.random.unit() < 0.3 {
                parted.push(id.clone());
            }
        }
        self.heal();
        self.cut_off(parted);
        let lasts = self.network.faults.partition_max.mul_f64(self.network.random.unit());
        self.network.plan(lasts, Happening::Heal);
        let after = self.network.around(mean);
        self.network.plan(after, Happening::PartitionSome);
    }

    /// Gives a living agent an event and carries out what it wants.
    fn feed(&mut self, id: &AgentId, event: EventOf<M>) {
        let Some(node) = self.nodes.get_mut(id) else { return };
        let Some(machine) = node.machine.as_mut() else { return };
        let now = self.network.now;
        machine.handle(now, event, &mut self.actions);
        let mut stopped = false;
        for action in self.actions.drain(..) {
            match carry_out(&mut self.network, id, action) {
                Some(Beyond::Effect(effect)) => {
                    let mut reports = Vec::new();
                    self.world.perform(now, id, effect, &mut self.network.random, &mut reports);
                    for (after, completion) in reports {
                        if let Some(to) = self.network.life(id) {
                            self.network.plan(after, Happening::Event { to, event: Event::Completed(completion) });
                        }
                    }
                }
                Some(Beyond::Stop) => stopped = true,
                None => {}
            }
        }
        if stopped {
            self.end(id, "stops");
            return;
        }
        let deadline = machine.next_deadline();
        if deadline != node.timer {
            node.timer = deadline;
            if let (Some(at), Some(of)) = (deadline, self.network.life(id)) {
                self.network.plan_at(at.max(now), Happening::Timer { of, at });
            }
        }
    }
}

impl<M: StateMachine, W: Debug> Debug for Simulator<M, W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Simulator").field("now", &self.network.now).field("world", &self.world).finish_non_exhaustive()
    }
}
