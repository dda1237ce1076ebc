//! What submitters, lanes and the allocator share: the bin under one lock, and who waits for what.
//!
//! No thread ever spins. Submitters wait on `room`, each lane on a condition variable of its own (so that a new unit
//! wakes one who can do it), takers on that of their results bin. The lock of the bin and that of a results bin are
//! never held together, and no code of the user runs under either.

use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use crate::report::Account;
use crate::results_bin::ResultsBin;
use crate::sync::{lock, wait};
use crate::window::Answer;
use crate::work_bin::{Envelope, Pending, Roster, WorkBin};
use crate::{
    Activity, Closed, Completed, Failed, HraConfig, HraReport, Primitive, ResourceDescriptor, ResourceId, SubmitError,
    TrySubmit, UnitError, Work, WorkUnit,
};

/// Places in the bin that must be free before a waiting submitter is woken, at most a quarter of the bin.
const ROOM_TO_WAKE_FOR: usize = 32;

pub(crate) struct Shared<W: Work> {
    pub(crate) config: HraConfig,
    pub(crate) lanes: Vec<Lane>,
    state: Mutex<State<W>>,
    room: Condvar,
    started: Instant,
}

/// What all threads may know of a lane.
pub(crate) struct Lane {
    pub(crate) descriptor: ResourceDescriptor,
    pub(crate) account: Mutex<Account>,
    wake: Condvar,
}

pub(crate) struct State<W: Work> {
    pub(crate) bin: WorkBin<W>,
    pub(crate) closed: bool,
    /// Answers of packets, by lane.
    pub(crate) inboxes: Vec<Vec<Answer<W>>>,
    roster: Roster,
    /// Lanes that wait for work and were not yet woken for any.
    idle: Vec<ResourceId>,
    /// Threads that wait for room.
    submitters: usize,
}

/// How an attempt ended.
pub(crate) enum Attempt<W: Work> {
    Done(W::Output),
    GivenBack(Failed<W>),
    Lost { reason: String, backup: Option<W> },
}

/// A unit on its way into the bin, with what the work says of itself.
struct Incoming<W> {
    unit: WorkUnit<W>,
    primitive: Primitive,
    size: u64,
}

impl<W: Work> Incoming<W> {
    fn new(unit: WorkUnit<W>) -> Self {
        let (primitive, size) = (unit.work.primitive(), unit.work.size());
        Self { unit, primitive, size }
    }

    fn into_pending(self, client: &Arc<ResultsBin<W::Output>>, now: Instant, bound: Duration) -> Pending<W> {
        let WorkUnit { work, ticket, max_delay, priority } = self.unit;
        let envelope = Envelope {
            client: Arc::clone(client),
            ticket,
            max_delay,
            priority,
            primitive: self.primitive,
            size: self.size,
            submitted: now,
            deadline: now.checked_add(max_delay.min(bound)).unwrap_or(now),
            attempts: 0,
            failed_on: Vec::new(),
        };
        Pending { work, envelope }
    }
}

impl<W: Work> Shared<W> {
    pub(crate) fn new(config: HraConfig, descriptors: Vec<ResourceDescriptor>) -> Self {
        let started = Instant::now();
        let state = State {
            bin: WorkBin::new(),
            closed: false,
            inboxes: descriptors.iter().map(|_| Vec::new()).collect(),
            roster: Roster::new(descriptors.iter().map(|descriptor| descriptor.primitives).collect()),
            idle: Vec::new(),
            submitters: 0,
        };
        let lane = |descriptor| Lane { descriptor, account: Mutex::new(Account::new(started)), wake: Condvar::new() };
        let lanes = descriptors.into_iter().map(lane).collect();
        Self { config, lanes, state: Mutex::new(state), room: Condvar::new(), started }
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, State<W>> {
        lock(&self.state)
    }

    // ---- The client's side.

    pub(crate) fn submit(
        &self,
        client: &Arc<ResultsBin<W::Output>>,
        units: Vec<WorkUnit<W>>,
    ) -> Result<(), SubmitError> {
        let incoming: Vec<_> = units.into_iter().map(Incoming::new).collect();
        // Announced before any can be answered, so that a clone of the client that takes meanwhile waits for them all.
        let count = incoming.len();
        client.expect(count);
        let mut incoming = incoming.into_iter();
        let outcome = self.push_all(client, &mut incoming);
        if outcome.is_err() {
            client.forget(incoming.len());
        }
        outcome
    }

    fn push_all(
        &self,
        client: &Arc<ResultsBin<W::Output>>,
        incoming: &mut std::vec::IntoIter<Incoming<W>>,
    ) -> Result<(), SubmitError> {
        let mut state = self.lock();
        let unsupported = incoming.as_slice().iter().find(|unit| state.roster.count_of(unit.primitive) == 0);
        if let Some(unit) = unsupported.filter(|_| !state.closed) {
            return Err(SubmitError::Unsupported(unit.primitive));
        }
        let mut orphans = Vec::new();
        loop {
            if state.closed {
                drop(state);
                orphans.iter().for_each(answer_no_resource);
                return Err(Closed.into());
            }
            let now = Instant::now();
            let mut woken = Vec::new();
            while self.room_in(&state) > 0 {
                let Some(unit) = incoming.next() else { break };
                let pending = unit.into_pending(client, now, self.config.max_delay_bound);
                if state.roster.count_of(pending.envelope.primitive) == 0 {
                    orphans.push(pending); // The last one who could was retired while this call waited.
                    continue;
                }
                woken.extend(state.idle_for(&pending.envelope));
                state.bin.push(pending);
            }
            let finished = incoming.as_slice().is_empty();
            if finished && state.submitters > 0 && self.room_in(&state) > 0 {
                self.room.notify_one(); // Room that this caller did not need is the next one's.
            }
            if finished || !woken.is_empty() {
                drop(state);
                self.wake(&woken);
                if finished {
                    orphans.iter().for_each(answer_no_resource);
                    return Ok(());
                }
                state = self.lock();
                if self.room_in(&state) > 0 {
                    continue;
                }
            }
            if !state.closed {
                state.submitters += 1;
                state = wait(&self.room, state, None);
                state.submitters -= 1;
            }
        }
    }

    pub(crate) fn try_submit(
        &self,
        client: &Arc<ResultsBin<W::Output>>,
        unit: WorkUnit<W>,
    ) -> Result<(), TrySubmit<W>> {
        let incoming = Incoming::new(unit);
        client.expect(1);
        let mut state = self.lock();
        let refused = |unit, reason: SubmitError| TrySubmit::Refused { unit, reason };
        let error = if state.closed {
            refused(incoming.unit, Closed.into())
        } else if state.roster.count_of(incoming.primitive) == 0 {
            refused(incoming.unit, SubmitError::Unsupported(incoming.primitive))
        } else if self.room_in(&state) == 0 {
            TrySubmit::Full(incoming.unit)
        } else {
            let pending = incoming.into_pending(client, Instant::now(), self.config.max_delay_bound);
            let woken = state.idle_for(&pending.envelope);
            state.bin.push(pending);
            drop(state);
            self.wake(woken.as_slice());
            return Ok(());
        };
        drop(state);
        client.forget(1);
        Err(error)
    }

    pub(crate) fn cancel(&self, client: &Arc<ResultsBin<W::Output>>) -> Vec<WorkUnit<W>> {
        let mut state = self.lock();
        let cancelled = state.bin.extract(|envelope| Arc::ptr_eq(&envelope.client, client));
        if !cancelled.is_empty() && state.submitters > 0 {
            self.room.notify_all();
        }
        drop(state);
        client.forget(cancelled.len());
        cancelled.into_iter().map(Pending::into_unit).collect()
    }

    // ---- The lanes' side.

    /// The next unit for `lane`; waits for it. `None`: shut down.
    pub(crate) fn next(&self, lane: ResourceId, mut now: Instant) -> Option<Pending<W>> {
        let mut state = self.lock();
        loop {
            if state.closed {
                return None;
            }
            if let Some(pending) = self.take(&mut state, lane, now) {
                return Some(pending);
            }
            state = self.doze(state, lane, None);
            now = Instant::now();
        }
    }

    /// Units that the bin still takes.
    fn room_in(&self, state: &State<W>) -> usize {
        self.config.bin_capacity.max(1).saturating_sub(state.bin.len())
    }

    /// Takes a unit out of the bin, if there is one, and lets a submitter in: not for every single place, which would
    /// switch threads for every unit, but for [`ROOM_TO_WAKE_FOR`] of them.
    pub(crate) fn take(&self, state: &mut State<W>, lane: ResourceId, now: Instant) -> Option<Pending<W>> {
        let State { bin, roster, .. } = state;
        let pending = bin.take(lane, roster, now)?;
        if state.submitters > 0 && self.room_in(state) >= ROOM_TO_WAKE_FOR.min(self.config.bin_capacity / 4) {
            self.room.notify_one();
        }
        Some(pending)
    }

    /// Waits as an idle lane, that new work wakes.
    pub(crate) fn doze<'a>(
        &'a self,
        mut state: MutexGuard<'a, State<W>>,
        lane: ResourceId,
        patience: Option<Duration>,
    ) -> MutexGuard<'a, State<W>> {
        state.idle.push(lane);
        state = wait(&self.lanes[lane.index()].wake, state, patience);
        state.idle.retain(|&idle| idle != lane);
        state
    }

    /// Waits as a lane that wants no work now.
    pub(crate) fn rest<'a>(
        &'a self,
        state: MutexGuard<'a, State<W>>,
        lane: ResourceId,
        patience: Option<Duration>,
    ) -> MutexGuard<'a, State<W>> {
        wait(&self.lanes[lane.index()].wake, state, patience)
    }

    /// Leaves a lane alone for `pause`. False: shut down meanwhile.
    pub(crate) fn pause(&self, lane: ResourceId, pause: Duration) -> bool {
        let start = Instant::now();
        lock(&self.lanes[lane.index()].account).enter(Activity::Suspended, start);
        self.pass_on();
        let mut state = self.lock();
        loop {
            let left = pause.saturating_sub(start.elapsed());
            if state.closed || left.is_zero() {
                break;
            }
            state = self.rest(state, lane, Some(left));
        }
        let open = !state.closed;
        drop(state);
        lock(&self.lanes[lane.index()].account).enter(Activity::Idle, Instant::now());
        open
    }

    /// Called by a lane that will take no work for a while: whatever it may have been woken for, others must look.
    pub(crate) fn pass_on(&self) {
        let mut state = self.lock();
        let woken = if state.bin.len() > 0 { std::mem::take(&mut state.idle) } else { Vec::new() };
        drop(state);
        self.wake(&woken);
    }

    /// Answers a unit, or puts it back into the bin to be tried elsewhere. Returns whether it was done.
    pub(crate) fn settle(
        &self,
        lane: ResourceId,
        mut envelope: Envelope<W>,
        attempt: Attempt<W>,
        started: Instant,
        busy: Duration,
    ) -> bool {
        let (reason, work) = match attempt {
            Attempt::Done(output) => {
                lock(&self.lanes[lane.index()].account).book(envelope.primitive, envelope.size, busy);
                answer(&envelope, Ok(output), Some(lane), started, busy);
                return true;
            }
            Attempt::GivenBack(Failed { work, reason }) => (reason, Some(work)),
            Attempt::Lost { reason, backup } => (reason, backup),
        };
        lock(&self.lanes[lane.index()].account).book_failure();
        envelope.attempts += 1;
        if !envelope.failed_on.contains(&lane) {
            envelope.failed_on.push(lane);
        }
        let error = match work {
            None => UnitError::Lost { reason },
            Some(_) if envelope.attempts >= self.config.max_attempts => {
                UnitError::Failed { attempts: envelope.attempts, reason }
            }
            Some(work) => {
                self.give_back(Pending { work, envelope });
                return false;
            }
        };
        answer(&envelope, Err(error), Some(lane), started, busy);
        false
    }

    fn give_back(&self, pending: Pending<W>) {
        let mut state = self.lock();
        // A client that goes says so before it empties the bin, so either this sees it or that finds the unit.
        if state.closed || pending.envelope.client.is_abandoned() {
            drop(state);
            return answer_unstarted(&pending.envelope, UnitError::Closed);
        }
        if state.roster.count_of(pending.envelope.primitive) == 0 {
            drop(state);
            return answer_no_resource(&pending);
        }
        let woken = state.idle_for(&pending.envelope);
        state.bin.push_retry(pending);
        drop(state);
        self.wake(woken.as_slice());
    }

    /// Gives a lane up for good, and answers the units that only it could have done.
    pub(crate) fn retire(&self, lane: ResourceId) {
        lock(&self.lanes[lane.index()].account).enter(Activity::Retired, Instant::now());
        let mut state = self.lock();
        state.roster.retire(lane);
        let State { bin, roster, .. } = &mut *state;
        let orphans = bin.extract(|envelope| roster.count_of(envelope.primitive) == 0);
        // A unit that failed on all who are left may now be tried there again, and waiting submitters must look anew.
        let woken = std::mem::take(&mut state.idle);
        self.room.notify_all();
        drop(state);
        self.wake(&woken);
        orphans.iter().for_each(answer_no_resource);
    }

    pub(crate) fn wake(&self, lanes: &[ResourceId]) {
        for lane in lanes {
            self.lanes[lane.index()].wake.notify_one();
        }
    }

    // ---- The allocator's side.

    /// Shuts down: units that wait are answered, those under way are finished, nothing more is taken.
    pub(crate) fn close(&self) {
        let mut state = self.lock();
        state.closed = true;
        let unstarted = state.bin.extract(|_| true);
        self.room.notify_all();
        drop(state);
        for lane in &self.lanes {
            lane.wake.notify_one();
        }
        for pending in unstarted {
            answer_unstarted(&pending.envelope, UnitError::Closed);
        }
    }

    pub(crate) fn report(&self) -> HraReport {
        let pending = self.lock().bin.len();
        let now = Instant::now();
        let resources = self.lanes.iter().zip(0..).map(|(lane, index)| {
            let account = lock(&lane.account);
            account.report(ResourceId(index), &lane.descriptor, now)
        });
        HraReport { uptime: now.saturating_duration_since(self.started), pending, resources: resources.collect() }
    }
}

impl<W: Work> State<W> {
    /// An idle lane that may do the unit, to be woken for it: the one that can do the least besides.
    fn idle_for(&mut self, envelope: &Envelope<W>) -> Option<ResourceId> {
        let may = |&&lane: &&ResourceId| self.roster.may_try(lane, envelope.primitive, &envelope.failed_on);
        let others = |lane: &ResourceId| self.roster.primitives(*lane).iter().count();
        let lane = *self.idle.iter().rev().filter(may).min_by_key(|lane| others(lane))?;
        self.idle.retain(|&idle| idle != lane);
        Some(lane)
    }
}

fn answer<W: Work>(
    envelope: &Envelope<W>,
    output: Result<W::Output, UnitError>,
    resource: Option<ResourceId>,
    started: Instant,
    busy: Duration,
) {
    let waited = started.saturating_duration_since(envelope.submitted);
    envelope.client.deliver(Completed { ticket: envelope.ticket, output, busy, waited, resource });
}

fn answer_unstarted<W: Work>(envelope: &Envelope<W>, error: UnitError) {
    answer(envelope, Err(error), envelope.failed_on.last().copied(), Instant::now(), Duration::ZERO);
}

fn answer_no_resource<W: Work>(pending: &Pending<W>) {
    let primitive = pending.envelope.primitive;
    answer_unstarted(&pending.envelope, UnitError::NoResource(primitive));
}
