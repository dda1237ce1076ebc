//! The plan of a simulation: events in the order in which they happen.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, VecDeque},
    time::Duration,
};

use crate::{AclMessage, EventOf, StateMachine, StoreReply, StoreRequest, Ticket, Time};

/// After so long without an answer of the store it counts as unavailable.
pub const STORE_TIMEOUT: Duration = Duration::from_secs(2);

/// Queues that what is planned is spread over, so that most of it is planned in the order in which it happens.
const LANES: usize = 4;

/// An agent's place in the simulation; it keeps it for all its lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodeId(pub(super) u32);

impl NodeId {
    pub(super) fn index(self) -> usize {
        self.0 as usize
    }
}

/// Which life of which agent: what was meant for an earlier life is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Life {
    pub(super) node: NodeId,
    pub(super) number: u32,
}

/// Counts the requests to the store. 0: one that is never unanswered, as a watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RequestId(u64);

impl RequestId {
    pub(super) const NONE: Self = Self(0);
}

/// What happens.
pub(super) enum Happening<M: StateMachine> {
    /// A message arrives; the sender decides whether a cut lies between.
    Message { to: NodeId, message: AclMessage<M::Content> },
    /// An answer of the store arrives.
    FromStore { to: Life, request: RequestId, ticket: Ticket, reply: StoreReply<M::Value> },
    /// The next report of the agent's watches is due.
    Report { to: Life },
    /// A request arrives at the store.
    ToStore { from: Life, id: RequestId, ticket: Ticket, request: StoreRequest<M::Value> },
    /// Something else befalls an agent.
    Event { to: Life, event: EventOf<M> },
    /// An agent wanted to be called.
    Timer { of: NodeId },
    /// Some agent that may crash does.
    CrashSome,
    /// A dead agent has a new life.
    Restart(NodeId),
    /// A cut parts some agents from the others.
    PartitionSome,
    /// The cut ends.
    Heal,
    /// Whether an agent that was silent still is.
    Silent(NodeId),
}

/// The small ones themselves; where the others are kept, for they are large, and queues move what they hold.
#[derive(Clone, Copy, Debug, PartialEq)]
enum EventKind {
    Kept(u32),
    Report(Life),
    Timer(NodeId),
}

/// Something planned. What happens at one time happens in the order of planning.
#[derive(Clone, Copy, Debug)]
struct PlannedEvent {
    at: Time,
    sequence: u64,
    what: EventKind,
}

impl PlannedEvent {
    fn order(&self) -> (Time, u64) {
        (self.at, self.sequence)
    }
}

impl PartialEq for PlannedEvent {
    fn eq(&self, other: &Self) -> bool {
        self.order() == other.order()
    }
}

impl Eq for PlannedEvent {}

impl PartialOrd for PlannedEvent {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for PlannedEvent {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.order().cmp(&other.order())
    }
}

/// A request to the store that may be open.
struct OpenRequest {
    /// When it counts as unanswered.
    at: Time,
    sequence: u64,
    of: Life,
    ticket: Ticket,
    open: bool,
}

/// What is planned and when it happens.
pub(super) struct EventPlan<M: StateMachine> {
    /// Each in order. Times that lie equally far ahead, of messages or of heartbeats, come in order by themselves.
    lanes: [VecDeque<PlannedEvent>; LANES],
    /// What fits into no lane.
    heap: BinaryHeap<Reverse<PlannedEvent>>,
    kept: Vec<Option<Happening<M>>>,
    free: Vec<u32>,
    /// They all wait equally long, so the first asked is the first to end. The first one is always open.
    requests: VecDeque<OpenRequest>,
    /// Of the first of them.
    first_request: u64,
    sequence: u64,
}

/// Where the next thing is found.
#[derive(Clone, Copy)]
enum NextSource {
    Lane(usize),
    Heap,
    Request,
}

impl<M: StateMachine> EventPlan<M> {
    pub(super) fn new() -> Self {
        Self {
            lanes: Default::default(),
            heap: BinaryHeap::new(),
            kept: Vec::new(),
            free: Vec::new(),
            requests: VecDeque::new(),
            first_request: 1,
            sequence: 0,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.heap.len() + self.lanes.iter().map(VecDeque::len).sum::<usize>()
    }

    pub(super) fn push(&mut self, at: Time, what: Happening<M>) {
        self.sequence += 1;
        let what = match what {
            Happening::Report { to } => EventKind::Report(to),
            Happening::Timer { of } => EventKind::Timer(of),
            what => EventKind::Kept(self.keep(what)),
        };
        let planned = PlannedEvent { at, sequence: self.sequence, what };
        // Of the lanes that it fits behind the one whose end is nearest.
        let end = |lane: &VecDeque<PlannedEvent>| lane.back().map(|last| last.at);
        let fits = (0..LANES).filter(|&lane| end(&self.lanes[lane]).is_none_or(|end| end <= at));
        match fits.max_by_key(|&lane| end(&self.lanes[lane])) {
            Some(lane) => self.lanes[lane].push_back(planned),
            None => self.heap.push(Reverse(planned)),
        }
    }

    fn keep(&mut self, what: Happening<M>) -> u32 {
        let place = self.free.pop().unwrap_or_else(|| {
            self.kept.push(None);
            (self.kept.len() - 1) as u32
        });
        self.kept[place as usize] = Some(what);
        place
    }

    /// A request to the store begins to wait for its answer.
    pub(super) fn open_request(&mut self, now: Time, of: Life, ticket: Ticket) -> RequestId {
        self.sequence += 1;
        let request = OpenRequest { at: now + STORE_TIMEOUT, sequence: self.sequence, of, ticket, open: true };
        self.requests.push_back(request);
        RequestId(self.first_request + self.requests.len() as u64 - 1)
    }

    /// A request has its answer. `false`: it had one before, or its time is over.
    pub(super) fn close_request(&mut self, RequestId(id): RequestId) -> bool {
        let index = id.checked_sub(self.first_request).map(|index| index as usize);
        let Some(request) = index.and_then(|index| self.requests.get_mut(index)) else { return false };
        let was_open = std::mem::replace(&mut request.open, false);
        self.forget_closed();
        was_open
    }

    fn forget_closed(&mut self) {
        while self.requests.front().is_some_and(|request| !request.open) {
            self.requests.pop_front();
            self.first_request += 1;
        }
    }

    fn next(&self) -> Option<(Time, NextSource)> {
        let mut next: Option<((Time, u64), NextSource)> = None;
        let mut see = |order: Option<(Time, u64)>, source: NextSource| {
            if let Some(order) = order
                && next.is_none_or(|(first, _)| order < first)
            {
                next = Some((order, source));
            }
        };
        for (lane, planned) in self.lanes.iter().enumerate() {
            see(planned.front().map(PlannedEvent::order), NextSource::Lane(lane));
        }
        see(self.heap.peek().map(|Reverse(planned)| planned.order()), NextSource::Heap);
        see(self.requests.front().map(|request| (request.at, request.sequence)), NextSource::Request);
        next.map(|((at, _), source)| (at, source))
    }

    /// When the next thing happens.
    pub(super) fn next_time(&self) -> Option<Time> {
        self.next().map(|(at, _)| at)
    }

    /// Takes the next thing if it happens until `end`.
    pub(super) fn pop(&mut self, end: Time) -> Option<(Time, Happening<M>)> {
        let (at, source) = self.next().filter(|(at, _)| *at <= end)?;
        let planned = match source {
            NextSource::Lane(lane) => self.lanes[lane].pop_front()?,
            NextSource::Heap => self.heap.pop()?.0,
            NextSource::Request => {
                let (request, id) = (self.requests.front()?, RequestId(self.first_request));
                let (to, ticket) = (request.of, request.ticket);
                return Some((at, Happening::FromStore { to, request: id, ticket, reply: StoreReply::Unavailable }));
            }
        };
        let what = match planned.what {
            EventKind::Report(to) => Happening::Report { to },
            EventKind::Timer(of) => Happening::Timer { of },
            EventKind::Kept(place) => {
                self.free.push(place);
                self.kept[place as usize].take()?
            }
        };
        Some((at, what))
    }
}
