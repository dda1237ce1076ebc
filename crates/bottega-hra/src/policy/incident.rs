//! Incidents: faults of resources, reported to the user.

use std::collections::VecDeque;
use std::fmt;

use super::time::Time;
use crate::ResourceId;

/// Maximum number of incidents kept; older ones of other kinds are dropped.
const KEPT_MAX: usize = 64;

/// The kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Fault {
    /// The resource gave work back.
    Refused,
    /// The resource panicked, its link broke, or it dropped a packet without an answer.
    Died,
    /// The answer of the resource was invalid.
    Garbage,
    /// The resource did not answer within several times the expected time.
    Hung,
    /// The resource delayed everything longer than another, idle resource needs for the work; its deadline was not over.
    Doubted,
    /// The resource ran out of memory.
    OutOfMemory,
    /// The resource failed to recover.
    NotRecovered,
    /// The resource was given up after too many failures, or could not be started; it is not used again.
    Retired,
}

impl Fault {
    /// Returns the fault as a predicate, such as `gave work back`: for messages, and in the JSON of
    /// [`timeline_json`](crate::timeline_json).
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

/// A kind of fault of a resource, with its occurrences. Its units were done elsewhere, if possible.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Incident {
    /// The id of the resource.
    pub resource: ResourceId,
    /// The kind of fault.
    pub fault: Fault,
    /// Time of the first occurrence; zero if it was before the start of the report.
    pub first: Time,
    /// Time of the last occurrence.
    pub last: Time,
    /// Number of occurrences.
    pub count: u64,
    /// The reason given at the last occurrence.
    pub reason: String,
}

/// All incidents, one entry per resource and kind.
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
