//! The simulator: agents in virtual time, over a network with delays, loss, duplication and partitions, with crashes
//! and restarts.
//!
//! All random numbers come from one seed: the same seed gives the same run, event for event. The store itself does not
//! fail, as in reality; but requests and replies may be lost.

use std::{fmt::Debug, time::Duration};

pub use super::{
    network::{Faults, PLANNED_MAX, PRESENCE_TIMEOUT},
    plan::{NodeId, STORE_TIMEOUT},
};
use super::{
    network::{Network, RETRY_AFTER},
    plan::{Happening, Life, RequestId},
    random::Random,
};
use crate::{
    AclMessage, Action, AgentId, Event, EventOf, StateMachine, StoreReply, StoreRequest, Ticket, Time, bus::Bus,
    store::MemoryStore,
};

/// The world of a simulation, which executes the effects of agents.
pub trait World<M: StateMachine> {
    /// Begins an effect of `agent`. Completions for an agent that crashes meanwhile are lost.
    ///
    /// - `random`: the random numbers of the simulation.
    /// - `reports`: gets the completions of the effect, each with its delay from `now`.
    fn perform(
        &mut self,
        now: Time,
        agent: &AgentId,
        effect: M::Effect,
        random: &mut Random,
        reports: &mut Vec<(Duration, M::Completion)>,
    );

    /// Returns the time of the world's next own event, for effects of unknown duration. `None`: there is none.
    fn next_change(&self) -> Option<Time> {
        None
    }

    /// Executes the event announced by [`Self::next_change`], whose next one must be later.
    ///
    /// - `_reports`: gets completions, each with the agent that receives it.
    fn change(&mut self, _now: Time, _reports: &mut Vec<(AgentId, M::Completion)>) {}

    /// Notes that an agent has crashed, stopped or been removed: completions of its effects are lost.
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
struct SimulatedAgent<M> {
    /// `None` while the agent is down.
    machine: Option<M>,
    make: Box<dyn FnMut() -> M>,
    may_crash: bool,
    /// The deadline that the agent has set.
    deadline: Option<Time>,
    /// The time of the agent's next timer, not later than the deadline. An early timer is set again, because most deadlines are
    /// postponed before they arrive.
    timer: Option<Time>,
}

/// A simulator of the state machines `M` in virtual time; their effects are executed by the [`World`] `W`.
pub struct Simulator<M: StateMachine, W> {
    /// By [`NodeId`]. `None`: never added, or retired.
    nodes: Vec<Option<SimulatedAgent<M>>>,
    network: Network<M>,
    world: W,
    /// Number of lives started so far.
    births: u32,
    /// Scratch space, kept to avoid allocations.
    actions: Vec<crate::ActionOf<M>>,
    reports: Vec<(AgentId, M::Completion)>,
    begun: Vec<(Duration, M::Completion)>,
}

impl<M: StateMachine, W: World<M>> Simulator<M, W>
where
    M::Content: Clone,
    M::Value: Clone,
{
    /// Makes a simulation without agents, at time zero.
    ///
    /// - `seed`: the seed of all randomness; the same seed gives the same run.
    /// - `world`: executes the agents' effects.
    pub fn new(seed: u64, faults: Faults, world: W) -> Self {
        let network = Network::new(seed, faults);
        Self {
            nodes: Vec::new(),
            network,
            world,
            births: 0,
            actions: Vec::new(),
            reports: Vec::new(),
            begun: Vec::new(),
        }
    }

    fn node(&self, node: NodeId) -> Option<&SimulatedAgent<M>> {
        self.nodes.get(node.index())?.as_ref()
    }

    fn node_mut(&mut self, node: NodeId) -> Option<&mut SimulatedAgent<M>> {
        self.nodes.get_mut(node.index())?.as_mut()
    }

    /// Returns all agents that are not retired.
    fn all(&self) -> impl Iterator<Item = (NodeId, &SimulatedAgent<M>)> {
        let numbered = self.nodes.iter().enumerate();
        numbered.filter_map(|(index, node)| Some((NodeId(index as u32), node.as_ref()?)))
    }

    /// Adds an agent and starts it.
    ///
    /// - `may_crash`: true if the faults of the simulation may crash it.
    /// - `make`: makes its machine, at each start.
    ///
    /// # Panics
    /// If an agent of this name was added before and is not retired.
    pub fn add(&mut self, id: &AgentId, may_crash: bool, make: impl FnMut() -> M + 'static) {
        let node = self.network.node(id);
        assert!(self.node(node).is_none(), "an agent's name is given once");
        self.nodes.resize_with(self.nodes.len().max(node.index() + 1), || None);
        let make = Box::new(make);
        self.nodes[node.index()] = Some(SimulatedAgent { machine: None, make, may_crash, deadline: None, timer: None });
        self.begin(node);
    }

    /// Records a trace from now on, which [`Self::trace`] returns.
    pub fn record_trace(&mut self) {
        self.network.trace = Some(Vec::new());
    }

    /// Returns the recorded trace: a line per message, crash, partition and similar, with times in milliseconds. Empty
    /// unless [`Self::record_trace`] was called.
    pub fn trace(&self) -> String {
        self.network.trace.as_ref().map_or_else(String::new, |lines| lines.join("\n"))
    }

    /// Returns the current virtual time.
    pub fn now(&self) -> Time {
        self.network.now
    }

    /// Returns the machine of an agent; `None`: the agent is down or unknown.
    pub fn machine(&self, id: &AgentId) -> Option<&M> {
        self.node(self.network.known(id)?)?.machine.as_ref()
    }

    /// Returns the store of the simulated platform; its clients are identified by [`NodeId`].
    pub fn store(&self) -> &MemoryStore<M::Value, NodeId> {
        &self.network.store
    }

    /// Returns the world in which the agents act.
    pub fn world(&self) -> &W {
        &self.world
    }

    /// Returns the world, mutable. Its next event must not become earlier than announced.
    pub fn world_mut(&mut self) -> &mut W {
        &mut self.world
    }

    /// Returns the number of messages sent so far, counted once per receiver, including lost ones.
    pub fn message_count(&self) -> u64 {
        self.network.message_count
    }

    /// Writes an entry into the store immediately, from outside of the platform.
    pub fn put(&mut self, key: crate::Key, value: M::Value) {
        self.network.put(key, value);
    }

    /// Returns the bus, for messages from outside.
    pub fn bus(&mut self) -> &mut impl Bus<Content = M::Content, Value = M::Value> {
        &mut self.network
    }

    /// Crashes an agent, if it runs: it loses its memory, and stays down until [`Self::start`].
    pub fn crash(&mut self, id: &AgentId) {
        if let Some(node) = self.network.known(id) {
            self.end(node, "crashes");
        }
    }

    /// Removes an agent permanently; its name may be added again. Does nothing if it is unknown.
    pub fn retire(&mut self, id: &AgentId) {
        let Some(node) = self.network.known(id) else { return };
        self.end(node, "is gone");
        if let Some(node) = self.nodes.get_mut(node.index()) {
            *node = None;
        }
    }

    fn end(&mut self, id: NodeId, how: &str) {
        let Some(node) = self.node_mut(id) else { return };
        if node.machine.take().is_none() {
            return;
        }
        (node.deadline, node.timer) = (None, None);
        self.network.bury(id, how);
        self.world.gone(self.network.now, self.network.name(id));
    }

    /// Starts an agent that is down, without memory. Does nothing if it runs or is unknown.
    pub fn start(&mut self, id: &AgentId) {
        if let Some(node) = self.network.known(id) {
            self.begin(node);
        }
    }

    fn begin(&mut self, id: NodeId) {
        let Some(node) = self.node_mut(id) else { return };
        if node.machine.is_some() {
            return;
        }
        node.machine = Some((node.make)());
        self.births += 1;
        self.network.bear(id, self.births);
        self.feed(id, Event::Start);
    }

    /// Separates these agents from all others and from the store, until [`Self::heal`] or a partition by the faults;
    /// replaces an earlier partition.
    pub fn cut_off(&mut self, agents: impl IntoIterator<Item = AgentId>) {
        let parted = agents.into_iter().map(|agent| self.network.node(&agent)).collect();
        self.part(parted);
    }

    fn part(&mut self, parted: Vec<NodeId>) {
        self.network.cut_off = parted.into_iter().collect();
        for node in self.network.cut_off.clone() {
            self.network.note(|names| format!("{} cut off", names[node.index()]));
            self.network.plan(PRESENCE_TIMEOUT, Happening::Silent(node));
        }
    }

    /// Ends the partition of the network, if there is one.
    pub fn heal(&mut self) {
        self.network.note(|_| "healed".to_owned());
        for node in std::mem::take(&mut self.network.cut_off) {
            if self.network.life(node).is_some() {
                self.network.tell_presence(node, true);
            }
        }
    }

    /// Runs while `going_on` returns true, at most until `end` or until no events are left. Returns true if `going_on`
    /// stopped it.
    ///
    /// # Panics
    /// If a machine has handled a deadline and names one that is not later, or the world does after an event of its
    /// own.
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

    /// Executes an event of the world.
    fn change(&mut self, at: Time) {
        self.network.now = self.network.now.max(at);
        let mut reports = std::mem::take(&mut self.reports);
        self.world.change(at, &mut reports);
        for (agent, completion) in reports.drain(..) {
            if let Some(node) = self.network.known(&agent) {
                self.feed(node, Event::Completed(completion));
            }
        }
        self.reports = reports;
        assert!(self.world.next_change().is_none_or(|next| next > at), "the world names a change again that has come");
    }

    /// Runs all events up to `end`, which is the current time afterwards.
    ///
    /// # Panics
    /// As for [`Self::run_while`].
    pub fn run_until(&mut self, end: Time) {
        self.run_while(end, |_| true);
        self.network.now = self.network.now.max(end);
    }

    fn happen(&mut self, what: Happening<M>) {
        match what {
            Happening::Message { to, message } => self.arrive(to, message),
            Happening::FromStore { to, request, ticket, reply } => self.arrive_from_store(to, request, ticket, reply),
            Happening::Report { to } => self.arrive_report(to),
            Happening::ToStore { from, id, ticket, request } => {
                let watch = matches!(request, StoreRequest::Watch { .. });
                if watch && !self.network.is_alive(from) {
                    return;
                }
                if !self.network.is_cut_off(from.node) {
                    self.network.serve_store(from, id, ticket, request);
                } else if watch {
                    self.network.plan(RETRY_AFTER, Happening::ToStore { from, id, ticket, request });
                }
            }
            Happening::Event { to, event } => {
                if self.network.is_alive(to) {
                    self.feed(to.node, event);
                }
            }
            Happening::Timer { of } => self.ring(of),
            Happening::CrashSome => self.crash_some(),
            Happening::Restart(node) => self.begin(node),
            Happening::PartitionSome => self.partition_some(),
            Happening::Heal => self.heal(),
            Happening::Silent(node) => {
                if self.network.life(node).is_none() || self.network.is_cut_off(node) {
                    self.network.tell_presence(node, false);
                }
            }
        }
    }

    fn arrive(&mut self, to: NodeId, message: AclMessage<M::Content>) {
        let cut = !self.network.cut_off.is_empty()
            && self.network.known(&message.sender).is_some_and(|from| {
                let stranger = self.node(from).is_none();
                !stranger && self.network.cut_between(from, to)
            });
        let lost = cut || self.network.life(to).is_none();
        self.network.note(|names| {
            let (from, to, word) = (&message.sender, &names[to.index()], message.performative);
            let conversation = message.conversation_id;
            if lost {
                format!("{from} -> {to}  {word} lost")
            } else {
                format!("{from} -> {to}  {word} #{conversation}")
            }
        });
        if !lost {
            self.feed(to, Event::Message(message));
        }
    }

    fn arrive_from_store(&mut self, to: Life, request: RequestId, ticket: Ticket, reply: StoreReply<M::Value>) {
        // A timeout of the store is detected by the agent itself
        let cut = !matches!(reply, StoreReply::Unavailable) && self.network.is_cut_off(to.node);
        if !cut && self.network.plan.close_request(request) && self.network.is_alive(to) {
            self.feed(to.node, Event::Store { ticket, reply });
        }
    }

    fn arrive_report(&mut self, to: Life) {
        if !self.network.is_alive(to) {
            return;
        }
        if self.network.is_cut_off(to.node) {
            self.network.plan(RETRY_AFTER, Happening::Report { to });
            return;
        }
        let (ticket, reply) = self.network.next_report(to.node).expect("a report is planned for each on its way");
        self.feed(to.node, Event::Store { ticket, reply });
    }

    /// Handles a timer, which may be early.
    fn ring(&mut self, id: NodeId) {
        let now = self.network.now;
        let Some(node) = self.node_mut(id).filter(|node| node.timer == Some(now)) else { return };
        node.timer = None;
        if node.deadline.is_some_and(|deadline| deadline <= now) {
            node.deadline = None;
            self.feed(id, Event::Deadline);
            let named = self.node(id).and_then(|node| node.machine.as_ref()?.next_deadline());
            assert!(
                named.is_none_or(|named| named > now),
                "{} names a deadline that has passed",
                self.network.name(id)
            );
        } else {
            self.set_timer(id);
        }
    }

    /// Ensures a timer at the agent's deadline or before.
    fn set_timer(&mut self, id: NodeId) {
        let now = self.network.now;
        let Some(node) = self.node_mut(id) else { return };
        let at = node.deadline.map(|deadline| deadline.max(now));
        if let Some(at) = at.filter(|at| node.timer.is_none_or(|timer| *at < timer)) {
            node.timer = Some(at);
            self.network.plan_at(at, Happening::Timer { of: id });
        }
    }

    fn crash_some(&mut self) {
        let Some(mean) = self.network.faults.crash_every else { return };
        if !self.network.faulty() {
            return;
        }
        let is_mortal = |(_, node): &(NodeId, &SimulatedAgent<M>)| node.may_crash && node.machine.is_some();
        let mortal: Vec<NodeId> = self.all().filter(is_mortal).map(|(id, _)| id).collect();
        if !mortal.is_empty() {
            let id = mortal[self.network.random.below(mortal.len())];
            self.end(id, "crashes");
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
        let mut parted: Vec<NodeId> = self.all().map(|(id, _)| id).collect();
        parted.retain(|_| self.network.random.unit() < 0.3);
        self.heal();
        self.part(parted);
        let lasts = self.network.faults.partition_max.mul_f64(self.network.random.unit());
        self.network.plan(lasts, Happening::Heal);
        let after = self.network.around(mean);
        self.network.plan(after, Happening::PartitionSome);
    }

    /// Passes an event to a running agent and executes its actions.
    fn feed(&mut self, id: NodeId, event: EventOf<M>) {
        let Some(node) = self.nodes.get_mut(id.index()).and_then(Option::as_mut) else { return };
        let Some(machine) = node.machine.as_mut() else { return };
        let now = self.network.now;
        machine.handle(now, event, &mut self.actions);
        node.deadline = machine.next_deadline();
        let (deadline, timer) = (node.deadline, node.timer);
        let mut stopped = false;
        let mut actions = std::mem::take(&mut self.actions);
        for action in actions.drain(..) {
            stopped |= self.carry_out(id, action);
        }
        self.actions = actions;
        if stopped {
            self.end(id, "stops");
        } else if deadline.is_some_and(|deadline| timer.is_none_or(|timer| deadline < timer)) {
            self.set_timer(id);
        }
    }

    /// Executes an action. Returns true if the agent has ended.
    fn carry_out(&mut self, id: NodeId, action: crate::ActionOf<M>) -> bool {
        match action {
            Action::Send(message) => self.network.publish(message),
            Action::Store { ticket, request } => self.network.ask(id, ticket, request),
            Action::Effect(effect) => self.perform(id, effect),
            Action::Stop => return true,
            Action::Enqueue { queue, message } => self.network.enqueue(&queue, message),
            Action::JoinQueue(queue) => {
                let name = self.network.name(id).clone();
                self.network.join(&queue, &name);
            }
            Action::WatchPresence => {
                let name = self.network.name(id).clone();
                self.network.watch_presence(&name);
            }
        }
        false
    }

    fn perform(&mut self, id: NodeId, effect: M::Effect) {
        let (now, name) = (self.network.now, &self.network.names[id.index()]);
        self.world.perform(now, name, effect, &mut self.network.random, &mut self.begun);
        let Some(to) = self.network.life(id) else { return self.begun.clear() };
        for (after, completion) in self.begun.drain(..) {
            self.network.plan(after, Happening::Event { to, event: Event::Completed(completion) });
        }
    }
}

impl<M: StateMachine, W: Debug> Debug for Simulator<M, W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Simulator").field("now", &self.network.now).field("world", &self.world).finish_non_exhaustive()
    }
}
