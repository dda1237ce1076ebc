//! The row of a zone.

use std::{sync::Arc, time::Duration};

use bottega_agents::{AgentId, Revision};
use bottega_image::Rect;

use crate::{
    Choice, Goal, NeighborDifference, Painting, ResultRef, WorkId, WorkSettings, ZoneId, adaptation::scaled,
    partition::nearest_multiple,
};

/// A zone is given up after so many agents have failed on it.
pub const ATTEMPTS_MAX: u32 = 5;

/// The row of a zone.
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
    /// T_est: what painting what is left of it will take. Before profiling as the machine that looked at the scene expects of all
    /// its samples, from the survey and what it learnt before; after it as profiling found.
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

/// Another agent that may report a zone.
#[derive(Clone, Debug, PartialEq)]
pub struct Rival {
    /// The agent that had it before.
    pub agent: AgentId,
    /// The token of its order.
    pub fence: Revision,
}

/// The least side of a piece, in pixels.
const PIECE_SIDE_MIN: u32 = 8;

/// The state of a zone. It goes forward only, but for zones that are taken back from an agent.
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

/// The verdict of an agent on a step of a zone.
#[derive(Clone, Debug, PartialEq)]
pub struct Vote {
    /// Who.
    pub agent: AgentId,
    /// What.
    pub painting: Painting,
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

    /// T_est of its next order with the settings of the user: of the first samples as long as nobody has seen it.
    pub fn order_time(&self, settings: &WorkSettings) -> Option<Duration> {
        match self.state {
            ZoneState::Open | ZoneState::Profiling => {
                let first = Choice::unchanged(settings).profile_samples(&settings.goal);
                let share = f64::from(first) / f64::from(settings.samples.max(1));
                self.time_estimated.map(|time| scaled(time, share))
            }
            _ => self.time_estimated,
        }
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

    /// The row of a zone that is done or given up and is to be painted again from its first sample. It keeps what was chosen for
    /// it, for which its neighbors' bands were made. `None`: it is neither.
    pub fn requeued(&self) -> Option<Self> {
        matches!(self.state, ZoneState::Done | ZoneState::Failed).then(|| Self {
            state: ZoneState::Open,
            attempt: 0,
            agent: None,
            result: None,
            goal: None,
            error: None,
            time_measured: None,
            rival: None,
            votes: Vec::new(),
            word_of: None,
            ..self.clone()
        })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zone_on_which_everybody_fails_is_given_up() {
        let mut row = ZoneRow {
            state: ZoneState::Awarded,
            ..ZoneRow::open(WorkId(1), ZoneId(2), Rect::of_size(4, 4), 16.0, NeighborDifference::default())
        };
        for _ in 1..ATTEMPTS_MAX {
            row = row.taken_back();
            assert_eq!(row.state, ZoneState::Profiled);
            row.state = ZoneState::Awarded;
        }
        assert_eq!(row.taken_back().state, ZoneState::Failed);
        assert_eq!(row.taken_back().resumed().attempt, 0);
    }
}
