//! The results bin of one client: answers in the order in which they were computed.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use std::vec;

use super::sync::{lock, wait};
use crate::Completed;

/// Unbounded, as in the paper: the work bin is what holds the client back.
pub(crate) struct ResultsBin<O> {
    state: Mutex<State<O>>,
    arrived: Condvar,
    /// Units that were submitted, or are being so, and whose answer was not yet taken. Gets less under the lock only.
    outstanding: AtomicUsize,
    /// No client is left that could take anything. Set under the lock.
    abandoned: AtomicBool,
}

struct State<O> {
    /// As they came: the answers of a packet together, so that many cost no more than one to put in.
    batches: VecDeque<vec::IntoIter<Completed<O>>>,
    /// Threads in `take`.
    takers: usize,
}

impl<O> ResultsBin<O> {
    pub(crate) fn new() -> Self {
        let state = State { batches: VecDeque::new(), takers: 0 };
        let (outstanding, abandoned) = (AtomicUsize::new(0), AtomicBool::new(false));
        Self { state: Mutex::new(state), arrived: Condvar::new(), outstanding, abandoned }
    }

    fn lock(&self) -> MutexGuard<'_, State<O>> {
        lock(&self.state)
    }

    /// Announces `count` units, before they go into the work bin.
    pub(crate) fn expect(&self, count: usize) {
        self.outstanding.fetch_add(count, Ordering::SeqCst);
    }

    /// Takes back the announcement of units that went into no bin, or were cancelled there.
    pub(crate) fn forget(&self, count: usize) {
        let state = self.lock();
        self.settle(&state, count);
    }

    /// So many units are not outstanding any more; if none is, nobody need wait.
    fn settle(&self, state: &MutexGuard<'_, State<O>>, count: usize) {
        if self.outstanding.fetch_sub(count, Ordering::SeqCst) == count && state.takers > 0 {
            self.arrived.notify_all();
        }
    }

    pub(crate) fn outstanding(&self) -> usize {
        self.outstanding.load(Ordering::SeqCst)
    }

    /// Puts in answers; drops them when nobody is left to take them.
    pub(crate) fn deliver(&self, completed: Vec<Completed<O>>) {
        let arrived = completed.len();
        let mut state = self.lock();
        if self.is_abandoned() {
            drop(state);
            drop(completed); // Outside the lock: an output may do anything in its `Drop`.
            self.forget(arrived);
            return;
        }
        state.batches.push_back(completed.into_iter());
        let awaited = state.takers;
        drop(state);
        if awaited > 1 && arrived > 1 {
            self.arrived.notify_all();
        } else if awaited > 0 {
            self.arrived.notify_one();
        }
    }

    /// Waits for an answer until `deadline`, or for as long as any is outstanding.
    pub(crate) fn take(&self, deadline: Option<Instant>) -> Option<Completed<O>> {
        self.take_some(deadline, |batches| {
            let taken = batches.front_mut()?.next();
            batches.pop_front_if(|front| front.len() == 0);
            Some((taken?, 1))
        })
    }

    /// Waits for answers as [`ResultsBin::take`] does; takes all that are there, up to `max`. Empty: there are none.
    pub(crate) fn take_many(&self, max: usize, deadline: Option<Instant>) -> Vec<Completed<O>> {
        let take = |batches: &mut VecDeque<vec::IntoIter<Completed<O>>>| {
            let there: usize = batches.iter().map(ExactSizeIterator::len).sum();
            let count = there.min(max);
            let mut taken = Vec::with_capacity(count);
            while taken.len() < count
                && let Some(front) = batches.front_mut()
            {
                taken.extend(front.take(count - taken.len()));
                batches.pop_front_if(|front| front.len() == 0);
            }
            (count > 0).then_some((taken, count))
        };
        if max == 0 { Vec::new() } else { self.take_some(deadline, take).unwrap_or_default() }
    }

    fn take_some<R>(
        &self,
        deadline: Option<Instant>,
        mut take: impl FnMut(&mut VecDeque<vec::IntoIter<Completed<O>>>) -> Option<(R, usize)>,
    ) -> Option<R> {
        let mut state = self.lock();
        loop {
            if let Some((taken, count)) = take(&mut state.batches) {
                self.settle(&state, count);
                return Some(taken);
            }
            if self.outstanding() == 0 {
                return None;
            }
            let patience = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
            if patience.is_some_and(|patience| patience.is_zero()) {
                return None;
            }
            state.takers += 1;
            state = wait(&self.arrived, state, patience);
            state.takers -= 1;
        }
    }

    /// Whether nobody will take anything any more.
    pub(crate) fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::SeqCst)
    }

    /// Says that nobody will take anything any more; gives back what was not taken, to be dropped by the caller.
    pub(crate) fn abandon(&self) -> impl Sized + use<O> {
        let mut state = self.lock();
        self.abandoned.store(true, Ordering::SeqCst);
        let batches = std::mem::take(&mut state.batches);
        self.settle(&state, batches.iter().map(ExactSizeIterator::len).sum());
        batches
    }
}

/// The instant after `timeout`, or none where it is beyond what a clock can say.
pub(crate) fn deadline_after(timeout: Duration) -> Option<Instant> {
    Instant::now().checked_add(timeout)
}
