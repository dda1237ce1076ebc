//! The network of a simulation: what is on its way, what goes wrong on it, and the bus that puts it there.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    time::Duration,
};

use rustc_hash::FxHashMap;

use super::{
    plan::{EventPlan, Happening, Life, NodeId, RequestId},
    queues::Queues,
    random::Random,
};
use crate::{
    AclMessage, AgentId, Event, Key, StateMachine, StoreReply, StoreRequest, Ticket, Time,
    bus::{BLOBS_MAX, Blob, BlobId, Bus},
    store::{AddressedStore, MemoryStore},
};

/// After so long without a sign of life an agent counts as gone.
pub const PRESENCE_TIMEOUT: Duration = Duration::from_secs(3);

/// The most that is on its way at a time; messages on top of it are lost.
pub const PLANNED_MAX: usize = 1 << 22;

/// How long a cut holds back what must arrive in order, before it is tried again.
pub(super) const RETRY_AFTER: Duration = Duration::from_millis(50);

/// The faults of a network, and how often each happens. [`Faults::NONE`] is a fast and faithful network.
#[derive(Clone, Debug, PartialEq)]
pub struct Faults {
    /// The shortest time a message takes.
    pub latency_min: Duration,
    /// What is added to it on the average; a few take five times as long, so that messages overtake each other.
    pub latency_extra_mean: Duration,
    /// What a request to the store takes on top of that: a write is kept by several servers before it is told of.
    pub store_latency: Duration,
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
        store_latency: Duration::ZERO,
        loss: 0.0,
        duplication: 0.0,
        crash_every: None,
        down_max: Duration::ZERO,
        partition_every: None,
        partition_max: Duration::ZERO,
        until: Time::ZERO,
    };
}
/// Stands for whoever writes into the store from outside of the platform.
const OUTSIDE: NodeId = NodeId(u32::MAX);

/// A queue of reports that is larger than this gives its memory back when it is empty.
const REPORTS_KEPT_MAX: usize = 1 << 10;

/// Reports of an agent's watches.
type Reports<M> = VecDeque<(Ticket, StoreReply<<M as StateMachine>::Value>)>;

/// All but the machines: what the bus of a simulation is made of.
pub(super) struct Network<M: StateMachine> {
    pub(super) now: Time,
    pub(super) plan: EventPlan<M>,
    pub(super) random: Random,
    pub(super) faults: Faults,
    pub(super) store: MemoryStore<M::Value, NodeId>,
    pub(super) queues: Queues<M::Content>,
    pub(super) blobs: BTreeMap<BlobId, Blob>,
    /// The name of each agent that was ever spoken of.
    pub(super) names: Vec<AgentId>,
    /// A hash map, for speed: never gone through.
    nodes: FxHashMap<AgentId, NodeId>,
    /// The life of each agent; `None` while it is dead.
    lives: Vec<Option<u32>>,
    /// Reports of watches on their way to each agent: a cut holds them back, none is lost, none overtakes another.
    reports: Vec<Reports<M>>,
    /// Agents on the far side of the cut; the store is on the near one.
    pub(super) cut_off: BTreeSet<NodeId>,
    presence_watchers: BTreeSet<NodeId>,
    seen_present: BTreeSet<NodeId>,
    replies: Vec<AddressedStore<M::Value, NodeId>>,
    pub(super) trace: Option<Vec<String>>,
    /// Messages sent, by receiver.
    pub(super) message_count: u64,
}

impl<M: StateMachine> Network<M> {
    pub(super) fn new(seed: u64, faults: Faults) -> Self {
        let mut network = Self {
            now: Time::ZERO,
            plan: EventPlan::new(),
            random: Random::new(seed),
            store: MemoryStore::default(),
            queues: Queues::default(),
            blobs: BTreeMap::new(),
            names: Vec::new(),
            nodes: FxHashMap::default(),
            lives: Vec::new(),
            reports: Vec::new(),
            cut_off: BTreeSet::new(),
            replies: Vec::new(),
            presence_watchers: BTreeSet::new(),
            seen_present: BTreeSet::new(),
            trace: None,
            message_count: 0,
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
        network
    }

    /// Takes the next thing that happens, if it does until `end`; it is then the present.
    pub(super) fn next(&mut self, end: Time) -> Option<Happening<M>> {
        let (now, what) = self.plan.pop(end)?;
        self.now = now;
        Some(what)
    }

    /// When the next thing happens.
    pub(super) fn next_time(&self) -> Option<Time> {
        self.plan.next_time()
    }

    /// An agent's place; it gets one when it is first spoken of.
    pub(super) fn node(&mut self, agent: &AgentId) -> NodeId {
        self.known(agent).unwrap_or_else(|| {
            let node = NodeId(u32::try_from(self.names.len()).expect("fewer than 2³² agents"));
            self.names.push(agent.clone());
            self.nodes.insert(agent.clone(), node);
            self.lives.push(None);
            self.reports.push(VecDeque::new());
            node
        })
    }

    /// An agent's place, if it has one.
    pub(super) fn known(&self, agent: &AgentId) -> Option<NodeId> {
        self.nodes.get(agent).copied()
    }

    pub(super) fn name(&self, node: NodeId) -> &AgentId {
        &self.names[node.index()]
    }

    /// An agent begins its life of this number.
    pub(super) fn bear(&mut self, node: NodeId, number: u32) {
        self.lives[node.index()] = Some(number);
        self.note(|names| format!("{} starts", names[node.index()]));
        self.tell_presence(node, true);
    }

    /// An agent is dead: what was meant for it is lost.
    pub(super) fn bury(&mut self, node: NodeId, how: &str) {
        self.note(|names| format!("{} {how}", names[node.index()]));
        self.lives[node.index()] = None;
        self.store.forget(&node);
        self.queues.forget(&self.names[node.index()]);
        self.presence_watchers.remove(&node);
        self.reports[node.index()].clear();
        self.plan(PRESENCE_TIMEOUT, Happening::Silent(node));
    }

    pub(super) fn plan(&mut self, after: Duration, what: Happening<M>) {
        self.plan_at(self.now + after, what);
    }

    pub(super) fn plan_at(&mut self, at: Time, what: Happening<M>) {
        self.plan.push(at, what);
    }

    pub(super) fn faulty(&self) -> bool {
        self.now < self.faults.until
    }

    pub(super) fn chance(&mut self, share: f64) -> bool {
        self.faulty() && self.random.unit() < share
    }

    pub(super) fn latency(&mut self) -> Duration {
        if self.faults.latency_extra_mean.is_zero() {
            return self.faults.latency_min;
        }
        // u⁴ has the mean 1/5: most messages are quick, some are late.
        let u = self.random.unit();
        self.faults.latency_min + self.faults.latency_extra_mean.mul_f64(5.0 * u * u * u * u)
    }

    /// A random time with the given mean.
    pub(super) fn around(&mut self, mean: Duration) -> Duration {
        mean.mul_f64(2.0 * self.random.unit())
    }

    /// Whether a cut lies between a sender and a receiver.
    pub(super) fn cut_between(&self, from: NodeId, to: NodeId) -> bool {
        !self.cut_off.is_empty() && self.cut_off.contains(&from) != self.cut_off.contains(&to)
    }

    pub(super) fn is_cut_off(&self, node: NodeId) -> bool {
        !self.cut_off.is_empty() && self.cut_off.contains(&node)
    }

    pub(super) fn life(&self, node: NodeId) -> Option<Life> {
        let number = (*self.lives.get(node.index())?)?;
        Some(Life { node, number })
    }

    pub(super) fn is_alive(&self, life: Life) -> bool {
        self.lives[life.node.index()] == Some(life.number)
    }

    /// Writes a line of the trace, if there is one; it is made with the names of all agents.
    pub(super) fn note(&mut self, line: impl FnOnce(&[AgentId]) -> String) {
        if let Some(trace) = &mut self.trace {
            let micros = self.now.elapsed().as_micros();
            trace.push(format!("[{:>6}.{:03}] {}", micros / 1000, micros % 1000, line(&self.names)));
        }
    }

    pub(super) fn tell_presence(&mut self, node: NodeId, present: bool) {
        let changed = if present { self.seen_present.insert(node) } else { self.seen_present.remove(&node) };
        if !changed {
            return;
        }
        for watcher in self.presence_watchers.clone() {
            if watcher != node
                && let Some(to) = self.life(watcher)
            {
                let (after, agent) = (self.latency(), self.name(node).clone());
                self.plan(after, Happening::Event { to, event: Event::Presence { agent, present } });
            }
        }
    }

    /// Sends what the store says; `request`: to whom it is the answer.
    fn send_replies(&mut self, request: RequestId, mut replies: Vec<AddressedStore<M::Value, NodeId>>, may_lose: bool) {
        for AddressedStore { to, ticket, reply } in replies.drain(..) {
            let Some(to) = self.life(to) else { continue };
            // An answer may be lost, a report of a watch is sent again by the store until it arrives.
            if matches!(reply, StoreReply::Changed(_) | StoreReply::CaughtUp) {
                let after = self.latency();
                self.reports[to.node.index()].push_back((ticket, reply));
                self.plan(after, Happening::Report { to });
            } else if !may_lose || !self.chance(self.faults.loss) {
                let after = self.latency();
                self.plan(after, Happening::FromStore { to, request, ticket, reply });
            }
        }
        self.replies = replies;
    }

    /// The next report for an agent, when it is due.
    pub(super) fn next_report(&mut self, node: NodeId) -> Option<(Ticket, StoreReply<M::Value>)> {
        let reports = &mut self.reports[node.index()];
        let next = reports.pop_front();
        if reports.is_empty() && reports.capacity() > REPORTS_KEPT_MAX {
            *reports = VecDeque::new();
        }
        next
    }

    /// Writes an entry as somebody outside; those who watch it are told.
    pub(super) fn put(&mut self, key: Key, value: M::Value)
    where
        M::Value: Clone,
    {
        let mut replies = std::mem::take(&mut self.replies);
        self.store.handle(OUTSIDE, Ticket(0), StoreRequest::Put { key, value }, &mut replies);
        // The answer goes nowhere: there is no such agent.
        self.send_replies(RequestId::NONE, replies, false);
    }

    /// An agent asks the store.
    pub(super) fn ask(&mut self, from: NodeId, ticket: Ticket, request: StoreRequest<M::Value>) {
        let Some(from) = self.life(from) else { return };
        let is_watch = matches!(request, StoreRequest::Watch { .. });
        let id = if is_watch { RequestId::NONE } else { self.plan.open_request(self.now, from, ticket) };
        if is_watch || !self.chance(self.faults.loss) {
            let after = self.latency() + self.faults.store_latency;
            self.plan(after, Happening::ToStore { from, id, ticket, request });
        }
    }

    pub(super) fn serve_store(&mut self, from: Life, id: RequestId, ticket: Ticket, request: StoreRequest<M::Value>)
    where
        M::Value: Clone,
    {
        let mut replies = std::mem::take(&mut self.replies);
        self.store.handle(from.node, ticket, request, &mut replies);
        self.send_replies(id, replies, true);
    }

    /// Brings a message to one receiver, or loses it.
    fn send(&mut self, message: AclMessage<M::Content>)
    where
        M::Content: Clone,
    {
        let Some(to) = message.receivers.first().map(|to| self.node(to)) else { return };
        if self.plan.len() >= PLANNED_MAX {
            self.note(|names| {
                let to = &names[to.index()];
                format!("{} -> {to}  {} lost: too much is on its way", message.sender, message.performative)
            });
            return;
        }
        if self.chance(self.faults.loss) {
            self.note(|names| format!("{} -> {}  {} lost", message.sender, names[to.index()], message.performative));
            return;
        }
        if self.chance(self.faults.duplication) {
            let after = self.latency();
            self.plan(after, Happening::Message { to, message: message.clone() });
        }
        let after = self.latency();
        self.plan(after, Happening::Message { to, message });
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
        self.message_count += message.receivers.len() as u64;
        if message.receivers.len() < 2 {
            return self.send(message);
        }
        // Each receiver gets a copy of its own, addressed to it alone, as the intended receiver of an envelope is.
        let mut message = message;
        for to in std::mem::take(&mut message.receivers) {
            self.send(AclMessage { receivers: vec![to], ..message.clone() });
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
        let from = self.node(from);
        self.ask(from, ticket, request);
    }

    fn watch_presence(&mut self, from: &AgentId) {
        let from = self.node(from);
        self.presence_watchers.insert(from);
        let Some(to) = self.life(from) else { return };
        for node in self.seen_present.clone() {
            if node != from {
                let (after, agent) = (self.latency(), self.name(node).clone());
                self.plan(after, Happening::Event { to, event: Event::Presence { agent, present: true } });
            }
        }
    }

    fn put_blob(&mut self, id: BlobId, blob: Blob) -> bool {
        if self.blobs.len() >= BLOBS_MAX && !self.blobs.contains_key(&id) {
            return false;
        }
        self.blobs.insert(id, blob);
        true
    }

    fn blob(&self, id: BlobId) -> Option<Blob> {
        self.blobs.get(&id).cloned()
    }
}
