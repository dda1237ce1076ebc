//! The results bin of one client: answers in the order in which they were computed.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use crate::Completed;
use crate::sync::lock;

/// Unbounded, as in the paper: the work bin is what holds the client back.
pub(crate) struct ResultsBin<O> {
    state: Mutex<State<O>>,
    arrived: Condvar,
    /// No client is left that could take anything. Set under the lock.
    abandoned: AtomicBool,
}

struct State<O> {
    results: VecDeque<Completed<O>>,
    /// Units that were submitted, or are being so, and whose answer was not yet taken.
    outstanding: usize,
    /// Threads in `take`.
    takers: usize,
}

impl<O> ResultsBin<O> {
    pub(crate) fn new() -> Self {
        let state = State { results: VecDeque::new(), outstanding: 0, takers: 0 };
        Self { state: Mutex::new(state), arrived: Condvar::new(), abandoned: AtomicBool::new(false) }
    }

    fn lock(&self) -> MutexGuard<'_, State<O>> {
        lock(&self.state)
    }

    /// Announces `count` units, before they go into the work bin.
    pub(crate) fn expect(&self, count: usize) {
        self.lock().outstanding += count;
    }

    /// Takes back the announcement of units that went into no bin, or were cancelled there.
    pub(crate) fn forget(&self, count: usize) {
        let mut state = self.lock();
        state.outstanding -= count;
        if state.outstanding == 0 && state.takers > 0 {
            self.arrived.notify_all();
        }
    }

    pub(crate) fn outstanding(&self) -> usize {
        self.lock().outstanding
    }

    /// Puts in an answer; drops it when nobody is left to take it.
    pub(crate) fn deliver(&self, completed: Completed<O>) {
        let mut state = self.lock();
        if self.is_abandoned() {
            state.outstanding -= 1;
            drop(state);
            return; // `completed` is dropped outside the lock: an output may do anything in its `Drop`.
        }
        state.results.push_back(completed);
        let awaited = state.takers > 0;
        drop(state);
        if awaited {
            self.arrived.notify_one();
        }
    }

    /// Waits for an answer until `deadline`, or for as long as any is outstanding.
    pub(crate) fn take(&self, deadline: Option<Instant>) -> Option<Completed<O>> {
        let mut state = self.lock();
        loop {
            if let Some(completed) = state.results.pop_front() {
                state.outstanding -= 1;
                if state.outstanding == 0 && state.takers > 0 {
                    self.arrived.notify_all();
                }
                return Some(completed);
            }
            if state.outstanding == 0 {
                return None;
            }
            let patience = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
            if patience.is_some_and(|patience| patience.is_zero()) {
                return None;
            }
            state.takers += 1;
            state = crate::sync::wait(&self.arrived, state, patience);
            state.takers -= 1;
        }
    }

    /// Whether nobody will take anything any more.
    pub(crate) fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::SeqCst)
    }

    /// Says that nobody will take anything any more; gives back what was not taken, to be dropped by the caller.
    pub(crate) fn abandon(&self) -> VecDeque<Completed<O>> {
        let mut state = self.lock();
        self.abandoned.store(true, Ordering::SeqCst);
        let results = std::mem::take(&mut state.results);
        state.outstanding -= results.len();
        results
    }
}

/// The instant after `timeout`, or none where it is beyond what a clock can say.
pub(crate) fn deadline_after(timeout: Duration) -> Option<Instant> {
    Instant::now().checked_add(timeout)
}
