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
        let refusals = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut last: Vec<Refusal> = refusals.values().cloned().collect();
        last.sort_by_key(|refusal| refusal.job);
        last.split_off(last.len().saturating_sub(REFUSALS_MAX))
    }
}

/// The refusals of machines that were reported already, so that each is reported once.
#[derive(Debug, Default)]
pub struct RefusalWatch(BTreeSet<(String, u64)>);

impl RefusalWatch {
    /// Returns the refusals that were not reported before, each with its machine and with its reason as one line of at most 400
    /// characters. Of each machine, only the first 16 refusals are read.
    ///
    /// - `machines`: the machines that are present.
    /// - `is_wanted`: selects paintings by their numbers.
    pub fn new_refusals<'a>(
        &mut self,
        machines: &'a [Presence],
        is_wanted: impl Fn(u64) -> bool,
    ) -> Vec<(&'a Presence, Refusal)> {
        let mut refusals = Vec::new();
        for machine in machines {
            for refusal in machine.refusals.iter().take(REFUSALS_MAX).filter(|refusal| is_wanted(refusal.work)) {
                if self.0.insert((machine.name.clone(), refusal.work)) {
                    refusals.push((machine, Refusal { reason: legible(&refusal.reason), ..refusal.clone() }));
                }
            }
        }
        refusals
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
    fn each_refusal_is_reported_once_and_in_one_line() {
        let mut presence = Presence::new("m", 1, None);
        presence.refusals = vec![refusal(1, "no\u{1b}[31m\nroom"), refusal(2, "x")];
        let (mut watch, presences) = (RefusalWatch::default(), [presence]);
        let new = watch.new_refusals(&presences, |work| work == 101);
        assert_eq!(new.iter().map(|(_, refusal)| &*refusal.reason).collect::<Vec<_>>(), ["no [31m room"]);
        assert!(watch.new_refusals(&presences, |work| work == 101).is_empty());
        assert_eq!(watch.new_refusals(&presences, |_| true).len(), 1);
    }

    #[test]
    fn a_presence_shows_the_last_refusals() {
        let refusals = Refusals::default();
        (1..=40).for_each(|job| refusals.add(refusal(job, "x")));
        let last = refusals.last();
        assert_eq!((last.len(), last[0].job, last[REFUSALS_MAX - 1].job), (REFUSALS_MAX, 25, 40));
        assert!(refusals.has(101) && !refusals.has(7));
    }
}
