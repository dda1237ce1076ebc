//! The memory limit of a scene, checked before allocation.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::error::SceneError;

/// Counts the bytes of a scene before they are allocated. Several threads may use it.
#[derive(Debug)]
pub(crate) struct MemoryBudget {
    limit: usize,
    taken: AtomicUsize,
}

impl MemoryBudget {
    /// Makes a budget of `limit` bytes.
    pub(crate) fn new(limit: usize) -> Self {
        Self { limit, taken: AtomicUsize::new(0) }
    }

    /// Returns the limit, in bytes.
    pub(crate) fn limit(&self) -> usize {
        self.limit
    }

    /// Books bytes for something at `place`; an error if the limit is exceeded.
    pub(crate) fn take(&self, path: &Path, place: &str, bytes: usize) -> Result<(), SceneError> {
        let before = self.taken.fetch_add(bytes.min(self.limit.saturating_add(1)), Ordering::Relaxed);
        if before.saturating_add(bytes) <= self.limit { Ok(()) } else { Err(self.exceeded(path, place)) }
    }

    /// Returns the bytes that remain.
    pub(crate) fn left(&self) -> usize {
        self.limit.saturating_sub(self.taken.load(Ordering::Relaxed))
    }

    /// Books bytes until the result is dropped: for temporary data.
    pub(crate) fn hold(&self, path: &Path, bytes: usize) -> Result<HeldBytes<'_>, SceneError> {
        self.take(path, "", bytes)?;
        Ok(HeldBytes { budget: self, bytes })
    }

    /// Checks bytes against the limit without booking them: for data that is freed soon.
    pub(crate) fn check(&self, path: &Path, bytes: usize) -> Result<(), SceneError> {
        if bytes <= self.limit { Ok(()) } else { Err(self.exceeded(path, "")) }
    }

    fn exceeded(&self, path: &Path, place: &str) -> SceneError {
        SceneError::Limit {
            path: path.into(),
            place: place.into(),
            problem: format!("the scene takes more than the limit of {} MiB of memory", self.limit >> 20),
            remedy: "simplify it or scale its pictures down, or allow more memory",
        }
    }
}

/// Bytes that are returned to the budget on drop.
#[derive(Debug)]
pub(crate) struct HeldBytes<'a> {
    budget: &'a MemoryBudget,
    bytes: usize,
}

impl Drop for HeldBytes<'_> {
    fn drop(&mut self) {
        self.budget.taken.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}
