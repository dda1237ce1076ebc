//! Machines of a farm: who is there, and what they are told.
//!
//! - `order/NAME`: what a machine shall do; it obeys, and its seat says so (see [`worker`](crate::worker)).

use std::{
    collections::BTreeMap,
    thread,
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize};

pub use crate::presence::PresenceState;
use crate::{
    error::Error,
    job_board::{JobBoard, order_name},
    presence::Presence,
};

/// How long one who has just come looks whether seats are renewed: those who sit there do so twice a second.
const LOOK_FOR: Duration = Duration::from_millis(1500);
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// An order to a machine.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MachineOrder {
    /// What it shall be.
    pub standing: PresenceState,
    /// Who says so, for people.
    pub by: String,
}

/// Tells seats where somebody sits from those that were left without a word: a seat counts once it was seen to be
/// renewed.
#[derive(Debug, Default)]
pub struct Roster {
    /// The first writing that was seen of each seat.
    first: BTreeMap<String, u64>,
}

impl Roster {
    /// Takes the seats that are not silent, with the numbers of their last writings; returns those that count.
    pub fn look(&mut self, seats: Vec<(Presence, u64)>) -> Vec<Presence> {
        let mut first = BTreeMap::new();
        let mut there = Vec::new();
        for (seat, revision) in seats {
            let seen = self.first.get(&seat.name).copied().unwrap_or(revision);
            first.insert(seat.name.clone(), seen);
            if seen != revision {
                there.push(seat);
            }
        }
        self.first = first;
        there
    }

    /// How many seats there are for which it is not known yet.
    fn open(&self, there: usize) -> usize {
        self.first.len() - there
    }
}

impl JobBoard {
    /// What a machine is told. Nothing: to paint.
    pub fn order_to(&self, machine: &str) -> MachineOrder {
        self.read_notice(&order_name(machine)).unwrap_or_default()
    }

    /// Tells a machine what to do.
    pub fn tell(&self, machine: &str, order: &MachineOrder) -> Result<(), Error> {
        self.refuse_guests()?;
        self.put_notice(&order_name(machine), order)
    }

    /// The machines that are there, for one who has linked up a moment ago and cannot know since when seats are silent.
    pub fn present(&self) -> Vec<Presence> {
        let mut roster = Roster::default();
        let begun = Instant::now();
        loop {
            let there = roster.look(self.seated());
            if roster.open(there.len()) == 0 || begun.elapsed() >= LOOK_FOR {
                return there;
            }
            thread::sleep(LOOK_EVERY);
        }
    }
}

impl JobBoard {
    /// Why nobody may paint a job now that machines with some tags alone may paint: none of them is there. `None`: one is.
    pub(crate) fn lacks_tagged(&self, tags: &[String]) -> Option<String> {
        let has_all = |seat: &Presence| seat.takes_orders && tags.iter().all(|tag| seat.tags.contains(tag));
        if tags.is_empty() || self.present().iter().any(has_all) {
            return None;
        }
        let (named, options): (Vec<_>, Vec<_>) =
            tags.iter().map(|tag| (format!("`{tag}`"), format!("--tag {tag}"))).unzip();
        Some(format!(
            "no machine that is there is tagged {}: the job waits until one joins by `bottega join {}`",
            named.join(" and "),
            options.join(" ")
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seat_counts_once_it_was_renewed_and_until_it_is_silent() {
        let mut roster = Roster::default();
        let seat = |name: &str| Presence::new(name, 1, None);
        let mut look = |seats: &[(&str, u64)]| {
            let seats = seats.iter().map(|(name, revision)| (seat(name), *revision)).collect();
            roster.look(seats).into_iter().map(|seat| seat.name).collect::<Vec<_>>()
        };
        assert!(look(&[("a", 1), ("left", 2)]).is_empty());
        assert_eq!(look(&[("a", 3), ("left", 2)]), ["a"]);
        assert_eq!(look(&[("a", 3), ("b", 4)]), ["a"]);
        assert_eq!(look(&[("b", 5)]), ["b"]);
        // One that comes back must be renewed again.
        assert_eq!(look(&[("a", 3), ("b", 5)]), ["b"]);
        assert_eq!(look(&[("a", 6), ("b", 5)]), ["a", "b"]);
    }
}
