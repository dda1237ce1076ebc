//! The memory limit that a machine's owner sets: the machine leaves a job that exceeds it.

use std::{
    process,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use bottega_platform::processes;

use crate::{error::Error, server::room::bytes_said};

/// Interval between checks.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// A limit on the resident memory of this process and the engines that it has started.
#[derive(Clone, Debug)]
pub(crate) struct MemoryLimit {
    bytes: u64,
    /// True if the limit was exceeded since the last job was left.
    is_passed: Arc<AtomicBool>,
    looked: Arc<Mutex<Option<Instant>>>,
}

impl MemoryLimit {
    /// Returns a limit in bytes.
    pub(crate) fn new(bytes: u64) -> Self {
        Self { bytes, is_passed: Arc::default(), looked: Arc::default() }
    }

    /// Returns true if the limit is exceeded, or was since the last [`Self::forget`].
    pub(crate) fn is_passed(&self) -> bool {
        let mut looked = self.looked.lock().unwrap_or_else(PoisonError::into_inner);
        if looked.is_none_or(|then| then.elapsed() >= LOOK_EVERY) {
            *looked = Some(Instant::now());
            if processes::usage(process::id()).resident_bytes > self.bytes {
                self.is_passed.store(true, Ordering::Relaxed);
            }
        }
        self.is_passed.load(Ordering::Relaxed)
    }

    /// Resets the limit for the next job.
    pub(crate) fn forget(&self) {
        self.is_passed.store(false, Ordering::Relaxed);
        *self.looked.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Returns the error of a job that exceeds the limit.
    pub(crate) fn error(&self) -> Error {
        let problem = format!("the job needs more memory here than {}", bytes_said(self.bytes));
        Error::failed(problem, "raise the limit of the machine: --max-memory")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_passed_until_it_is_forgotten() {
        let (none, all) = (MemoryLimit::new(0), MemoryLimit::new(u64::MAX));
        assert!(none.is_passed() && !all.is_passed());
        let again = MemoryLimit { bytes: u64::MAX, ..none.clone() };
        assert!(again.is_passed(), "what was seen is not forgotten by itself");
        again.forget();
        assert!(!again.is_passed());
    }
}
