//! The Blackboard: a row per zone, work and agent, kept in the platform's store.
//!
//! Source: MAGarRO, section 3.4, "Blackboard service": IdWork, IdZone, Size, Complexity, T_est, T_real, Agent. Further
//! fields serve recovery. All times are in reference-machine time.

mod trust;
mod zone;

use std::sync::Arc;

use bottega_agents::{AgentId, NumberMap, Revision};
use rustc_hash::FxHashMap;

pub use self::zone::{ATTEMPTS_MAX, Cut, Rival, Vote, ZoneRow, ZoneState};
use crate::{Credit, RelativePower, TaskFeatures, WorkId, WorkSettings, ZoneId};

/// The range of a rule input's values in one work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The least value found.
    pub min: f64,
    /// The greatest value found.
    pub max: f64,
}

impl Interval {
    /// Extends an interval by a value.
    fn join(found: Option<Self>, value: f64) -> Self {
        let found = found.unwrap_or(Self { min: value, max: value });
        Self { min: found.min.min(value), max: found.max.max(value) }
    }
}

/// The ranges over which the fuzzy sets of the rules' inputs are laid out at run time (MAGarRO, section 3.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputRanges {
    /// The range of [`ZoneRow::complexity_density`].
    pub complexity_density: Interval,
    /// The range of the zones' mean neighbor differences.
    pub neighbor_difference: Interval,
    /// The range of the zones' sizes, in pixels: [`ZoneRow::size`].
    pub size: Interval,
}

impl InputRanges {
    /// Makes the ranges of the values of these zones; all are 0..=0 without zones.
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

/// The row of a work. The Analyst writes it after the rows of all zones.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkRow {
    /// The id of the work.
    pub work: WorkId,
    /// The user's settings.
    pub settings: WorkSettings,
    /// The number of zones, without pieces cut off later.
    pub zone_count: u32,
    /// The ranges of the rules' inputs.
    pub ranges: InputRanges,
    /// The features of the whole picture, for predicting times.
    pub features: TaskFeatures,
}

/// The row of an agent on the Blackboard: its speed and its record.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentRow {
    /// The name of the agent.
    pub agent: AgentId,
    /// V_cp: the relative power of the agent; 1 is the reference machine, 0.5 is twice as fast.
    pub power: RelativePower,
    /// Number of processors that work on the agent's zones at once; may be a fraction if agents share a machine.
    pub lanes: f64,
    /// The agent's credit: how well its times match its promises.
    pub credit: Credit,
    /// Number of the agent's paintings that others confirmed, if paintings are compared.
    pub agreed: u32,
    /// Number of failures since the agent last painted something.
    pub failures: u32,
    /// The reason why the agent is excluded from the work; `None`: it takes part.
    pub left_out: Option<String>,
}

impl AgentRow {
    /// Makes the row of an agent that has only run its benchmark: its measured `power`, and the number of processors that
    /// work on its zones, `lanes`.
    pub fn new(agent: AgentId, power: RelativePower, lanes: f64) -> Self {
        Self { agent, power, lanes, credit: Credit::default(), agreed: 0, failures: 0, left_out: None }
    }
}

/// A value in the store of a work: a row, or a page of the directories.
#[derive(Clone, Debug, PartialEq)]
pub enum FarmValue {
    /// The row of a zone. Shared: there may be a million, each held by several readers.
    Zone(Arc<ZoneRow>),
    /// The row of a work.
    Work(Arc<WorkRow>),
    /// The row of an agent.
    Agent(Arc<AgentRow>),
    /// An entry of the directories, not a row: see [`DirectoryService`](crate::DirectoryService).
    Page(Arc<str>),
}

/// One reader's view of the rows of a work.
#[derive(Clone, Debug, Default)]
pub struct Blackboard {
    work: Option<Arc<WorkRow>>,
    zones: NumberMap<(Revision, Arc<ZoneRow>)>,
    /// The number of zones made by the Analyst, without pieces.
    root_count: usize,
    /// A hash map for speed; never iterated.
    agents: FxHashMap<AgentId, Arc<AgentRow>>,
}

impl Blackboard {
    /// Takes in a value of the store. A zone's row is ignored if this revision or a later one is known; the row of a
    /// work or an agent always replaces the known one; pages are ignored. Returns true if a zone's row was taken in.
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
            // Pages are not part of a work.
            FarmValue::Page(_) => {}
        }
        false
    }

    /// Returns true if this revision of a zone's row is later than the known one, or no row of the zone is known.
    pub fn is_new_revision(&self, zone: ZoneId, revision: Revision) -> bool {
        self.zones.get(zone.0).is_none_or(|(seen, _)| *seen < revision)
    }

    /// Returns the row of the work; `None` until the Analyst has finished.
    pub fn work(&self) -> Option<&Arc<WorkRow>> {
        self.work.as_ref()
    }

    /// Returns true if the work and all its zones are known.
    pub fn is_complete(&self) -> bool {
        self.work.as_ref().is_some_and(|work| work.zone_count as usize == self.root_count)
    }

    /// Returns the row of a zone with its revision; `None`: no row of the zone is known.
    pub fn zone(&self, zone: ZoneId) -> Option<(Revision, &ZoneRow)> {
        self.zones.get(zone.0).map(|(revision, row)| (*revision, &**row))
    }

    /// Returns the row of a zone, to be shared, with its revision; `None`: no row of the zone is known.
    pub fn shared(&self, zone: ZoneId) -> Option<(Revision, &Arc<ZoneRow>)> {
        self.zones.get(zone.0).map(|(revision, row)| (*revision, row))
    }

    /// Returns the number of zone rows, including pieces.
    pub fn zone_count(&self) -> usize {
        self.zones.len()
    }

    /// Returns the rows of all zones, including pieces, in the order of their ids.
    pub fn zones(&self) -> impl Iterator<Item = &ZoneRow> {
        self.zones.values().map(|(_, row)| &**row)
    }

    /// Returns the row of an agent; `None`: none is known.
    pub fn agent(&self, agent: &AgentId) -> Option<&AgentRow> {
        self.agents.get(agent).map(|row| &**row)
    }

    /// Returns the latest known revision of a zone's row; [`Revision::ABSENT`]: no row of the zone is known.
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
        assert!(!board.is_new_revision(ZoneId(2), Revision(5)) && board.is_new_revision(ZoneId(2), Revision(6)));
        assert!(!board.see(Revision(4), FarmValue::Zone(Arc::new(row()))));
        assert_eq!(board.zone(ZoneId(2)).unwrap().1.attempt, 1);
        assert_eq!((board.revision(ZoneId(2)), board.revision(ZoneId(3))), (Revision(5), Revision::ABSENT));
    }
}
