//! The results bin of a client: answers in order of completion.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use std::vec;

use super::sync::{lock, wait};
use crate::Completed;

/// A results bin. Unbounded, as in the paper: the work bin limits the client.
pub(crate) struct ResultsBin<O> {
    state: Mutex<ResultsState<O>>,
    arrived: Condvar,
    /// Number of units ever submitted, or being submitted.
    expected: AtomicUsize,
    /// True if the life time of all its units has ended.
    over: AtomicBool,
}

struct ResultsState<O> {
    /// The answers in order, by packet, no batch empty: a batch costs no more to insert than one answer.
    batches: VecDeque<vec::IntoIter<Completed<O>>>,
    /// Number of expected units whose answer was taken, or will not come.
    settled: usize,
    /// Number of threads in `take`.
    takers: usize,
}

impl<O> ResultsState<O> {
    fn drop_empty(&mut self) {
        self.batches.pop_front_if(|front| front.len() == 0);
    }
}

impl<O> ResultsBin<O> {
    pub(crate) fn new() -> Self {
        let state = ResultsState { batches: VecDeque::new(), settled: 0, takers: 0 };
        Self {
            state: Mutex::new(state),
            arrived: Condvar::new(),
            expected: AtomicUsize::new(0),
            over: AtomicBool::new(false),
        }
    }

    /// Ends the life time of all its units.
    pub(crate) fn end(&self) {
        self.over.store(true, Ordering::SeqCst);
    }

    pub(crate) fn is_over(&self) -> bool {
        self.over.load(Ordering::SeqCst)
    }

    fn lock(&self) -> MutexGuard<'_, ResultsState<O>> {
        lock(&self.state)
    }

    /// Announces `count` units, before they enter the work bin.
    pub(crate) fn expect(&self, count: usize) {
        self.expected.fetch_add(count, Ordering::SeqCst);
    }

    /// Withdraws units that were not submitted, or were cancelled.
    pub(crate) fn forget(&self, count: usize) {
        let mut state = self.lock();
        self.settle(&mut state, count);
    }

    /// Marks units as settled; wakes waiting threads if none is outstanding.
    fn settle(&self, state: &mut ResultsState<O>, count: usize) {
        state.settled += count;
        if state.takers > 0 && self.left(state) == 0 {
            self.arrived.notify_all();
        }
    }

    /// Returns the number of units whose answer is outstanding.
    fn left(&self, state: &ResultsState<O>) -> usize {
        self.expected.load(Ordering::SeqCst) - state.settled
    }

    pub(crate) fn outstanding(&self) -> usize {
        self.left(&self.lock())
    }

    /// Adds answers, and wakes the client if it waits for them.
    pub(crate) fn deliver(&self, completed: Vec<Completed<O>>) {
        let arrived = completed.len();
        let mut state = self.lock();
        state.batches.push_back(completed.into_iter());
        let awaited = state.takers;
        drop(state);
        if awaited > 1 && arrived > 1 {
            self.arrived.notify_all();
        } else if awaited > 0 {
            self.arrived.notify_one();
        }
    }

    /// Waits for an answer until `deadline`, or while any is outstanding.
    pub(crate) fn take(&self, deadline: Option<Instant>) -> Option<Completed<O>> {
        let mut state = self.filled(deadline)?;
        let taken = state.batches.front_mut()?.next();
        state.drop_empty();
        self.settle(&mut state, 1);
        taken
    }

    /// Waits like [`ResultsBin::take`]; takes all available answers, up to `max`. Empty: there are none.
    pub(crate) fn take_many(&self, max: usize, deadline: Option<Instant>) -> Vec<Completed<O>> {
        if max == 0 {
            return Vec::new();
        }
        let Some(mut state) = self.filled(deadline) else { return Vec::new() };
        let there: usize = state.batches.iter().map(ExactSizeIterator::len).sum();
        let mut taken = Vec::with_capacity(there.min(max));
        while taken.len() < max
            && let Some(front) = state.batches.front_mut()
        {
            taken.extend(front.take(max - taken.len()));
            state.drop_empty();
        }
        self.settle(&mut state, taken.len());
        taken
    }

    /// Waits until there is an answer. `None`: none came by `deadline`, or none is outstanding.
    fn filled(&self, deadline: Option<Instant>) -> Option<MutexGuard<'_, ResultsState<O>>> {
        let mut state = self.lock();
        while state.batches.is_empty() {
            if self.left(&state) == 0 {
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
        Some(state)
    }
}

/// Returns the instant after `timeout`; `None` if it exceeds the clock's range.
pub(crate) fn deadline_after(timeout: Duration) -> Option<Instant> {
    Instant::now().checked_add(timeout)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_come_in_the_order_of_delivery_however_they_are_taken() {
        let bin = ResultsBin::new();
        bin.expect(10);
        for tickets in [0..3_u64, 3..4, 4..10] {
            let answer = |ticket| Completed {
                ticket,
                output: Ok(()),
                busy: Duration::ZERO,
                waited: Duration::ZERO,
                resource: None,
            };
            bin.deliver(tickets.map(answer).collect());
        }
        let tickets = |max| bin.take_many(max, None).iter().map(|answer| answer.ticket).collect::<Vec<_>>();
        assert_eq!(bin.take(None).map(|answer| answer.ticket), Some(0));
        assert_eq!((tickets(0), tickets(1), tickets(4)), (vec![], vec![1], vec![2, 3, 4, 5]));
        assert_eq!(bin.outstanding(), 4);
        assert_eq!(tickets(99), [6, 7, 8, 9]);
        assert!(bin.take(None).is_none() && tickets(1).is_empty());
    }
}
