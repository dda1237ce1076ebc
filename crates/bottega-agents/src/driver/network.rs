//! The network of a simulation: messages in transit, faults, and the bus.

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

/// Time without a sign of life after which an agent counts as gone in a simulation.
pub const PRESENCE_TIMEOUT: Duration = Duration::from_secs(3);

/// Maximum number of planned events of a simulation; while there are so many, messages are lost.
pub const PLANNED_MAX: usize = 1 << 22;

/// Interval of attempts to deliver ordered reports across a partition.
pub(super) const RETRY_AFTER: Duration = Duration::from_millis(50);

/// The faults of a network, with their frequencies. [`Faults::NONE`] is a fast network without faults.
#[derive(Clone, Debug, PartialEq)]
pub struct Faults {
    /// Minimum latency of a message.
    pub latency_min: Duration,
    /// Mean additional latency; a few messages take up to five times that, so that messages overtake each other.
    pub latency_extra_mean: Duration,
    /// Additional latency of store requests: a write is replicated before it is confirmed.
    pub store_latency: Duration,
    /// Share of messages, of store requests, and of replies of the store that are lost, 0..1.
    pub loss: f64,
    /// Share of messages duplicated, 0..1.
    pub duplication: f64,
    /// Mean time between crashes, over all agents that may crash; `None`: no crashes.
    pub crash_every: Option<Duration>,
    /// Maximum downtime after a crash.
    pub down_max: Duration,
    /// Mean time between partitions, which separate some agents from the others and from the store; `None`: no
    /// partitions.
    pub partition_every: Option<Duration>,
    /// Maximum duration of a partition.
    pub partition_max: Duration,
    /// Time from which no more faults begin, so that a run can end. Latency remains.
    pub until: Time,
}

impl Faults {
    /// No faults; a message takes a millisecond.
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
/// A writer to the store from outside of the platform.
const OUTSIDE: NodeId = NodeId(u32::MAX);

/// Capacity above which a queue of reports frees its memory when empty.
const REPORTS_KEPT_MAX: usize = 1 << 10;

/// Reports of an agent's watches in transit.
type WatchReports<M> = VecDeque<(Ticket, StoreReply<<M as StateMachine>::Value>)>;

/// The state of a simulation except for the machines: the bus uses it.
pub(super) struct Network<M: StateMachine> {
    pub(super) now: Time,
    pub(super) plan: EventPlan<M>,
    pub(super) random: Random,
    pub(super) faults: Faults,
    pub(super) store: MemoryStore<M::Value, NodeId>,
    pub(super) queues: Queues<M::Content>,
    pub(super) blobs: BTreeMap<BlobId, Blob>,
    /// The names of all agents seen so far.
    pub(super) names: Vec<AgentId>,
    /// A hash map for speed; never iterated.
    nodes: FxHashMap<AgentId, NodeId>,
    /// The number of each agent's life; `None` while it is down.
    lives: Vec<Option<u32>>,
    /// Reports of watches in transit to each agent: a partition delays them; none is lost or reordered.
    reports: Vec<WatchReports<M>>,
    /// Agents cut off by the partition; the store is on the other side.
    pub(super) cut_off: BTreeSet<NodeId>,
    presence_watchers: BTreeSet<NodeId>,
    seen_present: BTreeSet<NodeId>,
    replies: Vec<AddressedStore<M::Value, NodeId>>,
    pub(super) trace: Option<Vec<String>>,
    /// Number of messages sent, per receiver.
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

    /// Takes the next event, if it happens until `end`; its time becomes the current one.
    pub(super) fn next(&mut self, end: Time) -> Option<Happening<M>> {
        let (now, what) = self.plan.pop(end)?;
        self.now = now;
        Some(what)
    }

    /// Returns the time of the next event.
    pub(super) fn next_time(&self) -> Option<Time> {
        self.plan.next_time()
    }

    /// Returns the index of an agent; a new one at its first use.
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

    /// Returns the index of an agent, if it has one.
    pub(super) fn known(&self, agent: &AgentId) -> Option<NodeId> {
        self.nodes.get(agent).copied()
    }

    pub(super) fn name(&self, node: NodeId) -> &AgentId {
        &self.names[node.index()]
    }

    /// Starts a life of an agent, with this number.
    pub(super) fn bear(&mut self, node: NodeId, number: u32) {
        self.lives[node.index()] = Some(number);
        self.note(|names| format!("{} starts", names[node.index()]));
        self.tell_presence(node, true);
    }

    /// Ends a life of an agent: messages to it are lost.
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
        // u⁴ has mean 1/5: most messages are fast, some are slow
        let u = self.random.unit();
        self.faults.latency_min + self.faults.latency_extra_mean.mul_f64(5.0 * u * u * u * u)
    }

    /// Returns a random time with the given mean.
    pub(super) fn around(&mut self, mean: Duration) -> Duration {
        mean.mul_f64(2.0 * self.random.unit())
    }

    /// Returns true if a partition separates sender and receiver.
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

    /// Writes a line of the trace, if enabled; it is made with the names of all agents.
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

    /// Sends replies of the store; `request`: the request answered.
    fn send_replies(&mut self, request: RequestId, mut replies: Vec<AddressedStore<M::Value, NodeId>>, may_lose: bool) {
        for AddressedStore { to, ticket, reply } in replies.drain(..) {
            let Some(to) = self.life(to) else { continue };
            // A reply may be lost; a report of a watch is repeated by the store until it arrives
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

    /// Returns the next report for an agent, if due.
    pub(super) fn next_report(&mut self, node: NodeId) -> Option<(Ticket, StoreReply<M::Value>)> {
        let reports = &mut self.reports[node.index()];
        let next = reports.pop_front();
        if reports.is_empty() && reports.capacity() > REPORTS_KEPT_MAX {
            *reports = VecDeque::new();
        }
        next
    }

    /// Writes an entry from outside; watching agents are informed.
    pub(super) fn put(&mut self, key: Key, value: M::Value)
    where
        M::Value: Clone,
    {
        let mut replies = std::mem::take(&mut self.replies);
        self.store.handle(OUTSIDE, Ticket(0), StoreRequest::Put { key, value }, &mut replies);
        // The reply has no receiver
        self.send_replies(RequestId::NONE, replies, false);
    }

    /// Sends a request of an agent to the store.
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

    /// Sends a message to one receiver, or loses it.
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
        // Each receiver gets a copy addressed to it alone, like the intended receiver of an envelope
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
