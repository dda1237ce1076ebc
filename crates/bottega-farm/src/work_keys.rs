//! Keys of a work's rows in the platform's store.

use std::sync::Arc;

use bottega_agents::{AgentId, Key, Revision, StoreRequest};

use crate::{FarmValue, WorkId, ZoneId};

/// The keys of a work's rows. Made once per work; an entry's key then needs no formatting.
#[derive(Clone, Debug)]
pub struct WorkKeys {
    folder: Arc<str>,
    zones: Arc<str>,
    agents: Arc<str>,
}

impl WorkKeys {
    /// Makes the keys of this work.
    pub fn new(work: WorkId) -> Self {
        let folder = |rest: &str| Arc::from(format!("work/{}/{rest}", work.0));
        Self { folder: folder(""), zones: folder("zone/"), agents: folder("agent/") }
    }

    /// Returns the common prefix of all keys.
    pub fn prefix(&self) -> Key {
        Key::from(&*self.folder)
    }

    /// Returns the key of a zone's row.
    pub fn zone(&self, zone: ZoneId) -> Key {
        Key::numbered(&self.zones, u64::from(zone.0))
    }

    /// Returns the key of the work's row.
    pub fn work(&self) -> Key {
        Key::from(format!("{}settings", self.folder))
    }

    /// Returns the key of an agent's row.
    pub fn agent(&self, agent: &AgentId) -> Key {
        Key::named(&self.agents, &agent.name)
    }

    /// Returns the key of any row.
    ///
    /// # Panics
    /// If the value is a page of the directories.
    pub fn of(&self, value: &FarmValue) -> Key {
        match value {
            FarmValue::Zone(row) => self.zone(row.zone),
            FarmValue::Work(_) => self.work(),
            FarmValue::Agent(row) => self.agent(&row.agent),
            FarmValue::Page(_) => unreachable!("pages are written by the services of the platform alone"),
        }
    }
}

/// Returns the request to write a row only if it still has this revision.
///
/// - `expected_revision`: [`Revision::ABSENT`] if the row must not exist.
///
/// # Panics
/// If the value is a page of the directories.
pub fn compare_and_set(keys: &WorkKeys, expected_revision: Revision, value: FarmValue) -> StoreRequest<FarmValue> {
    StoreRequest::CompareAndSet { key: keys.of(&value), expected_revision, value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keys_of_rows_begin_with_that_of_their_work() {
        let keys = WorkKeys::new(WorkId(7));
        let agent = AgentId::new("agent-3");
        let all = [keys.work(), keys.zone(ZoneId(12)), keys.agent(&agent)];
        assert_eq!(all.each_ref().map(Key::to_string), ["work/7/settings", "work/7/zone/12", "work/7/agent/agent-3"]);
        assert!(all.iter().all(|key| key.starts_with(&keys.prefix())));
    }
}
