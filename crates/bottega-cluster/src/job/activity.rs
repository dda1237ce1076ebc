//! The activity of a process at its current job, as its [`Presence`](crate::job::presence::Presence) publishes it.

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
};

use serde::{Deserialize, Serialize};

/// The activity of a machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Activity {
    /// The machine has no job, or its job has no work for it at the moment.
    #[default]
    Waiting,
    /// The machine loads a scene, takes part in the work before the first zone, or renders zones.
    Busy,
    /// The machine has no job and renders samples for a viewport.
    Viewing,
}

impl Activity {
    /// Returns the name of the activity, such as `busy`: in messages, JSON and the HTTP API.
    pub fn word(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Busy => "busy",
            Self::Viewing => "viewing",
        }
    }
}

/// The activity of this process; clones share it.
#[derive(Clone, Debug, Default)]
pub(crate) struct ActivityLog(Arc<ActivityState>);

#[derive(Debug, Default)]
struct ActivityState {
    /// Number of [`Occupation`]s alive: work before or after the zones of a job.
    occupations: AtomicUsize,
    /// True while an occupation only waits for other processes.
    awaits_others: AtomicBool,
    /// Number of zones, with the data they need, in progress.
    under_way: AtomicUsize,
    /// Number of [`Viewing`] guards alive.
    viewings: AtomicUsize,
    /// Number of changes so far, as a sign of life.
    moves: AtomicU64,
}

/// A guard that counts as work other than zones until it is dropped.
#[derive(Debug)]
pub(crate) struct Occupation(ActivityLog);

/// A guard that counts as rendering for a viewport until it is dropped.
#[derive(Debug)]
pub(crate) struct Viewing(ActivityLog);

impl Drop for Viewing {
    fn drop(&mut self) {
        self.0.0.viewings.fetch_sub(1, Ordering::Relaxed);
        self.0.moved();
    }
}

impl ActivityLog {
    /// Starts to render for a viewport; it ends when the guard is dropped.
    pub(crate) fn view(&self) -> Viewing {
        self.0.viewings.fetch_add(1, Ordering::Relaxed);
        self.moved();
        Viewing(self.clone())
    }

    /// Starts work other than a zone; it ends when the guard is dropped.
    pub(crate) fn occupy(&self) -> Occupation {
        self.0.occupations.fetch_add(1, Ordering::Relaxed);
        self.moved();
        Occupation(self.clone())
    }

    /// Records if the current occupation only waits for other processes.
    pub(crate) fn awaits_others(&self, awaits: bool) {
        if self.0.awaits_others.swap(awaits, Ordering::Relaxed) != awaits {
            self.moved();
        }
    }

    /// Sets the number of zones, with the data they need, in progress.
    pub(crate) fn under_way(&self, count: usize) {
        self.0.under_way.store(count, Ordering::Relaxed);
        self.moved();
    }

    /// Counts a change: something started or ended.
    pub(crate) fn moved(&self) {
        self.0.moves.fetch_add(1, Ordering::Relaxed);
    }

    /// Returns the current activity.
    pub(crate) fn now(&self) -> Activity {
        let ActivityState { occupations, awaits_others, under_way, viewings, .. } = &*self.0;
        let is_occupied = occupations.load(Ordering::Relaxed) > 0 && !awaits_others.load(Ordering::Relaxed);
        if is_occupied || under_way.load(Ordering::Relaxed) > 0 {
            Activity::Busy
        } else if viewings.load(Ordering::Relaxed) > 0 {
            Activity::Viewing
        } else {
            Activity::Waiting
        }
    }

    /// Returns the number of changes so far.
    pub(crate) fn moves(&self) -> u64 {
        self.0.moves.load(Ordering::Relaxed)
    }
}

impl Drop for Occupation {
    fn drop(&mut self) {
        self.0.0.occupations.fetch_sub(1, Ordering::Relaxed);
        self.0.moved();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_has_something_to_do_is_busy_unless_it_waits_for_others() {
        let log = ActivityLog::default();
        let outer = log.occupy();
        let inner = log.occupy();
        drop(outer);
        assert_eq!(log.now(), Activity::Busy);
        log.awaits_others(true);
        let before = log.moves();
        log.awaits_others(true);
        assert_eq!((log.now(), log.moves()), (Activity::Waiting, before), "it still waits");
        log.under_way(1);
        assert_eq!(log.now(), Activity::Busy);
        log.under_way(0);
        log.awaits_others(false);
        assert_eq!(log.now(), Activity::Busy);
        drop(inner);
        assert_eq!(log.now(), Activity::Waiting);
        let viewing = log.view();
        assert_eq!(log.now(), Activity::Viewing);
        drop(viewing);
        assert_eq!(log.now(), Activity::Waiting);
    }
}
