//! Incidents with resources, for the user.

use std::collections::VecDeque;
use std::fmt;

use super::time::Time;
use crate::ResourceId;

/// Incidents that are kept; older ones of other kinds are forgotten.
const KEPT_MAX: usize = 64;

/// A kind of failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Fault {
    /// It gave work back.
    Refused,
    /// It panicked, or its link broke, with work in hand.
    Died,
    /// It answered with what cannot be right.
    Garbage,
    /// It did not answer within the time that its work should have taken several times over.
    Hung,
    /// It kept all waiting longer than another, which had nothing to do, would have taken; there was time left for an answer.
    Doubted,
    /// It ran out of memory.
    OutOfMemory,
    /// It was asked to recover and could not.
    NotRecovered,
    /// It was given up: nothing more is asked of it.
    Retired,
}

impl Fault {
    /// What happened, as a user reads it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Refused => "gave work back",
            Self::Died => "died",
            Self::Garbage => "answered garbage",
            Self::Hung => "hung",
            Self::Doubted => "kept all waiting",
            Self::OutOfMemory => "ran out of memory",
            Self::NotRecovered => "did not recover",
            Self::Retired => "was given up",
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Something that went wrong with a resource. Its units were done elsewhere, if anybody could.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Incident {
    /// Whose.
    pub resource: ResourceId,
    /// What.
    pub fault: Fault,
    /// When it happened first, since the allocator was made.
    pub first: Time,
    /// When it happened last.
    pub last: Time,
    /// How often.
    pub count: u64,
    /// What was said the last time.
    pub reason: String,
}

/// The list of incidents, one entry a resource and kind.
#[derive(Default)]
pub(crate) struct Incidents(VecDeque<Incident>);

impl Incidents {
    pub(crate) fn note(&mut self, now: Time, resource: ResourceId, fault: Fault, reason: &str) {
        let known = self.0.iter_mut().find(|incident| (incident.resource, incident.fault) == (resource, fault));
        if let Some(incident) = known {
            (incident.last, incident.count) = (now, incident.count + 1);
            reason.clone_into(&mut incident.reason);
            return;
        }
        if self.0.len() >= KEPT_MAX {
            self.0.pop_front();
        }
        self.0.push_back(Incident { resource, fault, first: now, last: now, count: 1, reason: reason.to_owned() });
    }

    pub(crate) fn list(&self) -> Vec<Incident> {
        self.0.iter().cloned().collect()
    }
}
