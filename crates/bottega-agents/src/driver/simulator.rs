//! Agents in virtual time, over a network that delays, loses, doubles and cuts, among agents that die and come back.
//!
//! All chance comes from one seed: the same seed gives the same run, event for event. The store is the one thing that
//! does not fail, as it is meant to be in the world; but requests and answers on the way to it may be lost.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, BinaryHeap},
    fmt::Debug,
    time::Duration,
};

use super::{queues::Queues, random::Random};
use crate::{
    AclMessage, AgentId, Event, EventOf, Key, StateMachine, StoreReply, StoreRequest, Ticket, Time,
    bus::{Beyond, Blob, BlobId, Bus, carry_out},
    store::{Addressed, MemoryStore},
};

/// After so long without an answer of the store it counts as unavailable.
pub const STORE_TIMEOUT: Duration = Duration::from_secs(2);

/// After so long without a sign of life an agent counts as gone.
pub const PRESENCE_TIMEOUT: Duration = Duration::from_secs(3);

/// How long a cut holds back what must arrive in order, before it is tried again.
const RETRY_AFTER: Duration = Duration::from_millis(50);

/// What goes wrong, and how often. [`Faults::NONE`] is a fast and faithful network.
#[derive(Clone, Debug, PartialEq)]
pub struct Faults {
    /// The shortest time a message takes.
    pub latency_min: Duration,
    /// What is added to it on the average; a few take five times as long, so that messages overtake each other.
    pub latency_extra_mean: Duration,
    /// Share of messages that are lost, 0..1.
    pub loss: f64,
    /// Share of messages that arrive twice, 0..1.
    pub duplication: f64,
    /// Mean time between two crashes of an agent, over all agents that may crash.
    pub crash_every: Option<Duration>,
    /// The longest time an agent stays dead.
    pub down_max: Duration,
    /// Mean time between two cuts that part some agents from the others and from the store.
    pub partition_every: Option<Duration>,
    /// The longest time a cut lasts.
    pub partition_max: Duration,
    /// From here on nothing more goes wrong, so that a run can end. Latency stays.
    pub until: Time,
}

impl Faults {
    /// Nothing goes wrong; a message takes a millisecond.
    pub const NONE: Self = Self {
        latency_min: Duration::from_millis(1),
        latency_extra_mean: Duration::ZERO,
        loss: 0.0,
        duplication: 0.0,
        crash_every: None,
        down_max: Duration::ZERO,
        partition_every: None,
        partition_max: Duration::ZERO,
        until: Time::ZERO,
    };
}

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

/// Which life of which agent: what was meant for an earlier life is lost.
#[derive(Clone, Debug, PartialEq)]
struct Life {
    agent: AgentId,
    number: u64,
}

enum Happening<M: StateMachine> {
    /// A message arrives; the sender decides whether a cut lies between.
    Message {
        to: AgentId,
        message: AclMessage<M::Content>,
    },
    /// Something arrives that is never lost on the way: held back by a cut, in order.
    FromStore {
        to: Life,
        ticket: Ticket,
        reply: StoreReply<M::Value>,
    },
    ToStore {
        from: Life,
        ticket: Ticket,
        request: StoreRequest<M::Value>,
    },
    Event {
        to: Life,
        event: EventOf<M>,
    },
    Timer {
        of: Life,
        at: Time,
    },
    /// Some agent that may crash does.
    CrashSome,
    Restart(AgentId),
    PartitionSome,
    Heal,
    /// Whether an agent that was silent still is.
    Silent(AgentId),
}

struct Scheduled<M: StateMachine> {
    at: Time,
    /// Of two things at one time the one that was planned first happens first.
    sequence: u64,
    what: Happening<M>,
}

impl<M: StateMachine> PartialEq for Scheduled<M> {
    fn eq(&self, other: &Self) -> bool {
        self.sequence == other.sequence
    }
}
impl<M: StateMachine> Eq for Scheduled<M> {}
impl<M: StateMachine> PartialOrd for Scheduled<M> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl<M: StateMachine> Ord for Scheduled<M> {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (self.at, self.sequence).cmp(&(other.at, other.sequence))
    }
}

/// An open request to the store and when its asker gives up on it.
type OpenRequest = (AgentId, u64, Ticket);

/// All but the machines: what the bus of a simulation is made of.
struct Network<M: StateMachine> {
    now: Time,
    sequence: u64,
    plan: BinaryHeap<Reverse<Scheduled<M>>>,
    random: Random,
    faults: Faults,
    store: MemoryStore<M::Value, AgentId>,
    queues: Queues<M::Content>,
    blobs: BTreeMap<BlobId, Blob>,
    /// The life of each agent; `None` while it is dead.
    lives: BTreeMap<AgentId, Option<u64>>,
    /// Agents on the far side of the cut; the store is on the near one.
    cut_off: BTreeSet<AgentId>,
    /// When the last answer of the store to an agent arrives: answers do not overtake each other.
    store_line: BTreeMap<AgentId, Time>,
    open: BTreeSet<OpenRequest>,
    presence_watchers: BTreeSet<AgentId>,
    seen_present: BTreeSet<AgentId>,
    trace: Option<Vec<String>>,
}

impl<M: StateMachine> Network<M> {
    fn plan(&mut self, after: Duration, what: Happening<M>) {
        self.plan_at(self.now + after, what);
    }

    fn plan_at(&mut self, at: Time, what: Happening<M>) {
        self.sequence += 1;
        self.plan.push(Reverse(Scheduled { at, sequence: self.sequence, what }));
    }

    fn faulty(&self) -> bool {
        self.now < self.faults.until
    }

    fn chance(&mut self, share: f64) -> bool {
        self.faulty() && self.random.unit() < share
    }

    fn latency(&mut self) -> Duration {
        // u⁴ has the mean 1/5: most messages are quick, some are late.
        let u = self.random.unit();
        self.faults.latency_min + self.faults.latency_extra_mean.mul_f64(5.0 * u * u * u * u)
    }

    /// A random time with the given mean.
    fn around(&mut self, mean: Duration) -> Duration {
        mean.mul_f64(2.0 * self.random.unit())
    }

    fn cut_between(&self, a: &AgentId, b: &AgentId) -> bool {
        self.cut_off.contains(a) != self.cut_off.contains(b)
    }

    fn life(&self, agent: &AgentId) -> Option<Life> {
        let number = (*self.lives.get(agent)?)?;
        Some(Life { agent: agent.clone(), number })
    }

    fn is_alive(&self, life: &Life) -> bool {
        self.lives.get(&life.agent) == Some(&Some(life.number))
    }

    fn note(&mut self, line: impl FnOnce() -> String) {
        if let Some(trace) = &mut self.trace {
            let micros = self.now.elapsed().as_micros();
            trace.push(format!("{:>9}.{:03} {}", micros / 1000, micros % 1000, line()));
        }
    }

    fn tell_presence(&mut self, agent: &AgentId, present: bool) {
        let changed = if present { self.seen_present.insert(agent.clone()) } else { self.seen_present.remove(agent) };
        if !changed {
            return;
        }
        for watcher in self.presence_watchers.clone() {
            if watcher != *agent
                && let Some(to) = self.life(&watcher)
            {
                let after = self.latency();
                self.plan(after, Happening::Event { to, event: Event::Presence { agent: agent.clone(), present } });
            }
        }
    }

    fn reply_from_store(&mut self, to: &AgentId, ticket: Ticket, reply: StoreReply<M::Value>) {
        let Some(to) = self.life(to) else { return };
        let earliest = self.store_line.get(&to.agent).copied().unwrap_or_default();
        let at = (self.now + self.latency()).max(earliest);
        self.store_line.insert(to.agent.clone(), at);
        self.plan_at(at, Happening::FromStore { to, ticket, reply });
    }

    fn serve_store(&mut self, from: &Life, ticket: Ticket, request: StoreRequest<M::Value>)
    where
        M::Value: Clone,
    {
        let mut replies = Vec::new();
        self.store.handle(from.agent.clone(), ticket, request, &mut replies);
        for Addressed { to, ticket, reply } in replies {
            // An answer may be lost, a report of a watch is sent again by the store until it arrives.
            let report = matches!(reply, StoreReply::Changed(_) | StoreReply::CaughtUp);
            let loss = self.faults.loss;
            if report || !self.chance(loss) {
                self.reply_from_store(&to, ticket, reply);
            }
        }
    }
}

impl<M: StateMachine> Bus for Network<M>
where
    M::Content: Clone,
    M::Value: Clone,
{
    type Content = M::Content;
    type Value = M::Value;

    fn publish(&mut self, message: AclMessage<M::Content>) {
        for to in message.receivers.clone() {
            let (loss, duplication) = (self.faults.loss, self.faults.duplication);
            if self.chance(loss) {
                self.note(|| format!("{} -> {to}  {} lost", message.sender, message.performative));
                continue;
            }
            let copies = if self.chance(duplication) { 2 } else { 1 };
            for _ in 0..copies {
                let after = self.latency();
                self.plan(after, Happening::Message { to: to.clone(), message: message.clone() });
            }
        }
    }

    fn enqueue(&mut self, queue: &Key, message: AclMessage<M::Content>) {
        if let Some(message) = self.queues.enqueue(queue, message) {
            self.publish(message);
        }
    }

    fn join(&mut self, queue: &Key, agent: &AgentId) {
        for message in self.queues.join(queue, agent) {
            self.publish(message);
        }
    }

    fn ask_store(&mut self, from: &AgentId, ticket: Ticket, request: StoreRequest<M::Value>) {
        let Some(from) = self.life(from) else { return };
        if !matches!(request, StoreRequest::Watch { .. }) {
            self.open.insert((from.agent.clone(), from.number, ticket));
            self.plan(STORE_TIMEOUT, Happening::FromStore { to: from.clone(), ticket, reply: StoreReply::Unavailable });
        }
        let loss = self.faults.loss;
        if matches!(request, StoreRequest::Watch { .. }) || !self.chance(loss) {
            let after = self.latency();
            self.plan(after, Happening::ToStore { from, ticket, request });
        }
    }

    fn watch_presence(&mut self, from: &AgentId) {
        self.presence_watchers.insert(from.clone());
        let Some(to) = self.life(from) else { return };
        for agent in self.seen_present.clone() {
            if agent != *from {
                let after = self.latency();
                let event = Event::Presence { agent, present: true };
                self.plan(after, Happening::Event { to: to.clone(), event });
            }
        }
    }

    fn put_blob(&mut self, id: BlobId, blob: Blob) -> bool {
        self.blobs.insert(id, blob);
        true
    }

    fn blob(&self, id: BlobId) -> Option<Blob> {
        self.blobs.get(&id).cloned()
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
    nodes: BTreeMap<AgentId, Node<M>>,
    network: Network<M>,
    world: W,
    /// How often each agent has lived.
    births: u64,
    actions: Vec<crate::ActionOf<M>>,
}

impl<M: StateMachine, W: World<M>> Simulator<M, W>
where
    M::Content: Clone,
    M::Value: Clone,
{
    /// An empty platform in a world that answers effects.
    pub fn new(seed: u64, faults: Faults, world: W) -> Self {
        let mut network = Network {
            now: Time::ZERO,
            sequence: 0,
            plan: BinaryHeap::new(),
            random: Random::new(seed),
            store: MemoryStore::default(),
            queues: Queues::default(),
            blobs: BTreeMap::new(),
            lives: BTreeMap::new(),
            cut_off: BTreeSet::new(),
            store_line: BTreeMap::new(),
            open: BTreeSet::new(),
            presence_watchers: BTreeSet::new(),
            seen_present: BTreeSet::new(),
            trace: None,
            faults,
        };
        if let Some(mean) = network.faults.crash_every {
            let after = network.around(mean);
            network.plan(after, Happening::CrashSome);
        }
        if let Some(mean) = network.faults.partition_every {
            let after = network.around(mean);
            network.plan(after, Happening::PartitionSome);
        }
        Self { nodes: BTreeMap::new(), network, world, births: 0, actions: Vec::new() }
    }

    /// Adds an agent, made anew at each of its lives. `may_crash`: whether the faults may kill it.
    pub fn add(&mut self, id: &AgentId, may_crash: bool, make: impl FnMut() -> M + 'static) {
        let node = Node { machine: None, make: Box::new(make), may_crash, timer: None };
        let before = self.nodes.insert(id.clone(), node);
        assert!(before.is_none(), "an agent's name is given once");
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

    /// The bus, to say something from outside.
    pub fn bus(&mut self) -> &mut impl Bus<Content = M::Content, Value = M::Value> {
        &mut self.network
    }

    /// Kills an agent with all it knows. It stays dead until [`Self::start`].
    pub fn crash(&mut self, id: &AgentId) {
        let Some(node) = self.nodes.get_mut(id) else { return };
        if node.machine.take().is_none() {
            return;
        }
        node.timer = None;
        let network = &mut self.network;
        network.note(|| format!("{id} crashes"));
        network.lives.insert(id.clone(), None);
        network.store.forget(id);
        network.queues.forget(id);
        network.presence_watchers.remove(id);
        network.open.retain(|(agent, _, _)| agent != id);
        network.plan(PRESENCE_TIMEOUT, Happening::Silent(id.clone()));
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
            match self.network.plan.peek() {
                Some(Reverse(next)) if next.at <= end => {}
                _ => return false,
            }
            let Some(Reverse(next)) = self.network.plan.pop() else { return false };
            self.network.now = next.at;
            self.happen(next.what);
        }
        true
    }

    /// Runs until `end`.
    pub fn run_until(&mut self, end: Time) {
        self.run_while(end, |_| true);
        self.network.now = self.network.now.max(end);
    }

    fn happen(&mut self, what: Happening<M>) {
        match what {
            Happening::Message { to, message } => self.arrive(&to, message),
            Happening::FromStore { to, ticket, reply } => self.arrive_from_store(to, ticket, reply),
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

    fn arrive_from_store(&mut self, to: Life, ticket: Ticket, reply: StoreReply<M::Value>) {
        if !self.network.is_alive(&to) {
            return;
        }
        let open = (to.agent.clone(), to.number, ticket);
        match reply {
            StoreReply::Changed(_) | StoreReply::CaughtUp => {
                if self.network.cut_off.contains(&to.agent) {
                    let at = self.network.now + RETRY_AFTER;
                    self.network.store_line.insert(to.agent.clone(), at);
                    self.network.plan_at(at, Happening::FromStore { to, ticket, reply });
                    return;
                }
            }
            StoreReply::Unavailable => {
                if !self.network.open.remove(&open) {
                    return;
                }
            }
            _ => {
                if self.network.cut_off.contains(&to.agent) || !self.network.open.remove(&open) {
                    return;
                }
            }
        }
        self.feed(&to.agent, Event::Store { ticket, reply });
    }

    fn crash_some(&mut self) {
        let Some(mean) = self.network.faults.crash_every else { return };
        if !self.network.faulty() {
            return;
        }
        let mortal: Vec<_> = self
            .nodes
            .iter()
            .filter(|(_, node)| node.may_crash && node.machine.is_some())
            .map(|(id, _)| id.clone())
            .collect();
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
        for id in self.nodes.keys() {
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
            self.crash(id);
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
