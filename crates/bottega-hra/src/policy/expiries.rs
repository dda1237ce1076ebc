//! The count of units that were too old to be of use.

use super::time::Time;

/// Units past their life time: how many, and when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Expiries {
    /// Units whose life time ended before a resource had begun with them.
    pub waiting: u64,
    /// Units that were done, or came back undone, after it.
    pub late: u64,
    /// When there was the first of them.
    pub first: Time,
    /// When there was the last of them.
    pub last: Time,
}

impl Expiries {
    /// All of them.
    pub fn count(&self) -> u64 {
        self.waiting + self.late
    }

    pub(crate) fn note_waiting(&mut self, now: Time, units: u64) {
        self.note(now, units);
        self.waiting += units;
    }

    pub(crate) fn note_late(&mut self, now: Time, units: u64) {
        self.note(now, units);
        self.late += units;
    }

    fn note(&mut self, now: Time, units: u64) {
        if units > 0 {
            self.first = if self.count() == 0 { now } else { self.first };
            self.last = now;
        }
    }

    /// Those since an earlier moment, by whose time they are told.
    pub(crate) fn since(&self, before: &Self, start: Time) -> Self {
        let (waiting, late) = (self.waiting - before.waiting, self.late - before.late);
        if waiting + late == 0 {
            return Self::default();
        }
        let [first, last] = [self.first, self.last].map(|at| Time::at(at.since(start)));
        Self { waiting, late, first, last }
    }
}
