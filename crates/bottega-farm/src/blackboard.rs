//! The Blackboard: one row a zone, one a work, one an agent, over the store of the platform.
//!
//! Source: MAGarRO, section 3.4, "Blackboard service": IdWork, IdZone, Size, Complexity, T_est, T_real, Agent. Beside
//! them stands what recovery needs. All times are in reference-machine time.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::{AgentId, Entry, Key, Revision, StoreRequest, bus::BlobId};
use bottega_image::Rect;

use crate::{Choice, RelativePower, WorkId, WorkSettings, ZoneId};

/// A zone is given up after so many agents have failed on it.
pub const ATTEMPTS_MAX: u32 = 5;

/// What is known of a zone.
#[derive(Clone, Debug, PartialEq)]
pub struct ZoneRow {
    /// IdWork.
    pub work: WorkId,
    /// IdZone.
    pub zone: ZoneId,
    /// Its own pixels, without the band. The paper's Size is their number: [`ZoneRow::size`].
    pub rect: Rect,
    /// Complexity: predicted cost of all its pixels, in average pixels of the frame.
    pub complexity: f64,
    /// Neighbor Difference, in the same unit a pixel.
    pub neighbor_difference: f64,
    /// T_est: what painting it will take after profiling, found by profiling.
    pub time_estimated: Option<Duration>,
    /// T_real: what it took.
    pub time_measured: Option<Duration>,
    /// Agent: who is, or was last, responsible for it.
    pub agent: Option<AgentId>,
    /// How far it is.
    pub state: ZoneState,
    /// How often it was taken from an agent that failed or fell silent.
    pub attempt: u32,
    /// What it is painted with; set by profiling.
    pub choice: Option<Choice>,
    /// The samples so far.
    pub result: Option<ResultRef>,
}

/// How far a zone is. It goes forward only, but for zones that are taken back from an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ZoneState {
    /// Nobody has seen it.
    Open,
    /// Its agent renders the first samples.
    Profiling,
    /// It has first samples and T_est, and waits for the auction.
    Profiled,
    /// Its agent paints it. The fencing token is the revision of the row that says so.
    Awarded,
    /// Painted.
    Done,
    /// Given up after [`ATTEMPTS_MAX`] attempts.
    Failed,
}

/// Refers to the running sums of a zone; they themselves never travel in a message or a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResultRef {
    /// The award under which they were made.
    pub fence: Revision,
    /// Samples a pixel that they hold.
    pub samples: u32,
    /// Digest of the sums: where to find them and whether they are whole.
    pub digest: BlobId,
}

impl ZoneRow {
    /// A zone of which only the Analyst has spoken.
    pub fn open(work: WorkId, zone: ZoneId, rect: Rect, complexity: f64, neighbor_difference: f64) -> Self {
        Self {
            work,
            zone,
            rect,
            complexity,
            neighbor_difference,
            time_estimated: None,
            time_measured: None,
            agent: None,
            state: ZoneState::Open,
            attempt: 0,
            choice: None,
            result: None,
        }
    }

    /// The paper's Size: pixels.
    pub fn size(&self) -> u64 {
        self.rect.area()
    }

    /// Samples a pixel that are painted.
    pub fn samples_done(&self) -> u32 {
        self.result.map_or(0, |result| result.samples)
    }

    /// Whether nothing more will happen to it.
    pub fn is_settled(&self) -> bool {
        matches!(self.state, ZoneState::Done | ZoneState::Failed)
    }

    /// Whether an agent has it in hand.
    pub fn is_in_hand(&self) -> bool {
        matches!(self.state, ZoneState::Profiling | ZoneState::Awarded)
    }

    /// The row after its agent failed or fell silent: back to where the next agent can take it up.
    #[must_use]
    pub fn taken_back(&self) -> Self {
        let attempt = self.attempt + 1;
        let state = match self.state {
            _ if attempt >= ATTEMPTS_MAX => ZoneState::Failed,
            ZoneState::Profiling => ZoneState::Open,
            ZoneState::Awarded => ZoneState::Profiled,
            settled => settled,
        };
        Self { state, attempt, ..self.clone() }
    }

    /// The row after a restart of the whole farm: no agent has it in hand any more, and that is nobody's fault.
    #[must_use]
    pub fn resumed(&self) -> Self {
        let state = match self.state {
            ZoneState::Profiling => ZoneState::Open,
            ZoneState::Awarded => ZoneState::Profiled,
            ZoneState::Failed if self.result.is_some() => ZoneState::Profiled,
            ZoneState::Failed => ZoneState::Open,
            settled => settled,
        };
        let agent = self.agent.clone().filter(|_| state == ZoneState::Done);
        // Revisions begin anew with the Blackboard: an old token must never be taken for a new one.
        let result = self.result.map(|result| ResultRef { fence: Revision::ABSENT, ..result });
        Self { state, attempt: 0, agent, result, ..self.clone() }
    }
}

/// The interval in which an input of the rules lies in this work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The least value found.
    pub min: f64,
    /// The greatest value found.
    pub max: f64,
}

impl Interval {
    /// The interval of all values; a point at 0 when there are none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let join = |found: Option<Self>, value: f64| {
            let found = found.unwrap_or(Self { min: value, max: value });
            Some(Self { min: found.min.min(value), max: found.max.max(value) })
        };
        values.into_iter().fold(None, join).unwrap_or(Self { min: 0.0, max: 0.0 })
    }
}

/// The scene's ranges, over which the input sets of the rules are laid out at run time (MAGarRO, section 3.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputRanges {
    /// Of complexity/size ratios.
    pub complexity: Interval,
    /// Of neighbor differences.
    pub neighbor_difference: Interval,
    /// Of sizes in pixels.
    pub size: Interval,
}

impl InputRanges {
    /// The ranges of these zones.
    pub fn of(rows: &[ZoneRow]) -> Self {
        Self {
            complexity: Interval::of(rows.iter().map(|row| row.complexity / row.size().max(1) as f64)),
            neighbor_difference: Interval::of(rows.iter().map(|row| row.neighbor_difference)),
            size: Interval::of(rows.iter().map(|row| row.size() as f64)),
        }
    }
}

/// What is known of a work. Written by the Analyst after all its zones.
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
}

/// What is known of an agent.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentRow {
    /// Who.
    pub agent: AgentId,
    /// V_cp.
    pub power: RelativePower,
    /// Processors that work on its zones at once; may be a fraction where agents share a machine.
    pub lanes: f64,
    /// Its credit, in seconds of reference-machine time.
    pub credit: f64,
}

/// Any row.
#[derive(Clone, Debug, PartialEq)]
pub enum FarmValue {
    /// Of a zone.
    Zone(ZoneRow),
    /// Of a work.
    Work(WorkRow),
    /// Of an agent.
    Agent(AgentRow),
}

/// How the keys of everything that belongs to a work begin.
pub fn work_prefix(work: WorkId) -> Key {
    Key::from(format!("work/{}/", work.0))
}

/// The key of a zone's row.
pub fn zone_key(work: WorkId, zone: ZoneId) -> Key {
    Key::from(format!("work/{}/zone/{}", work.0, zone.0))
}

/// The key of a work's row.
pub fn work_key(work: WorkId) -> Key {
    Key::from(format!("work/{}/settings", work.0))
}

/// The key of an agent's row.
pub fn agent_key(work: WorkId, agent: &AgentId) -> Key {
    Key::from(format!("work/{}/agent/{}", work.0, agent.name))
}

/// What one reader has seen of the rows of a work.
#[derive(Clone, Debug, Default)]
pub struct Blackboard {
    work: Option<WorkRow>,
    zones: BTreeMap<ZoneId, (Revision, ZoneRow)>,
    agents: BTreeMap<AgentId, AgentRow>,
}

impl Blackboard {
    /// Takes in a row as it is, unless a later one is known. Returns the row before where a zone's row is new or has
    /// changed: `Some(None)` for a new one.
    pub fn see(&mut self, entry: Entry<FarmValue>) -> Option<Option<ZoneRow>> {
        match entry.value {
            FarmValue::Zone(row) => {
                if self.zones.get(&row.zone).is_some_and(|(seen, _)| *seen >= entry.revision) {
                    return None;
                }
                Some(self.zones.insert(row.zone, (entry.revision, row)).map(|(_, before)| before))
            }
            FarmValue::Work(row) => {
                self.work = Some(row);
                None
            }
            FarmValue::Agent(row) => {
                self.agents.insert(row.agent.clone(), row);
                None
            }
        }
    }

    /// The row of the work, once the Analyst has finished.
    pub fn work(&self) -> Option<&WorkRow> {
        self.work.as_ref()
    }

    /// Whether the work and all its zones are known.
    pub fn is_complete(&self) -> bool {
        self.work.as_ref().is_some_and(|work| work.zone_count as usize == self.zones.len())
    }

    /// A zone with the revision of its row.
    pub fn zone(&self, zone: ZoneId) -> Option<(Revision, &ZoneRow)> {
        self.zones.get(&zone).map(|(revision, row)| (*revision, row))
    }

    /// All zones in the order of their ids.
    pub fn zones(&self) -> impl Iterator<Item = &ZoneRow> {
        self.zones.values().map(|(_, row)| row)
    }

    /// All agents in the order of their names.
    pub fn agents(&self) -> impl Iterator<Item = &AgentRow> {
        self.agents.values()
    }

    /// The request to write a zone's row only if it is still what was seen.
    pub fn compare_and_set(&self, row: ZoneRow) -> StoreRequest<FarmValue> {
        let expected_revision = self.zones.get(&row.zone).map_or(Revision::ABSENT, |(revision, _)| *revision);
        let key = zone_key(row.work, row.zone);
        StoreRequest::CompareAndSet { key, expected_revision, value: FarmValue::Zone(row) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> ZoneRow {
        ZoneRow::open(WorkId(1), ZoneId(2), Rect::of_size(4, 4), 16.0, 0.0)
    }

    fn entry(revision: u64, row: ZoneRow) -> Entry<FarmValue> {
        let key = zone_key(row.work, row.zone);
        Entry { key, revision: Revision(revision), value: FarmValue::Zone(row) }
    }

    #[test]
    fn an_old_row_does_not_replace_a_new_one() {
        let mut board = Blackboard::default();
        assert_eq!(board.see(entry(5, ZoneRow { attempt: 1, ..row() })), Some(None));
        assert_eq!(board.see(entry(4, row())), None);
        assert_eq!(board.zone(ZoneId(2)).unwrap().1.attempt, 1);
        let StoreRequest::CompareAndSet { expected_revision, .. } = board.compare_and_set(row()) else { panic!() };
        assert_eq!(expected_revision, Revision(5));
    }

    #[test]
    fn a_zone_on_which_everybody_fails_is_given_up() {
        let mut row = ZoneRow { state: ZoneState::Awarded, ..row() };
        for _ in 1..ATTEMPTS_MAX {
            row = row.taken_back();
            assert_eq!(row.state, ZoneState::Profiled);
            row.state = ZoneState::Awarded;
        }
        assert_eq!(row.taken_back().state, ZoneState::Failed);
        assert_eq!(row.taken_back().resumed().attempt, 0);
    }
}
