//! Places in the work bin, and submitters that wait for one.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex};

use super::sync::{lock, wait};

/// Places that must be free before a waiting submitter is woken, at most a quarter of the bin: not for every single
/// place, which would switch threads for every unit.
const ROOM_TO_WAKE_FOR: usize = 32;

/// Counts the units that wait, wherever they do.
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

    /// Takes up to `wanted` places. Returns how many; none after the end.
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

    /// Of so many units that waited, so many still do, or again: those that failed are put back whether there is room
    /// or not. To be called under the policy's lock, so that this is in step with the bin.
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

    /// Lets a waiting submitter look, if that is worth waking it.
    pub(crate) fn let_some_in(&self) {
        self.let_in(ROOM_TO_WAKE_FOR.min(self.capacity.load(Ordering::SeqCst) / 4));
    }

    /// Lets a waiting submitter look, if there are so many places.
    pub(crate) fn let_in(&self, places: usize) {
        if self.waiters.load(Ordering::SeqCst) > 0 && self.free() >= places.max(1) {
            drop(lock(&self.gate));
            self.freed.notify_one();
        }
    }

    /// Waits until there is room, or the end.
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

    /// Nothing is taken any more.
    pub(crate) fn close(&self) {
        self.closed.store(true, Ordering::SeqCst);
        self.wake_all();
    }

    /// Makes all who wait look anew.
    pub(crate) fn wake_all(&self) {
        drop(lock(&self.gate));
        self.freed.notify_all();
    }
}
