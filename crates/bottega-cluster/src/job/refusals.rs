//! Jobs that a machine refuses to render, and why. They are part of its presence, where the submitters read them: a guest
//! may write nothing else.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, PoisonError},
};

use crate::job::presence::{Presence, Refusal};

/// The most refusals in a presence; older ones are dropped.
const REFUSALS_MAX: usize = 16;
/// The most characters shown of a reason.
const REASON_CHARS_MAX: usize = 400;

/// The jobs that this machine refuses to render; clones share the list.
#[derive(Clone, Debug, Default)]
pub struct Refusals(Arc<Mutex<BTreeMap<u64, Refusal>>>);

impl Refusals {
    /// Adds a refusal.
    pub(crate) fn add(&self, refusal: Refusal) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(refusal.work, refusal);
    }

    /// Returns true if a painting has been refused.
    pub(crate) fn has(&self, work: u64) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).contains_key(&work)
    }

    /// Returns the refusals for the presence: those of the last jobs.
    pub(crate) fn last(&self) -> Vec<Refusal> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut last: Vec<Refusal> = all.values().cloned().collect();
        last.sort_by_key(|refusal| refusal.job);
        last.split_off(last.len().saturating_sub(REFUSALS_MAX))
    }
}

/// Reports each refusal of a machine once.
#[derive(Debug, Default)]
pub struct RefusalWatch(BTreeSet<(String, u64)>);

impl RefusalWatch {
    /// Returns the new refusals since the last call, of the paintings that `is_asked_for` selects.
    pub fn news<'a>(
        &mut self,
        seats: &'a [Presence],
        is_asked_for: impl Fn(u64) -> bool,
    ) -> Vec<(&'a Presence, Refusal)> {
        let mut news = Vec::new();
        for seat in seats {
            for refusal in seat.refusals.iter().take(REFUSALS_MAX).filter(|refusal| is_asked_for(refusal.work)) {
                if self.0.insert((seat.name.clone(), refusal.work)) {
                    news.push((seat, Refusal { reason: legible(&refusal.reason), ..refusal.clone() }));
                }
            }
        }
        news
    }
}

/// Returns untrusted text as one line of limited length.
fn legible(text: &str) -> String {
    text.chars().take(REASON_CHARS_MAX).map(|c| if c.is_control() { ' ' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(job: u32, reason: &str) -> Refusal {
        Refusal { job, work: u64::from(job) + 100, reason: reason.to_owned() }
    }

    #[test]
    fn each_refusal_is_told_once_and_in_one_line() {
        let mut seat = Presence::new("m", 1, None);
        seat.refusals = vec![refusal(1, "no\u{1b}[31m\nroom"), refusal(2, "x")];
        let (mut watch, seats) = (RefusalWatch::default(), [seat]);
        let news = watch.news(&seats, |work| work == 101);
        assert_eq!(news.iter().map(|(_, it)| &*it.reason).collect::<Vec<_>>(), ["no [31m room"]);
        assert!(watch.news(&seats, |work| work == 101).is_empty());
        assert_eq!(watch.news(&seats, |_| true).len(), 1);
    }

    #[test]
    fn the_last_ones_stand_on_the_seat() {
        let refusals = Refusals::default();
        (1..=40).for_each(|job| refusals.add(refusal(job, "x")));
        let last = refusals.last();
        assert_eq!((last.len(), last[0].job, last[REFUSALS_MAX - 1].job), (REFUSALS_MAX, 25, 40));
        assert!(refusals.has(101) && !refusals.has(7));
    }
}
