//! The event queue of a simulation.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, VecDeque},
    time::Duration,
};

use crate::{AclMessage, EventOf, StateMachine, StoreReply, StoreRequest, Ticket, Time};

/// Time without a reply after which the store counts as unavailable in a simulation.
pub const STORE_TIMEOUT: Duration = Duration::from_secs(2);

/// Number of sorted queues for events, so that most are added in order.
const LANES: usize = 4;

/// The index of an agent in a simulation; kept over all its lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodeId(pub(super) u32);

impl NodeId {
    pub(super) fn index(self) -> usize {
        self.0 as usize
    }
}

/// A life of an agent: messages to an earlier life are lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Life {
    pub(super) node: NodeId,
    pub(super) number: u32,
}

/// The number of a store request. 0: one without a timeout, such as a watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RequestId(u64);

impl RequestId {
    pub(super) const NONE: Self = Self(0);
}

/// An event of the simulation.
pub(super) enum Happening<M: StateMachine> {
    /// A message arrives; its sender determines whether a partition blocks it.
    Message { to: NodeId, message: AclMessage<M::Content> },
    /// A reply of the store arrives.
    FromStore { to: Life, request: RequestId, ticket: Ticket, reply: StoreReply<M::Value> },
    /// The next report of the agent's watches is due.
    Report { to: Life },
    /// A request arrives at the store.
    ToStore { from: Life, id: RequestId, ticket: Ticket, request: StoreRequest<M::Value> },
    /// Another event for an agent.
    Event { to: Life, event: EventOf<M> },
    /// An agent's timer.
    Timer { of: NodeId },
    /// A random agent that may crash does.
    CrashSome,
    /// A crashed agent restarts.
    Restart(NodeId),
    /// A partition separates some agents.
    PartitionSome,
    /// The partition ends.
    Heal,
    /// Checks whether an agent is still silent.
    Silent(NodeId),
}

/// Small events inline; the location of large ones, to keep the queues' elements small.
#[derive(Clone, Copy, Debug, PartialEq)]
enum EventKind {
    Kept(u32),
    Report(Life),
    Timer(NodeId),
}

/// A planned event. Events at equal times happen in the order of planning.
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

/// A store request that may be open.
struct OpenRequest {
    /// The time of the request's timeout.
    at: Time,
    sequence: u64,
    of: Life,
    ticket: Ticket,
    open: bool,
}

/// The planned events by time.
pub(super) struct EventPlan<M: StateMachine> {
    /// Sorted queues. Events with equal delays, such as messages or heartbeats, are planned in order.
    lanes: [VecDeque<PlannedEvent>; LANES],
    /// Events that fit into no lane in order.
    heap: BinaryHeap<Reverse<PlannedEvent>>,
    kept: Vec<Option<Happening<M>>>,
    free: Vec<u32>,
    /// Open requests; all have the same timeout, so they end in order. The first one is always open.
    requests: VecDeque<OpenRequest>,
    /// The number of the first of them.
    first_request: u64,
    sequence: u64,
}

/// The location of the next event.
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
        // Of the lanes it fits behind, choose the one with the latest end
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

    /// Opens a store request, which waits for its reply.
    pub(super) fn open_request(&mut self, now: Time, of: Life, ticket: Ticket) -> RequestId {
        self.sequence += 1;
        let request = OpenRequest { at: now + STORE_TIMEOUT, sequence: self.sequence, of, ticket, open: true };
        self.requests.push_back(request);
        RequestId(self.first_request + self.requests.len() as u64 - 1)
    }

    /// Closes a request. False if it was answered before, or has timed out.
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

    /// Returns the time of the next event.
    pub(super) fn next_time(&self) -> Option<Time> {
        self.next().map(|(at, _)| at)
    }

    /// Takes the next event if it happens until `end`.
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
