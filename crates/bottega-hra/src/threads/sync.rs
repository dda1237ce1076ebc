//! Locks that outlive a panic, waiting with or without an end, and posts at which threads can be woken.

use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, Thread};
use std::time::Duration;

/// Locks, also after a panic under the lock: the crate leaves its data consistent at every step that may panic.
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

/// Where one thread waits. Who wakes it before it waits has woken it all the same.
#[derive(Default)]
pub(crate) struct Post(OnceLock<Thread>);

impl Post {
    /// The calling thread is the one that waits here; to be called before it looks at what it would wait for.
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
