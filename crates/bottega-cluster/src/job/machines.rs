//! The machines of a farm: which are present, and commands to them.
//!
//! - `order/NAME`: the command to a machine, which obeys and shows its state in its presence: see
//!   [`worker`](crate::machine::worker).

use std::{
    collections::BTreeMap,
    thread,
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    job::{
        board::{JobBoard, order_name},
        presence::{Presence, PresenceState},
    },
};

/// The time for which a process that just connected watches for renewals; live machines renew twice a second.
const LOOK_FOR: Duration = Duration::from_millis(1500);
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// A command to a machine.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MachineOrder {
    /// The state that the machine must take.
    pub standing: PresenceState,
    /// The name of the user who gave it, for display.
    pub by: String,
}

/// The presences that a process has seen: distinguishes live ones from stale ones of crashed machines. A presence counts once it
/// was renewed.
#[derive(Debug, Default)]
pub struct Roster {
    /// The first revision seen of each presence.
    first: BTreeMap<String, u64>,
}

impl Roster {
    /// Takes the current presences, each with its revision. Returns those that are live: renewed since the call that saw them
    /// first. The first call returns none.
    pub fn look(&mut self, presences: Vec<(Presence, u64)>) -> Vec<Presence> {
        let mut first = BTreeMap::new();
        let mut live = Vec::new();
        for (machine, revision) in presences {
            let first_revision = self.first.get(&machine.name).copied().unwrap_or(revision);
            first.insert(machine.name.clone(), first_revision);
            if first_revision != revision {
                live.push(machine);
            }
        }
        self.first = first;
        live
    }

    /// Returns the number of presences that are still undecided.
    fn open(&self, live: usize) -> usize {
        self.first.len() - live
    }
}

impl JobBoard {
    /// Returns the last command to a machine; without a readable one, the command to work.
    ///
    /// - `machine`: the name of its process.
    pub fn order_to(&self, machine: &str) -> MachineOrder {
        self.read_notice(&order_name(machine)).unwrap_or_default()
    }

    /// Gives a machine a command.
    ///
    /// - `machine`: the name of its process.
    ///
    /// # Errors
    /// This machine is a guest, or the farm does not store the command.
    pub fn tell(&self, machine: &str, order: &MachineOrder) -> Result<(), Error> {
        self.refuse_guests()?;
        self.put_notice(&order_name(machine), order)
    }

    /// Returns the live machines. Waits up to 1.5 s for machines to renew their presences, because a process that just connected
    /// cannot know how old a presence is.
    pub fn present(&self) -> Vec<Presence> {
        let mut roster = Roster::default();
        let begun = Instant::now();
        loop {
            let live = roster.look(self.presences_with_revision());
            if roster.open(live.len()) == 0 || begun.elapsed() >= LOOK_FOR {
                return live;
            }
            thread::sleep(LOOK_EVERY);
        }
    }
}

impl JobBoard {
    /// Returns the reason why no machine may render a job with these tags: none with all of them is present. `None`: one is.
    pub(crate) fn lacks_tagged(&self, tags: &[String]) -> Option<String> {
        let has_all = |machine: &Presence| machine.takes_orders && tags.iter().all(|tag| machine.tags.contains(tag));
        if tags.is_empty() || self.present().iter().any(has_all) {
            return None;
        }
        let (named, options): (Vec<_>, Vec<_>) =
            tags.iter().map(|tag| (format!("`{tag}`"), format!("--tag {tag}"))).unzip();
        Some(format!(
            "no machine present is tagged {}: the job waits until one joins by `bottega join {}`",
            named.join(" and "),
            options.join(" ")
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_is_live_once_it_renews_its_presence_until_it_is_silent() {
        let mut roster = Roster::default();
        let presence = |name: &str| Presence::new(name, 1, None);
        let mut look = |presences: &[(&str, u64)]| {
            let presences = presences.iter().map(|(name, revision)| (presence(name), *revision)).collect();
            roster.look(presences).into_iter().map(|presence| presence.name).collect::<Vec<_>>()
        };
        assert!(look(&[("a", 1), ("left", 2)]).is_empty());
        assert_eq!(look(&[("a", 3), ("left", 2)]), ["a"]);
        assert_eq!(look(&[("a", 3), ("b", 4)]), ["a"]);
        assert_eq!(look(&[("b", 5)]), ["b"]);
        // A machine that comes back must be renewed again.
        assert_eq!(look(&[("a", 3), ("b", 5)]), ["b"]);
        assert_eq!(look(&[("a", 6), ("b", 5)]), ["a", "b"]);
    }
}
