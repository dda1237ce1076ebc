//! The network of a simulation: what is on its way, what goes wrong on it, and the bus that puts it there.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, BinaryHeap, HashMap, HashSet, VecDeque},
    time::Duration,
};

use super::{queues::Queues, random::Random};
use crate::{
    AclMessage, AgentId, Event, EventOf, Key, StateMachine, StoreReply, StoreRequest, Ticket, Time,
    bus::{BLOBS_MAX, Blob, BlobId, Bus},
    store::{Addressed, MemoryStore},
};

/// After so long without an answer of the store it counts as unavailable.
pub const STORE_TIMEOUT: Duration = Duration::from_secs(2);

/// After so long without a sign of life an agent counts as gone.
pub const PRESENCE_TIMEOUT: Duration = Duration::from_secs(3);

/// The most that is on its way at a time; messages on top of it are lost.
pub const PLANNED_MAX: usize = 1 << 22;

/// How long a cut holds back what must arrive in order, before it is tried again.
pub(super) const RETRY_AFTER: Duration = Duration::from_millis(50);

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
/// Which life of which agent: what was meant for an earlier life is lost.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Life {
    pub(super) agent: AgentId,
    pub(super) number: u64,
}

pub(super) enum Happening<M: StateMachine> {
    /// A message arrives; the sender decides whether a cut lies between.
    Message {
        to: AgentId,
        message: AclMessage<M::Content>,
    },
    /// An answer of the store arrives.
    FromStore {
        to: Life,
        ticket: Ticket,
        reply: StoreReply<M::Value>,
    },
    /// The next report of the agent's watches is due.
    Report {
        to: Life,
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

/// What is planned and when it happens. What happens at one time happens in the order of planning.
///
/// The heap holds places only: what is planned is large, and a heap moves what it holds.
pub(super) struct Plan<M: StateMachine> {
    heap: BinaryHeap<Reverse<(Time, u64, usize)>>,
    places: Vec<Option<Happening<M>>>,
    free: Vec<usize>,
    /// When which request counts as unanswered. They all wait equally long, so the first asked is the first to end.
    timeouts: VecDeque<(Time, u64, Life, Ticket)>,
    sequence: u64,
}

impl<M: StateMachine> Plan<M> {
    fn new() -> Self {
        let (heap, places, free) = (BinaryHeap::new(), Vec::new(), Vec::new());
        Self { heap, places, free, timeouts: VecDeque::new(), sequence: 0 }
    }

    fn len(&self) -> usize {
        self.heap.len() + self.timeouts.len()
    }

    fn push(&mut self, at: Time, what: Happening<M>) {
        self.sequence += 1;
        let place = self.free.pop().unwrap_or_else(|| {
            self.places.push(None);
            self.places.len() - 1
        });
        self.places[place] = Some(what);
        self.heap.push(Reverse((at, self.sequence, place)));
    }

    fn push_timeout(&mut self, now: Time, of: Life, ticket: Ticket) {
        self.sequence += 1;
        self.timeouts.push_back((now + STORE_TIMEOUT, self.sequence, of, ticket));
    }

    /// Whether a timeout comes next, and when the next thing comes.
    fn next(&self) -> Option<(bool, Time)> {
        let planned = self.heap.peek().map(|Reverse((at, sequence, _))| (*at, *sequence));
        let timeout = self.timeouts.front().map(|(at, sequence, ..)| (*at, *sequence));
        match (planned, timeout) {
            (Some(planned), Some(timeout)) => Some((timeout < planned, planned.min(timeout).0)),
            (planned, timeout) => planned.or(timeout).map(|(at, _)| (planned.is_none(), at)),
        }
    }

    fn pop(&mut self) -> Option<(Time, Happening<M>)> {
        let (is_timeout, at) = self.next()?;
        if is_timeout {
            let (_, _, to, ticket) = self.timeouts.pop_front()?;
            return Some((at, Happening::FromStore { to, ticket, reply: StoreReply::Unavailable }));
        }
        let Reverse((_, _, place)) = self.heap.pop()?;
        self.free.push(place);
        self.places[place].take().map(|what| (at, what))
    }
}

/// An open request to the store: of which life, and its ticket.
pub(super) type OpenRequest = (u64, Ticket);

/// Reports of an agent's watches.
pub(super) type Reports<M> = VecDeque<(Ticket, StoreReply<<M as StateMachine>::Value>)>;

/// All but the machines: what the bus of a simulation is made of.
pub(super) struct Network<M: StateMachine> {
    pub(super) now: Time,
    pub(super) plan: Plan<M>,
    pub(super) random: Random,
    pub(super) faults: Faults,
    pub(super) store: MemoryStore<M::Value, AgentId>,
    pub(super) queues: Queues<M::Content>,
    pub(super) blobs: BTreeMap<BlobId, Blob>,
    /// The life of each agent; `None` while it is dead. A hash map, as `reports` and `open` are: never gone through in an
    /// order that shows.
    pub(super) lives: HashMap<AgentId, Option<u64>>,
    /// Agents on the far side of the cut; the store is on the near one.
    pub(super) cut_off: BTreeSet<AgentId>,
    /// Reports of watches on their way to each agent: a cut holds them back, none is lost, none overtakes another.
    pub(super) reports: HashMap<AgentId, Reports<M>>,
    pub(super) open: HashSet<OpenRequest>,
    pub(super) presence_watchers: BTreeSet<AgentId>,
    pub(super) seen_present: BTreeSet<AgentId>,
    pub(super) trace: Option<Vec<String>>,
    /// Messages sent, by receiver.
    pub(super) message_count: u64,
}

impl<M: StateMachine> Network<M> {
    pub(super) fn new(seed: u64, faults: Faults) -> Self {
        let mut network = Self {
            now: Time::ZERO,
            plan: Plan::new(),
            random: Random::new(seed),
            store: MemoryStore::default(),
            queues: Queues::default(),
            blobs: BTreeMap::new(),
            lives: HashMap::new(),
            cut_off: BTreeSet::new(),
            reports: HashMap::new(),
            open: HashSet::new(),
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
        self.next_time().filter(|at| *at <= end)?;
        let (now, what) = self.plan.pop()?;
        self.now = now;
        Some(what)
    }

    /// When the next thing happens.
    pub(super) fn next_time(&self) -> Option<Time> {
        self.plan.next().map(|(_, at)| at)
    }

    /// An agent is dead: what was meant for it is lost.
    pub(super) fn bury(&mut self, id: &AgentId, how: &str) {
        self.note(|| format!("{id} {how}"));
        let number = self.lives.insert(id.clone(), None).flatten();
        self.store.forget(id);
        self.queues.forget(id);
        self.presence_watchers.remove(id);
        self.open.retain(|(life, _)| Some(*life) != number);
        self.reports.remove(id);
        self.plan(PRESENCE_TIMEOUT, Happening::Silent(id.clone()));
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
        // u⁴ has the mean 1/5: most messages are quick, some are late.
        let u = self.random.unit();
        self.faults.latency_min + self.faults.latency_extra_mean.mul_f64(5.0 * u * u * u * u)
    }

    /// A random time with the given mean.
    pub(super) fn around(&mut self, mean: Duration) -> Duration {
        mean.mul_f64(2.0 * self.random.unit())
    }

    pub(super) fn cut_between(&self, a: &AgentId, b: &AgentId) -> bool {
        self.cut_off.contains(a) != self.cut_off.contains(b)
    }

    pub(super) fn life(&self, agent: &AgentId) -> Option<Life> {
        let number = (*self.lives.get(agent)?)?;
        Some(Life { agent: agent.clone(), number })
    }

    pub(super) fn is_alive(&self, life: &Life) -> bool {
        self.lives.get(&life.agent) == Some(&Some(life.number))
    }

    pub(super) fn note(&mut self, line: impl FnOnce() -> String) {
        if let Some(trace) = &mut self.trace {
            let micros = self.now.elapsed().as_micros();
            trace.push(format!("[{:>6}.{:03}] {}", micros / 1000, micros % 1000, line()));
        }
    }

    pub(super) fn tell_presence(&mut self, agent: &AgentId, present: bool) {
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

    pub(super) fn reply_from_store(&mut self, to: &AgentId, ticket: Ticket, reply: StoreReply<M::Value>) {
        let Some(to) = self.life(to) else { return };
        let after = self.latency();
        if matches!(reply, StoreReply::Changed(_) | StoreReply::CaughtUp) {
            self.reports.entry(to.agent.clone()).or_default().push_back((ticket, reply));
            self.plan(after, Happening::Report { to });
        } else {
            self.plan(after, Happening::FromStore { to, ticket, reply });
        }
    }

    /// Writes an entry as somebody outside; those who watch it are told.
    pub(super) fn put(&mut self, key: Key, value: M::Value)
    where
        M::Value: Clone,
    {
        let outside = AgentId::new("outside");
        let mut replies = Vec::new();
        self.store.handle(outside, Ticket(0), StoreRequest::Put { key, value }, &mut replies);
        for Addressed { to, ticket, reply } in replies {
            // The answer goes nowhere: there is no such agent.
            self.reply_from_store(&to, ticket, reply);
        }
    }

    pub(super) fn serve_store(&mut self, from: &Life, ticket: Ticket, request: StoreRequest<M::Value>)
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
        self.message_count += message.receivers.len() as u64;
        let mut message = message;
        for to in std::mem::take(&mut message.receivers) {
            if self.plan.len() >= PLANNED_MAX {
                self.note(|| {
                    format!("{} -> {to}  {} lost: too much is on its way", message.sender, message.performative)
                });
                continue;
            }
            let (loss, duplication) = (self.faults.loss, self.faults.duplication);
            if self.chance(loss) {
                self.note(|| format!("{} -> {to}  {} lost", message.sender, message.performative));
                continue;
            }
            let copies = if self.chance(duplication) { 2 } else { 1 };
            for _ in 0..copies {
                let after = self.latency();
                // Each receiver gets a copy of its own, addressed to it alone, as the intended receiver of an envelope is.
                let message = AclMessage { receivers: vec![to.clone()], ..message.clone() };
                self.plan(after, Happening::Message { to: to.clone(), message });
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
            self.open.insert((from.number, ticket));
            self.plan.push_timeout(self.now, from.clone(), ticket);
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
