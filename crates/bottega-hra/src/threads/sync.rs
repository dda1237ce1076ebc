//! Synchronization: locks that survive a panic, waiting with and without a timeout, and parking posts of threads.

use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, Thread};
use std::time::Duration;

/// Locks, even after a panic under the lock: data is consistent at every step that may panic.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Waits to be notified, at most for `patience`. May return early.
pub(crate) fn wait<'a, T>(
    condvar: &Condvar,
    guard: MutexGuard<'a, T>,
    patience: Option<Duration>,
) -> MutexGuard<'a, T> {
    match patience {
        None => condvar.wait(guard).unwrap_or_else(PoisonError::into_inner),
        Some(patience) => condvar.wait_timeout(guard, patience).unwrap_or_else(PoisonError::into_inner).0,
    }
}

/// A place at which one thread waits. Waking it before it waits is not lost.
#[derive(Default)]
pub(crate) struct Post(OnceLock<Thread>);

impl Post {
    /// Registers the calling thread; must be called before it checks the condition it waits for.
    pub(crate) fn man(&self) {
        let _ = self.0.set(thread::current());
    }

    /// Waits at most for `patience`; may return early.
    pub(crate) fn wait(&self, patience: Option<Duration>) {
        match patience {
            None => thread::park(),
            Some(patience) => thread::park_timeout(patience),
        }
    }

    pub(crate) fn wake(&self) {
        if let Some(thread) = self.0.get() {
            thread.unpark();
        }
    }
}
