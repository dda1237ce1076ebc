//! The Blackboard: one row a zone, one a work, one an agent, over the store of the platform.
//!
//! Source: MAGarRO, section 3.4, "Blackboard service": IdWork, IdZone, Size, Complexity, T_est, T_real, Agent. Beside
//! them stands what recovery needs. All times are in reference-machine time.

mod trust;

use std::{sync::Arc, time::Duration};

use bottega_agents::{AgentId, NumberMap, Revision};
use bottega_image::Rect;
use rustc_hash::FxHashMap;

pub use self::trust::Vote;
use crate::{
    Choice, Credit, Goal, NeighborDifference, RelativePower, ResultRef, WorkId, WorkSettings, ZoneId,
    adaptation::scaled, partition::nearest_multiple,
};

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
    pub neighbor_difference: NeighborDifference,
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
    /// What it is painted with; set by profiling, and by whoever wins it.
    pub choice: Option<Choice>,
    /// Whose rules decided that, and which of them.
    pub reasons: Option<Arc<str>>,
    /// The samples so far.
    pub result: Option<ResultRef>,
    /// How many samples its next painting goes up to; `None`: all of its choice.
    pub goal: Option<u32>,
    /// Its estimated relative error with the samples so far, where somebody asked for it.
    pub error: Option<f64>,
    /// The pixels that this row answers for, where it is a piece of a zone. `None`: all of the zone with its band.
    pub piece: Option<Rect>,
    /// The zone that it was cut from, with whose mask it is composed. `None`: it is a zone of the Analyst's.
    pub root: Option<ZoneId>,
    /// What was cut off it last. The row that is cut says so first; whoever finds the other one missing writes it.
    pub cut: Option<Cut>,
    /// An order that counts beside the one under this row's revision, because another agent took the zone over: whoever
    /// is first has painted it.
    pub rival: Option<Rival>,
    /// What agents made of its present step, until so many made the same as the user asks for. Empty where nothing is
    /// compared.
    pub votes: Vec<Vote>,
    /// The agent on whose word alone its samples rest, where others were asked for and it was believed.
    pub word_of: Option<AgentId>,
}

/// A piece that was cut off a zone near the end of a work, so that all agents end together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// The id of its row.
    pub zone: ZoneId,
    /// Its pixels, the zone's band among them.
    pub piece: Rect,
}

/// Who else may report a zone.
#[derive(Clone, Debug, PartialEq)]
pub struct Rival {
    /// The agent that had it before.
    pub agent: AgentId,
    /// The token of its order.
    pub fence: Revision,
}

/// The least side of a piece, in pixels.
const PIECE_SIDE_MIN: u32 = 8;

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

impl ZoneRow {
    /// A zone of which only the Analyst has spoken.
    pub fn open(
        work: WorkId,
        zone: ZoneId,
        rect: Rect,
        complexity: f64,
        neighbor_difference: NeighborDifference,
    ) -> Self {
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
            reasons: None,
            result: None,
            goal: None,
            error: None,
            piece: None,
            root: None,
            cut: None,
            rival: None,
            votes: Vec::new(),
            word_of: None,
        }
    }

    /// The paper's Size: pixels of its own, without the band.
    pub fn size(&self) -> u64 {
        match self.piece {
            None => self.rect.area(),
            Some(piece) => piece.intersection(&self.rect).map_or(0, |own| own.area()),
        }
    }

    /// The paper's complexity/size ratio: the complexity of an average pixel of it.
    pub fn complexity_density(&self) -> f64 {
        self.complexity / self.size().max(1) as f64
    }

    /// What is painted for it with this choice: its pixels and those of its band.
    pub fn painted(&self, choice: &Choice, frame: &Rect) -> Rect {
        self.piece.unwrap_or_else(|| self.rect.grown_by(choice.bands, frame))
    }

    /// The zone of the Analyst's that it is, or is a piece of.
    pub fn root(&self) -> ZoneId {
        self.root.unwrap_or(self.zone)
    }

    /// The row without the part behind a cut, which [`Self::offcut`] is. Cost and expected time go with the pixels.
    /// `None` where the pieces would be too small, or nobody knows yet how wide its band is.
    ///
    /// - `share`: how much of the zone the row keeps, 0..1.
    /// - `offcut`: the id of the part that is cut off.
    /// - `grid`: the cut is at a multiple of so many pixels of the picture.
    pub fn cut_to(&self, share: f64, offcut: ZoneId, frame: &Rect, grid: u32) -> Option<Self> {
        let whole = self.painted(&self.choice?, frame);
        let wide = whole.width() > whole.height();
        let (low, high) = if wide { (whole.x0, whole.x1) } else { (whole.y0, whole.y1) };
        let side_min = PIECE_SIDE_MIN.max(grid);
        if high - low < 2 * side_min {
            return None;
        }
        let kept = (f64::from(high - low) * share).round() as u32;
        let at = nearest_multiple(low + kept.clamp(side_min, high - low - side_min), grid);
        if at < low + PIECE_SIDE_MIN || at > high - PIECE_SIDE_MIN {
            return None;
        }
        let (kept, off) = if wide {
            (Rect { x1: at, ..whole }, Rect { x0: at, ..whole })
        } else {
            (Rect { y1: at, ..whole }, Rect { y0: at, ..whole })
        };
        Some(
            Self { piece: Some(kept), cut: Some(Cut { zone: offcut, piece: off }), ..self.clone() }
                .in_proportion(&whole, &kept),
        )
    }

    /// The row of what was cut off this one last: waiting for an auction, whatever has become of this one since.
    pub fn offcut(&self) -> Option<Self> {
        let (Cut { zone, piece }, kept) = (self.cut?, self.piece?);
        let root = Some(self.root());
        let row =
            Self { zone, piece: Some(piece), root, cut: None, rival: None, agent: None, attempt: 0, ..self.clone() };
        let row = Self { state: ZoneState::Profiled, time_measured: None, ..row.in_proportion(&kept, &piece) };
        // The samples of profiling are still good, those of painting are of other pixels.
        let result = row.result.filter(|result| row.choice.is_some_and(|it| result.samples < row.goal_samples(&it)));
        Some(Self { result, ..row })
    }

    fn in_proportion(self, whole: &Rect, part: &Rect) -> Self {
        let share = part.area() as f64 / whole.area().max(1) as f64;
        let time_estimated = self.time_estimated.map(|time| time.mul_f64(share));
        Self { complexity: self.complexity * share, time_estimated, ..self }
    }

    /// The token under which `agent` may report this zone, where the row has `revision`.
    pub fn fence_of(&self, agent: &AgentId, revision: Revision) -> Option<Revision> {
        if !self.is_in_hand() {
            None
        } else if self.agent.as_ref() == Some(agent) {
            Some(revision)
        } else {
            self.rival.as_ref().filter(|rival| rival.agent == *agent).map(|rival| rival.fence)
        }
    }

    /// Whether the rules of the agent that gets it by auction decide what it is painted with: nothing of it is painted but what
    /// profiling did, and no other agent has a part of it.
    pub fn is_undecided(&self, settings: &WorkSettings) -> bool {
        let is_whole = self.piece.is_none() && self.cut.is_none() && self.votes.is_empty();
        let is_profiled = |choice: Choice| self.samples_done() <= choice.profile_samples(&settings.goal);
        // Where samples are added until they are enough, they go on from those that there are.
        let has_samples = settings.goal == Goal::Samples && self.goal.is_none();
        let has_rules = settings.optimization.rule_input().is_some();
        has_rules && has_samples && is_whole && self.choice.is_some_and(is_profiled)
    }

    /// The row of a zone whose agent has decided otherwise than the one that profiled it. The first samples are of other
    /// settings, so they are painted again; T_est goes with the samples.
    #[must_use]
    pub fn decided_anew(&self, choice: Choice) -> Self {
        let before = self.choice.map_or(0, |before| self.goal_samples(&before)).saturating_sub(self.samples_done());
        let ratio = f64::from(choice.samples) / f64::from(before.max(1));
        let time_estimated = self.time_estimated.map(|time| scaled(time, ratio));
        Self { choice: Some(choice), result: None, goal: None, time_estimated, ..self.clone() }
    }

    /// Who has it in hand.
    pub fn holders(&self) -> impl Iterator<Item = &AgentId> {
        let holders = [self.agent.as_ref(), self.rival.as_ref().map(|rival| &rival.agent)];
        holders.into_iter().flatten().filter(|_| self.is_in_hand())
    }

    /// Samples a pixel that are painted.
    pub fn samples_done(&self) -> u32 {
        self.result.map_or(0, |result| result.samples)
    }

    /// Samples that its next painting goes up to, with this choice.
    pub fn goal_samples(&self, choice: &Choice) -> u32 {
        self.goal.map_or(choice.samples, |goal| goal.min(choice.samples))
    }

    /// Whether it has all samples that anybody has asked for, and waits for what comes next.
    pub fn is_waiting(&self) -> bool {
        self.state == ZoneState::Profiled && self.goal.is_some_and(|goal| goal <= self.samples_done())
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
        self.reopened(self.attempt + 1)
    }

    /// The same after so many attempts in all.
    #[must_use]
    pub fn reopened(&self, attempt: u32) -> Self {
        let state = match self.state {
            _ if attempt >= ATTEMPTS_MAX => ZoneState::Failed,
            ZoneState::Profiling => ZoneState::Open,
            ZoneState::Awarded => ZoneState::Profiled,
            settled => settled,
        };
        Self { state, attempt, rival: None, ..self.clone() }
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
        Self { state, attempt: 0, agent, result, rival: None, votes: Vec::new(), ..self.clone() }
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
}

/// What one reader has seen of the rows of a work.
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
    use super::*;

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
