//! Room in the work bin, and submitters that wait for it.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex};

use super::sync::{lock, wait};

/// Number of free places at which a waiting submitter is woken, at most a quarter of the bin: waking it for each place
/// switches threads per unit.
const ROOM_TO_WAKE_FOR: usize = 32;

/// The count of waiting units, in inlets and bin.
pub(crate) struct Room {
    taken: AtomicUsize,
    capacity: AtomicUsize,
    waiters: AtomicUsize,
    closed: AtomicBool,
    gate: Mutex<()>,
    freed: Condvar,
}

impl Room {
    pub(crate) fn new(capacity: usize) -> Self {
        Self {
            taken: AtomicUsize::new(0),
            capacity: AtomicUsize::new(capacity),
            waiters: AtomicUsize::new(0),
            closed: AtomicBool::new(false),
            gate: Mutex::new(()),
            freed: Condvar::new(),
        }
    }

    pub(crate) fn taken(&self) -> usize {
        self.taken.load(Ordering::SeqCst)
    }

    fn free(&self) -> usize {
        self.capacity.load(Ordering::SeqCst).saturating_sub(self.taken())
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.closed.load(Ordering::SeqCst)
    }

    /// Reserves up to `wanted` places. Returns their number; 0 after shutdown.
    pub(crate) fn reserve(&self, wanted: usize) -> usize {
        let mut taken = self.taken.load(Ordering::SeqCst);
        loop {
            let granted = wanted.min(self.capacity.load(Ordering::SeqCst).saturating_sub(taken));
            if granted == 0 || self.is_closed() {
                return 0;
            }
            match self.taken.compare_exchange_weak(taken, taken + granted, Ordering::SeqCst, Ordering::SeqCst) {
                Ok(_) => return granted,
                Err(now) => taken = now,
            }
        }
    }

    /// Updates the count from `before` to `after` waiting units; failed units are put back even without room. Called
    /// under the policy's lock, to stay consistent with the bin.
    pub(crate) fn set(&self, before: usize, after: usize, capacity: usize) {
        if after > before {
            self.taken.fetch_add(after - before, Ordering::SeqCst);
        } else if after < before {
            self.taken.fetch_sub(before - after, Ordering::SeqCst);
        }
        if self.capacity.load(Ordering::SeqCst) != capacity {
            self.capacity.store(capacity, Ordering::SeqCst);
        }
    }

    /// Wakes a waiting submitter, if there are enough free places.
    pub(crate) fn let_some_in(&self) {
        self.let_in(ROOM_TO_WAKE_FOR.min(self.capacity.load(Ordering::SeqCst) / 4));
    }

    /// Wakes a waiting submitter, if there are this many free places.
    pub(crate) fn let_in(&self, places: usize) {
        if self.waiters.load(Ordering::SeqCst) > 0 && self.free() >= places.max(1) {
            drop(lock(&self.gate));
            self.freed.notify_one();
        }
    }

    /// Waits for room, or shutdown.
    pub(crate) fn wait(&self) {
        let gate = lock(&self.gate);
        self.waiters.fetch_add(1, Ordering::SeqCst);
        if self.free() == 0 && !self.is_closed() {
            drop(wait(&self.freed, gate, None));
        } else {
            drop(gate);
        }
        self.waiters.fetch_sub(1, Ordering::SeqCst);
    }

    /// Shuts down: no more units are accepted.
    pub(crate) fn close(&self) {
        self.closed.store(true, Ordering::SeqCst);
        self.wake_all();
    }

    /// Wakes all waiting submitters.
    pub(crate) fn wake_all(&self) {
        drop(lock(&self.gate));
        self.freed.notify_all();
    }
}
