//! The alarm: the time at which the watch wakes next.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use super::sync::Post;
use crate::policy::time::Time;

/// The time at which the watch wakes next.
pub(crate) struct Alarm {
    pub(super) at: AtomicU64,
    pub(super) ended: AtomicBool,
    pub(super) post: Post,
}

impl Default for Alarm {
    fn default() -> Self {
        Self { at: AtomicU64::new(u64::MAX), ended: AtomicBool::new(false), post: Post::default() }
    }
}

impl Alarm {
    /// Makes the watch wake at this time at the latest.
    pub(crate) fn set(&self, at: Time) {
        if self.at.load(Ordering::SeqCst) > at.nanos() && self.at.fetch_min(at.nanos(), Ordering::SeqCst) > at.nanos() {
            self.post.wake();
        }
    }

    /// Ends the watch.
    pub(crate) fn end(&self) {
        self.ended.store(true, Ordering::SeqCst);
        self.post.wake();
    }
}
