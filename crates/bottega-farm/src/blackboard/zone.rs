//! The row of a zone.

use std::{sync::Arc, time::Duration};

use bottega_agents::{AgentId, Revision};
use bottega_image::Rect;

use crate::{
    Choice, Goal, NeighborDifference, Painting, ResultRef, WorkId, WorkSettings, ZoneForecast, ZoneId,
    adaptation::scaled, partition::nearest_multiple,
};

/// Number of failed attempts after which a zone is given up.
pub const ATTEMPTS_MAX: u32 = 5;

/// The row of a zone on the Blackboard: its pixels, state, agent and samples.
#[derive(Clone, Debug, PartialEq)]
pub struct ZoneRow {
    /// The paper's IdWork: the work to which the zone belongs.
    pub work: WorkId,
    /// The paper's IdZone: the index in the partition, or a new number for a piece.
    pub zone: ZoneId,
    /// The pixels of the zone, without the band. The paper's Size is their number: [`ZoneRow::size`].
    pub rect: Rect,
    /// The paper's Complexity: predicted cost of the zone's pixels, in average pixels of the frame.
    pub complexity: f64,
    /// Neighbor Difference, in average pixels per pixel.
    pub neighbor_difference: NeighborDifference,
    /// T_est: expected time of the remaining samples, in reference-machine time. Before profiling a prediction for all
    /// samples, from the survey and earlier works; afterwards from the measured first samples. `None`: no prediction.
    pub time_estimated: Option<Duration>,
    /// The paper's T_real: the measured time of the zone's last painting, in reference-machine time. `None`: nothing is
    /// painted but the profile, and the goal is not a time.
    pub time_measured: Option<Duration>,
    /// The agent that is, or was last, responsible for the zone; `None`: none was, or the zone was opened again without
    /// it.
    pub agent: Option<AgentId>,
    /// The state of the zone, from unprofiled to done.
    pub state: ZoneState,
    /// Number of failed attempts that count against the zone: each time it was taken from an agent that failed or
    /// stopped responding.
    pub attempt: u32,
    /// The settings: chosen at profiling, and again by the winner of the auction if its rules decide. `None`: not yet chosen.
    pub choice: Option<Choice>,
    /// The rules that chose the settings, with their degrees: see [`Expert::reasons`](crate::Expert::reasons). `None`:
    /// no rules chose them yet.
    pub reasons: Option<Arc<str>>,
    /// The samples painted so far, by reference; `None`: none.
    pub result: Option<ResultRef>,
    /// Samples per pixel that the zone's next painting reaches; `None`: all samples of its choice.
    pub goal: Option<u32>,
    /// Estimated relative error of the samples so far; `None`: not requested, or not known.
    pub error: Option<f64>,
    /// If this row is a piece of a zone: the pixels of the piece. `None`: the whole zone with its band.
    pub piece: Option<Rect>,
    /// If this row is a piece: the zone of the Analyst that it was cut from, whose mask composes it. `None`: a zone of
    /// the Analyst.
    pub root: Option<ZoneId>,
    /// The last piece that was cut off this zone. This entry is written before the row of the piece; a Master that
    /// finds that row missing writes it.
    pub cut: Option<Cut>,
    /// A second valid order, of the agent that held the zone before another took it over: the first report counts.
    pub rival: Option<Rival>,
    /// The paintings that agents reported for the zone's current step, until enough of them agree. Empty if paintings
    /// are not compared.
    pub votes: Vec<Vote>,
    /// The agent whose unconfirmed painting was accepted, where other agents' confirmation was requested.
    pub word_of: Option<AgentId>,
}

/// A piece cut off a zone near the end of a work, so that all agents finish together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// The id of the piece's row.
    pub zone: ZoneId,
    /// The pixels of the piece, including the zone's band.
    pub piece: Rect,
}

/// A second agent that may report a zone.
#[derive(Clone, Debug, PartialEq)]
pub struct Rival {
    /// The agent that held the zone before.
    pub agent: AgentId,
    /// The fencing token of the rival's order.
    pub fence: Revision,
}

/// Minimum side of a piece, in pixels.
const PIECE_SIDE_MIN: u32 = 8;

/// The state of a zone. It only advances, unless the zone is taken back from an agent or painted again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ZoneState {
    /// The zone has no samples that count, and waits for an agent to profile it.
    Open,
    /// An agent paints the first samples.
    Profiling,
    /// The zone waits for the auction, or for the next pass over the picture: its first samples are painted, or its
    /// time was predicted well enough without them.
    Profiled,
    /// An agent paints the zone. The fencing token is the revision of the row with this state.
    Awarded,
    /// All samples are painted.
    Done,
    /// Given up after [`ATTEMPTS_MAX`] attempts.
    Failed,
}

/// The painting that an agent reports for a step of a zone.
#[derive(Clone, Debug, PartialEq)]
pub struct Vote {
    /// The name of the agent.
    pub agent: AgentId,
    /// The painting that the agent reports.
    pub painting: Painting,
}

impl ZoneRow {
    /// Makes the row of a new zone, which is open and has no agent.
    ///
    /// - `rect`: its pixels, without the band.
    /// - `complexity`: its predicted cost, in average pixels of the frame.
    /// - `neighbor_difference`: its difference from the zones beside it, in average pixels per pixel.
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

    /// Returns the row of a new zone with a predicted time. If the prediction is trusted, and no rules have to choose settings,
    /// the zone is not profiled: it waits for the auction at once.
    #[must_use]
    pub(crate) fn with_forecast(self, settings: &WorkSettings, forecast: &ZoneForecast) -> Self {
        let row = Self { time_estimated: Some(forecast.time), ..self };
        let has_rules = settings.optimization.rule_input().is_some();
        if has_rules || settings.goal != Goal::Samples || !forecast.is_trusted() {
            return row;
        }
        Self { state: ZoneState::Profiled, choice: Some(Choice::unchanged(settings)), ..row }
    }

    /// Returns the paper's Size: the number of the zone's pixels, without the band.
    pub fn size(&self) -> u64 {
        match self.piece {
            None => self.rect.area(),
            Some(piece) => piece.intersection(&self.rect).map_or(0, |own| own.area()),
        }
    }

    /// Returns the paper's complexity/size ratio: the zone's mean complexity per pixel, in average pixels of the frame.
    pub fn complexity_density(&self) -> f64 {
        self.complexity / self.size().max(1) as f64
    }

    /// Returns the rectangle to paint with this choice: the zone and its band, or the piece.
    ///
    /// - `frame`: the pixels of the work, to which the band is clipped.
    pub fn painted(&self, choice: &Choice, frame: &Rect) -> Rect {
        self.piece.unwrap_or_else(|| self.rect.grown_by(choice.bands, frame))
    }

    /// Returns the Analyst's zone that this row is, or is a piece of.
    pub fn root(&self) -> ZoneId {
        self.root.unwrap_or(self.zone)
    }

    /// Returns the row with a part cut off; [`Self::offcut`] gives the row of that part. Complexity and T_est scale
    /// with the number of pixels. `None`: a piece is smaller than the minimum, or the settings and with them the band
    /// are not chosen yet.
    ///
    /// - `share`: the share of the zone that the row keeps, 0..1.
    /// - `offcut`: the id for the part that is cut off.
    /// - `frame`: the pixels of the work, to which the band is clipped.
    /// - `grid`: the cut lies at a multiple of this many pixels of the picture.
    pub fn cut_to(&self, share: f64, offcut: ZoneId, frame: &Rect, grid: u32) -> Option<Self> {
        // Cut across the longer side
        let whole = self.painted(&self.choice?, frame);
        let wide = whole.width() > whole.height();
        let (low, high) = if wide { (whole.x0, whole.x1) } else { (whole.y0, whole.y1) };
        let side_min = PIECE_SIDE_MIN.max(grid);
        if high - low < 2 * side_min {
            return None;
        }
        // Snap the cut to the grid, with both pieces at least the minimum size
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

    /// Returns the row of the part that was cut off last: it waits for an auction, whatever this row's state is now.
    /// `None`: nothing was cut off.
    pub fn offcut(&self) -> Option<Self> {
        let (Cut { zone, piece }, kept) = (self.cut?, self.piece?);
        let root = Some(self.root());
        let row =
            Self { zone, piece: Some(piece), root, cut: None, rival: None, agent: None, attempt: 0, ..self.clone() };
        let row = Self { state: ZoneState::Profiled, time_measured: None, ..row.in_proportion(&kept, &piece) };
        // Keep the samples of profiling, which cover the whole zone; drop later ones, which are of this row's pixels
        let result = row.result.filter(|result| row.choice.is_some_and(|it| result.samples < row.goal_samples(&it)));
        Some(Self { result, ..row })
    }

    fn in_proportion(self, whole: &Rect, part: &Rect) -> Self {
        let share = part.area() as f64 / whole.area().max(1) as f64;
        let time_estimated = self.time_estimated.map(|time| time.mul_f64(share));
        Self { complexity: self.complexity * share, time_estimated, ..self }
    }

    /// Returns the fencing token under which `agent` may report this zone, if the row has `revision`. `None`: the agent
    /// does not hold it.
    pub fn fence_of(&self, agent: &AgentId, revision: Revision) -> Option<Revision> {
        if !self.is_in_hand() {
            None
        } else if self.agent.as_ref() == Some(agent) {
            Some(revision)
        } else {
            self.rival.as_ref().filter(|rival| rival.agent == *agent).map(|rival| rival.fence)
        }
    }

    /// Returns true if the rules of the agent that wins the zone choose its settings: optimization is on, the goal is a
    /// number of samples, no samples but those of profiling are painted, nothing was cut off, and there are no votes.
    pub fn is_undecided(&self, settings: &WorkSettings) -> bool {
        let is_whole = self.piece.is_none() && self.cut.is_none() && self.votes.is_empty();
        let is_profiled = |choice: Choice| self.samples_done() <= choice.profile_samples(&settings.goal);
        // A goal of error or time continues from the samples that exist.
        let has_samples = settings.goal == Goal::Samples && self.goal.is_none();
        let has_rules = settings.optimization.rule_input().is_some();
        has_rules && has_samples && is_whole && self.choice.is_some_and(is_profiled)
    }

    /// Returns the row with other settings than those of the agent that profiled it. The first samples are discarded,
    /// and T_est scales with the number of samples.
    #[must_use]
    pub fn with_choice(&self, choice: Choice) -> Self {
        let before = self.choice.map_or(0, |before| self.goal_samples(&before)).saturating_sub(self.samples_done());
        let ratio = f64::from(choice.samples) / f64::from(before.max(1));
        let time_estimated = self.time_estimated.map(|time| scaled(time, ratio));
        Self { choice: Some(choice), result: None, goal: None, time_estimated, ..self.clone() }
    }

    /// Returns the agents that hold the zone: its agent and the rival; none if the zone is not in hand.
    pub fn holders(&self) -> impl Iterator<Item = &AgentId> {
        let holders = [self.agent.as_ref(), self.rival.as_ref().map(|rival| &rival.agent)];
        holders.into_iter().flatten().filter(|_| self.is_in_hand())
    }

    /// Returns the number of painted samples per pixel.
    pub fn samples_done(&self) -> u32 {
        self.result.map_or(0, |result| result.samples)
    }

    /// Returns the samples per pixel that the zone's next painting reaches with this choice.
    pub fn goal_samples(&self, choice: &Choice) -> u32 {
        self.goal.map_or(choice.samples, |goal| goal.min(choice.samples))
    }

    /// Returns T_est of the zone's next order: of the first samples with the user's settings before and during profiling,
    /// else of all the remaining ones. `None`: no prediction.
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

    /// Returns true if the zone has all samples of its goal and waits for the next goal.
    pub fn is_waiting(&self) -> bool {
        self.state == ZoneState::Profiled && self.goal.is_some_and(|goal| goal <= self.samples_done())
    }

    /// Returns true if the zone is done or given up.
    pub fn is_settled(&self) -> bool {
        matches!(self.state, ZoneState::Done | ZoneState::Failed)
    }

    /// Returns true if an agent holds the zone.
    pub fn is_in_hand(&self) -> bool {
        matches!(self.state, ZoneState::Profiling | ZoneState::Awarded)
    }

    /// Returns the row after the zone's agent failed or fell silent: open for the next agent, with one more attempt;
    /// given up if that is the last one of [`ATTEMPTS_MAX`].
    #[must_use]
    pub fn taken_back(&self) -> Self {
        self.reopened(self.attempt + 1)
    }

    /// Returns the row of the zone as it is opened again, or given up.
    ///
    /// - `attempt`: the number of failed attempts so far; from [`ATTEMPTS_MAX`] on the zone is given up.
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

    /// Returns the row of a zone that is painted again from its first sample. It keeps its settings, because the
    /// neighbors' bands were made for them. `None`: the zone is neither done nor given up.
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

    /// Returns the row after a restart of the whole farm: no agent holds the zone, no failed attempts count, and a zone
    /// that was given up waits again.
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
        // Revisions restart with the Blackboard, so an old token must not match a new one.
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
