//! Statistics of expired units.

use super::time::Time;

/// The number and times of expired units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Expiries {
    /// Number of units whose life time ended before a resource began them.
    pub waiting: u64,
    /// Number of units finished, or given back, after the end of their life time.
    pub late: u64,
    /// Time of the first expiry; zero if there is none, or it was before the start of the report.
    pub first: Time,
    /// Time of the last expiry; zero if there is none.
    pub last: Time,
}

impl Expiries {
    /// Returns the number of all expired units.
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

    /// Returns the expiries since an earlier moment; times count from there.
    pub(crate) fn since(&self, before: &Self, start: Time) -> Self {
        let (waiting, late) = (self.waiting - before.waiting, self.late - before.late);
        if waiting + late == 0 {
            return Self::default();
        }
        let [first, last] = [self.first, self.last].map(|at| Time::at(at.since(start)));
        Self { waiting, late, first, last }
    }
}
