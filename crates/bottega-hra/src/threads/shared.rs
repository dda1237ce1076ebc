//! The state shared by submitters, lanes and the watch, and their access to the policy.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex};
use std::time::{Duration, Instant};

use super::alarm::Alarm;
use super::clients::{ClientId, Clients};
use super::inlets::Inlets;
use super::room::Room;
use super::sync::{Post, lock, wait};
use crate::policy::core::{Core, FollowUps};
use crate::policy::incident::Fault;
use crate::policy::ledger::Ledger;
use crate::policy::time::Time;
use crate::policy::unit::Unit;
use crate::{Failed, Primitive, ResourceDescriptor, ResourceId, Transfer, Work};

/// The payload of a unit.
pub(crate) struct UnitPayload<W: Work> {
    /// The work. While a resource has it: its backup, if any.
    pub(crate) work: Option<W>,
    /// The client that submitted the unit.
    pub(crate) client: ClientId,
    /// The client's ticket.
    pub(crate) ticket: u64,
}

/// The state of a lane that all threads may access.
pub(crate) struct LanePost<W: Work> {
    pub(crate) descriptor: ResourceDescriptor,
    pub(crate) is_far: bool,
    pub(crate) post: Post,
    pub(crate) ledger: Mutex<Ledger<UnitPayload<W>>>,
    pub(crate) inbox: Mutex<Vec<PacketAnswer<W>>>,
}

/// The answer to a packet.
pub(crate) struct PacketAnswer<W: Work> {
    pub(crate) sequence: u64,
    pub(crate) outcomes: Vec<Result<W::Output, Failed<W>>>,
    pub(crate) busy: Option<Duration>,
    pub(crate) transfers: Option<[Transfer; 2]>,
    /// The kind of fault, if a unit came back undone.
    pub(crate) fault: Fault,
    /// All works of the packet, where the resource has to make itself ready before it begins them.
    pub(crate) unbegun: Option<Vec<W>>,
}

/// The end of a lane's thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LaneEnd {
    /// The lane has not ended.
    AtWork,
    /// The work of the lane is over, and its resource is being dropped.
    TearingDown,
    /// The thread has ended, or is not waited for, because its resource hangs or cannot be used.
    Over,
}

/// The state of an allocator.
pub(crate) struct AllocatorState<W: Work> {
    core: Mutex<Core<UnitPayload<W>>>,
    pub(crate) clients: Clients<W::Output>,
    pub(crate) inlets: Inlets<UnitPayload<W>>,
    pub(crate) room: Room,
    pub(crate) lanes: Vec<LanePost<W>>,
    pub(crate) alarm: Alarm,
    /// True if arrivals must be reported to the policy, because a lane waits to be woken.
    listens: AtomicBool,
    /// By primitive: 1 + the maximum size of data; 0 if unsupported.
    able: [AtomicU64; Primitive::COUNT],
    /// By lane: the end of its thread.
    over: Mutex<Vec<LaneEnd>>,
    over_changed: Condvar,
    started: Instant,
    pub(crate) max_delay_bound: Duration,
}

impl<W: Work> AllocatorState<W> {
    pub(crate) fn new(core: Core<UnitPayload<W>>, lanes: Vec<LanePost<W>>, max_delay_bound: Duration) -> Self {
        let shared = Self {
            clients: Clients::new(),
            inlets: Inlets::new(),
            room: Room::new(core.capacity()),
            alarm: Alarm::default(),
            listens: AtomicBool::new(false),
            able: std::array::from_fn(|_| AtomicU64::new(0)),
            over: Mutex::new(vec![LaneEnd::AtWork; lanes.len()]),
            over_changed: Condvar::new(),
            started: Instant::now(),
            core: Mutex::new(core),
            lanes,
            max_delay_bound,
        };
        shared.with_core(|core, _, _| shared.publish(core));
        shared
    }

    pub(crate) fn now(&self) -> Time {
        Time::at(self.started.elapsed())
    }

    /// Runs `decide` on the policy after taking in submitted units; then carries out the follow-ups.
    pub(crate) fn with_core<R>(
        &self,
        decide: impl FnOnce(&mut Core<UnitPayload<W>>, Time, &mut FollowUps<UnitPayload<W>>) -> R,
    ) -> R {
        let mut out = FollowUps::default();
        let mut core = lock(&self.core);
        let now = self.now();
        let mut counted = core.waiting() + self.take_in(&mut core, now, &mut out);
        let decided = decide(&mut core, now, &mut out);
        // Submitters read `listens` after filling an inlet, and this reads the inlets after setting it: one of the two
        // sees the other
        self.listens.store(core.listens(), Ordering::SeqCst);
        if core.listens() && self.inlets.is_filled() {
            counted += self.take_in(&mut core, now, &mut out);
            self.listens.store(core.listens(), Ordering::SeqCst);
        }
        self.room.set(counted, core.waiting(), core.capacity());
        if !out.orphans.is_empty() {
            self.publish(&core);
        }
        drop(core);
        self.room.let_some_in();
        self.follow(out);
        decided
    }

    /// Empties the inlets. Returns the number of units.
    fn take_in(&self, core: &mut Core<UnitPayload<W>>, now: Time, out: &mut FollowUps<UnitPayload<W>>) -> usize {
        let mut units = 0;
        self.inlets.drain(|chunk| {
            units += chunk.len();
            core.submit(now, chunk, out);
        });
        units
    }

    /// Publishes the capabilities to submitters.
    pub(crate) fn publish(&self, core: &Core<UnitPayload<W>>) {
        for primitive in Primitive::ALL {
            let most = core.most_data(primitive).map_or(0, |bytes| bytes.saturating_add(1));
            self.able[primitive.index()].store(most, Ordering::SeqCst);
        }
    }

    /// Returns two bools: true if `primitive` is supported at all, and true if it is on this much data.
    pub(crate) fn can(&self, primitive: Primitive, data_bytes: u64) -> (bool, bool) {
        let able = self.able[primitive.index()].load(Ordering::SeqCst);
        (able > 0, data_bytes < able || able == u64::MAX)
    }

    /// Wakes lanes that wait for work.
    pub(crate) fn announce_arrival(&self) {
        if self.listens.load(Ordering::SeqCst) || self.room.is_closed() {
            self.with_core(|_, _, _| ());
        }
    }

    fn follow(&self, out: FollowUps<UnitPayload<W>>) {
        for id in out.wake {
            self.lanes[id.index()].post.wake();
        }
        self.answer_unstarted(out.expired, Some(&crate::UnitError::Expired));
        self.answer_unstarted(out.orphans, None);
        for (id, sequence) in out.overdue {
            self.give_up(id, sequence, true);
        }
        for (id, sequence) in out.doubtful {
            self.do_elsewhere(id, sequence);
        }
    }

    // ---- Shutdown.

    /// Shuts down: waiting units are answered, those in progress are finished, no more are accepted.
    pub(crate) fn close(&self) {
        self.room.close();
        let unstarted = self.with_core(|core, _, _| core.close());
        for lane in &self.lanes {
            lane.post.wake();
        }
        self.answer_unstarted(unstarted, Some(&crate::UnitError::Closed));
    }

    /// Sets the end of a lane's thread.
    pub(crate) fn set_end(&self, id: ResourceId, end: LaneEnd) {
        lock(&self.over)[id.index()] = end;
        self.over_changed.notify_all();
    }

    /// Notes that a lane's work is over. A lane that is not waited for stays so.
    pub(crate) fn tear_down(&self, id: ResourceId) {
        let mut over = lock(&self.over);
        if over[id.index()] == LaneEnd::AtWork {
            over[id.index()] = LaneEnd::TearingDown;
        }
        drop(over);
        self.over_changed.notify_all();
    }

    /// Waits for the threads of all lanes whose resources do not hang; at most `teardown_max` while these are dropped.
    pub(crate) fn wait_until_over(&self, teardown_max: Duration) {
        let mut over = lock(&self.over);
        while over.contains(&LaneEnd::AtWork) {
            over = wait(&self.over_changed, over, None);
        }
        let until = Instant::now() + teardown_max;
        while over.contains(&LaneEnd::TearingDown) {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            over = wait(&self.over_changed, over, Some(left));
        }
    }

    /// Removes the waiting units of a client.
    pub(crate) fn cancel(&self, client: ClientId) -> Vec<Unit<UnitPayload<W>>> {
        self.with_core(|core, _, _| core.cancel(|unit| unit.load.client == client))
    }

    /// Ends the life time of all waiting units of a client, and answers them.
    pub(crate) fn expire(&self, client: ClientId) {
        self.with_core(|core, now, out| core.expire(now, |unit| unit.load.client == client, out));
    }
}
