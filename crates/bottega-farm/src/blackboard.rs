//! The Blackboard: one row a zone, one a work, one an agent, over the store of the platform.
//!
//! Source: MAGarRO, section 3.4, "Blackboard service": IdWork, IdZone, Size, Complexity, T_est, T_real, Agent. Beside
//! them stands what recovery needs. All times are in reference-machine time.

mod trust;
mod zone;

use std::sync::Arc;

use bottega_agents::{AgentId, NumberMap, Revision};
use rustc_hash::FxHashMap;

pub use self::zone::{ATTEMPTS_MAX, Cut, Rival, Vote, ZoneRow, ZoneState};
use crate::{Credit, RelativePower, TaskFeatures, WorkId, WorkSettings, ZoneId};

/// The interval in which an input of the rules lies in this work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The least value found.
    pub min: f64,
    /// The greatest value found.
    pub max: f64,
}

impl Interval {
    /// The interval with one more value in it.
    fn join(found: Option<Self>, value: f64) -> Self {
        let found = found.unwrap_or(Self { min: value, max: value });
        Self { min: found.min.min(value), max: found.max.max(value) }
    }
}

/// The scene's ranges, over which the input sets of the rules are laid out at run time (MAGarRO, section 3.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputRanges {
    /// Of [`ZoneRow::complexity_density`].
    pub complexity_density: Interval,
    /// Of neighbor differences.
    pub neighbor_difference: Interval,
    /// Of sizes in pixels.
    pub size: Interval,
}

impl InputRanges {
    /// The ranges of these zones.
    pub fn of<R: std::borrow::Borrow<ZoneRow>>(rows: impl IntoIterator<Item = R>) -> Self {
        let mut ranges = [None; 3];
        for row in rows {
            let row = row.borrow();
            let values = [row.complexity_density(), row.neighbor_difference.mean, row.size() as f64];
            for (range, value) in ranges.iter_mut().zip(values) {
                *range = Some(Interval::join(*range, value));
            }
        }
        let [complexity_density, neighbor_difference, size] =
            ranges.map(|range| range.unwrap_or(Interval { min: 0.0, max: 0.0 }));
        Self { complexity_density, neighbor_difference, size }
    }
}

/// The row of a work. Written by the Analyst after all its zones.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkRow {
    /// Which.
    pub work: WorkId,
    /// What the user asked for.
    pub settings: WorkSettings,
    /// How many zones it has.
    pub zone_count: u32,
    /// Over what the rules' inputs are laid out.
    pub ranges: InputRanges,
    /// What kind of picture it is.
    pub features: TaskFeatures,
}

/// The row of an agent.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentRow {
    /// Who.
    pub agent: AgentId,
    /// V_cp.
    pub power: RelativePower,
    /// Processors that work on its zones at once; may be a fraction where agents share a machine.
    pub lanes: f64,
    /// How far its promises held.
    pub credit: Credit,
    /// How often others made the same of a zone as it did, where that is compared.
    pub agreed: u32,
    /// How often it has failed since it last painted something.
    pub failures: u32,
    /// Why it is left out of the work, if it is.
    pub left_out: Option<String>,
}

impl AgentRow {
    /// An agent of which only its benchmark has spoken.
    pub fn new(agent: AgentId, power: RelativePower, lanes: f64) -> Self {
        Self { agent, power, lanes, credit: Credit::default(), agreed: 0, failures: 0, left_out: None }
    }
}

/// Any row.
#[derive(Clone, Debug, PartialEq)]
pub enum FarmValue {
    /// Of a zone. Shared, for a million of them may be on the blackboard, and each is seen by several.
    Zone(Arc<ZoneRow>),
    /// Of a work.
    Work(Arc<WorkRow>),
    /// Of an agent.
    Agent(Arc<AgentRow>),
    /// No row, but an entry of the directories: see [`DirectoryService`](crate::DirectoryService).
    Page(Arc<str>),
}

/// One reader's view of the rows of a work.
#[derive(Clone, Debug, Default)]
pub struct Blackboard {
    work: Option<Arc<WorkRow>>,
    zones: NumberMap<(Revision, Arc<ZoneRow>)>,
    /// How many of them are the Analyst's.
    root_count: usize,
    /// A hash map, for speed: never gone through.
    agents: FxHashMap<AgentId, Arc<AgentRow>>,
}

impl Blackboard {
    /// Takes in a row as it is, unless a later one is known. Returns whether a zone's row is new or has changed.
    pub fn see(&mut self, revision: Revision, value: FarmValue) -> bool {
        match value {
            FarmValue::Zone(row) => {
                let (zone, is_root) = (row.zone.0, row.root.is_none());
                match self.zones.get_mut(zone) {
                    Some((seen, _)) if *seen >= revision => return false,
                    Some(known) => *known = (revision, row),
                    None => {
                        self.zones.insert(zone, (revision, row));
                        self.root_count += usize::from(is_root);
                    }
                }
                return true;
            }
            FarmValue::Work(row) => self.work = Some(row),
            FarmValue::Agent(row) => match self.agents.get_mut(&row.agent) {
                Some(known) => *known = row,
                None => _ = self.agents.insert(row.agent.clone(), row),
            },
            // It lies beside the rows, and is nothing of a work.
            FarmValue::Page(_) => {}
        }
        false
    }

    /// Whether a zone's row of this revision would be news.
    pub fn is_news(&self, zone: ZoneId, revision: Revision) -> bool {
        self.zones.get(zone.0).is_none_or(|(seen, _)| *seen < revision)
    }

    /// The row of the work, once the Analyst has finished.
    pub fn work(&self) -> Option<&Arc<WorkRow>> {
        self.work.as_ref()
    }

    /// Whether the work and all its zones are known.
    pub fn is_complete(&self) -> bool {
        self.work.as_ref().is_some_and(|work| work.zone_count as usize == self.root_count)
    }

    /// A zone with the revision of its row.
    pub fn zone(&self, zone: ZoneId) -> Option<(Revision, &ZoneRow)> {
        self.zones.get(zone.0).map(|(revision, row)| (*revision, &**row))
    }

    /// A zone as it is shared, with the revision of its row.
    pub fn shared(&self, zone: ZoneId) -> Option<(Revision, &Arc<ZoneRow>)> {
        self.zones.get(zone.0).map(|(revision, row)| (*revision, row))
    }

    /// How many rows of zones there are, with those of pieces.
    pub fn zone_count(&self) -> usize {
        self.zones.len()
    }

    /// All zones in the order of their ids.
    pub fn zones(&self) -> impl Iterator<Item = &ZoneRow> {
        self.zones.values().map(|(_, row)| &**row)
    }

    /// What is known of an agent.
    pub fn agent(&self, agent: &AgentId) -> Option<&AgentRow> {
        self.agents.get(agent).map(|row| &**row)
    }

    /// The revision of a zone's row, as far as it was seen.
    pub fn revision(&self, zone: ZoneId) -> Revision {
        self.zones.get(zone.0).map_or(Revision::ABSENT, |(revision, _)| *revision)
    }
}

#[cfg(test)]
mod tests {
    use bottega_image::Rect;

    use super::*;
    use crate::NeighborDifference;

    fn row() -> ZoneRow {
        ZoneRow::open(WorkId(1), ZoneId(2), Rect::of_size(4, 4), 16.0, NeighborDifference::default())
    }

    #[test]
    fn an_old_row_does_not_replace_a_new_one() {
        let mut board = Blackboard::default();
        assert!(board.see(Revision(5), FarmValue::Zone(Arc::new(ZoneRow { attempt: 1, ..row() }))));
        assert!(!board.is_news(ZoneId(2), Revision(5)) && board.is_news(ZoneId(2), Revision(6)));
        assert!(!board.see(Revision(4), FarmValue::Zone(Arc::new(row()))));
        assert_eq!(board.zone(ZoneId(2)).unwrap().1.attempt, 1);
        assert_eq!((board.revision(ZoneId(2)), board.revision(ZoneId(3))), (Revision(5), Revision::ABSENT));
    }
}
