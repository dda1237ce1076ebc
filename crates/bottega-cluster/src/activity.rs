//! The activity of a process at the job that it takes part in, as its seat tells it.

use std::sync::{
    Arc,
    atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
};

use serde::{Deserialize, Serialize};

/// What a machine does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Activity {
    /// It has no job, or one in which there is nothing for it to do just now.
    #[default]
    Waiting,
    /// It is at work: it loads a scene, does a part of what comes before the first zone, or paints.
    Busy,
}

impl Activity {
    /// As people read it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Busy => "busy",
        }
    }
}

/// What this process does; shared by those who speak for it.
#[derive(Clone, Debug, Default)]
pub(crate) struct ActivityLog(Arc<ActivityState>);

#[derive(Debug, Default)]
struct ActivityState {
    /// Things that are done before the zones of a job or after them.
    occupations: AtomicUsize,
    /// In one of them others are waited for.
    awaits_others: AtomicBool,
    /// Zones and what they need that are under way.
    under_way: AtomicUsize,
    /// What has begun or ended so far.
    moves: AtomicU64,
}

/// This process does something for a job that is no zone, until this is dropped.
#[derive(Debug)]
pub(crate) struct Occupation(ActivityLog);

impl ActivityLog {
    /// Something begins that is no zone.
    pub(crate) fn occupy(&self) -> Occupation {
        self.0.occupations.fetch_add(1, Ordering::Relaxed);
        self.moved();
        Occupation(self.clone())
    }

    /// In what it does this process waits for others, or does so no more.
    pub(crate) fn awaits_others(&self, awaits: bool) {
        if self.0.awaits_others.swap(awaits, Ordering::Relaxed) != awaits {
            self.moved();
        }
    }

    /// So many zones and what they need are under way.
    pub(crate) fn under_way(&self, count: usize) {
        self.0.under_way.store(count, Ordering::Relaxed);
        self.moved();
    }

    /// Something has begun or ended.
    pub(crate) fn moved(&self) {
        self.0.moves.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn now(&self) -> Activity {
        let ActivityState { occupations, awaits_others, under_way, .. } = &*self.0;
        let is_occupied = occupations.load(Ordering::Relaxed) > 0 && !awaits_others.load(Ordering::Relaxed);
        if is_occupied || under_way.load(Ordering::Relaxed) > 0 { Activity::Busy } else { Activity::Waiting }
    }

    /// What has begun or ended so far.
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
    }
}
