//! An alarm: wakes threads that sleep under a lock; free of cost if none does.

use std::{
    sync::{
        Condvar, LockResult, MutexGuard, WaitTimeoutResult,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

/// A condition variable that knows whether a thread waits, to save a system call per message otherwise.
///
/// The notifying thread has changed the awaited state under the lock: a thread about to sleep is either counted, or
/// sees the change.
#[derive(Debug, Default)]
pub(super) struct Alarm {
    condition: Condvar,
    asleep: AtomicUsize,
}

impl Alarm {
    pub(super) fn notify_all(&self) {
        if self.asleep.load(Ordering::SeqCst) > 0 {
            self.condition.notify_all();
        }
    }

    pub(super) fn notify_one(&self) {
        if self.asleep.load(Ordering::SeqCst) > 0 {
            self.condition.notify_one();
        }
    }

    pub(super) fn wait<'a, T>(&self, guard: MutexGuard<'a, T>) -> LockResult<MutexGuard<'a, T>> {
        self.asleep.fetch_add(1, Ordering::SeqCst);
        let woken = self.condition.wait(guard);
        self.asleep.fetch_sub(1, Ordering::SeqCst);
        woken
    }

    pub(super) fn wait_timeout<'a, T>(
        &self,
        guard: MutexGuard<'a, T>,
        time: Duration,
    ) -> LockResult<(MutexGuard<'a, T>, WaitTimeoutResult)> {
        self.asleep.fetch_add(1, Ordering::SeqCst);
        let woken = self.condition.wait_timeout(guard, time);
        self.asleep.fetch_sub(1, Ordering::SeqCst);
        woken
    }
}
