//! The state that submitters, lanes and the watch share, and the one way to the policy.

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

/// What a unit carries.
pub(crate) struct UnitPayload<W: Work> {
    /// What is to be done. While a resource has that, what to go back to if it is lost there: its backup, if any.
    pub(crate) work: Option<W>,
    /// Whose it is.
    pub(crate) client: ClientId,
    /// The client's own number.
    pub(crate) ticket: u64,
}

/// What all threads may know of a lane.
pub(crate) struct LanePost<W: Work> {
    pub(crate) descriptor: ResourceDescriptor,
    pub(crate) is_far: bool,
    pub(crate) post: Post,
    pub(crate) ledger: Mutex<Ledger<UnitPayload<W>>>,
    pub(crate) inbox: Mutex<Vec<PacketAnswer<W>>>,
}

/// What came back of a packet.
pub(crate) struct PacketAnswer<W: Work> {
    pub(crate) sequence: u64,
    pub(crate) outcomes: Vec<Result<W::Output, Failed<W>>>,
    pub(crate) busy: Option<Duration>,
    pub(crate) transfers: Option<[Transfer; 2]>,
    /// What it means if a unit came back undone.
    pub(crate) fault: Fault,
    /// All works of the packet, where the resource has to make itself ready before it begins them.
    pub(crate) unbegun: Option<Vec<W>>,
}

/// How the thread of a lane ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LaneEnd {
    /// Not yet.
    AtWork,
    /// Its work is over, and its resource is being dropped.
    TearingDown,
    /// It has ended, or nobody waits for it, for its resource hangs or cannot be had.
    Over,
}

pub(crate) struct AllocatorState<W: Work> {
    core: Mutex<Core<UnitPayload<W>>>,
    pub(crate) clients: Clients<W::Output>,
    pub(crate) inlets: Inlets<UnitPayload<W>>,
    pub(crate) room: Room,
    pub(crate) lanes: Vec<LanePost<W>>,
    pub(crate) alarm: Alarm,
    /// Whether the policy must be told when something comes in, for some lane waits to be woken.
    listens: AtomicBool,
    /// By primitive: 1 + the most data that anybody can do it with; 0 when nobody can.
    able: [AtomicU64; Primitive::COUNT],
    /// By lane: how its thread ends.
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

    /// Has the policy take in what was submitted and decide something; then does what follows from it.
    pub(crate) fn with_core<R>(
        &self,
        decide: impl FnOnce(&mut Core<UnitPayload<W>>, Time, &mut FollowUps<UnitPayload<W>>) -> R,
    ) -> R {
        let mut out = FollowUps::default();
        let mut core = lock(&self.core);
        let now = self.now();
        let mut counted = core.waiting() + self.take_in(&mut core, now, &mut out);
        let decided = decide(&mut core, now, &mut out);
        // Who submits looks at `listens` after filling an inlet, and this looks at the inlets after setting it: one of
        // both sees the other.
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

    /// Empties the inlets. Returns how many units came.
    fn take_in(&self, core: &mut Core<UnitPayload<W>>, now: Time, out: &mut FollowUps<UnitPayload<W>>) -> usize {
        let mut units = 0;
        self.inlets.drain(|chunk| {
            units += chunk.len();
            core.submit(now, chunk, out);
        });
        units
    }

    /// Lets submitters see what can be done.
    pub(crate) fn publish(&self, core: &Core<UnitPayload<W>>) {
        for primitive in Primitive::ALL {
            let most = core.most_data(primitive).map_or(0, |bytes| bytes.saturating_add(1));
            self.able[primitive.index()].store(most, Ordering::SeqCst);
        }
    }

    /// Whether anybody can do `primitive`, and with so much data.
    pub(crate) fn can(&self, primitive: Primitive, data_bytes: u64) -> (bool, bool) {
        let able = self.able[primitive.index()].load(Ordering::SeqCst);
        (able > 0, data_bytes < able || able == u64::MAX)
    }

    /// Tells those who wait for work that there may be some.
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

    // ---- The end.

    /// Shuts down: units that wait are answered, those under way are finished, nothing more is taken.
    pub(crate) fn close(&self) {
        self.room.close();
        let unstarted = self.with_core(|core, _, _| core.close());
        for lane in &self.lanes {
            lane.post.wake();
        }
        self.answer_unstarted(unstarted, Some(&crate::UnitError::Closed));
    }

    /// How a lane's thread ends, or whether it is expected to.
    pub(crate) fn set_end(&self, id: ResourceId, end: LaneEnd) {
        lock(&self.over)[id.index()] = end;
        self.over_changed.notify_all();
    }

    /// The work of a lane is over. Who was not waited for before is not waited for now.
    pub(crate) fn tear_down(&self, id: ResourceId) {
        let mut over = lock(&self.over);
        if over[id.index()] == LaneEnd::AtWork {
            over[id.index()] = LaneEnd::TearingDown;
        }
        drop(over);
        self.over_changed.notify_all();
    }

    /// Waits for the threads of all lanes whose resources do not hang; for so long at most while these are torn down.
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

    /// Takes out the units of a client that still wait.
    pub(crate) fn cancel(&self, client: ClientId) -> Vec<Unit<UnitPayload<W>>> {
        self.with_core(|core, _, _| core.cancel(|unit| unit.load.client == client))
    }

    /// Ends the life time of all units of a client that wait; they are answered so.
    pub(crate) fn expire(&self, client: ClientId) {
        self.with_core(|core, now, out| core.expire(now, |unit| unit.load.client == client, out));
    }
}
