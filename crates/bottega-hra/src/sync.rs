//! Locks that outlive a panic, and waiting with or without an end.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
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
