//! The events of the society that paints: zones, agents, rounds of the auction, forecasts.

use bottega_farm::{AgentRow, AuctionTally, Forecast, RoundSummary, Theft, ZoneRow, ZoneState};
use bottega_image::Rect;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A zone of the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Zone {
    /// Its number.
    pub id: u32,
    /// x0, y0, x1, y1.
    pub rect: [u32; 4],
    /// Complexity of an average pixel of it: predicted cost, 1 is the mean of the picture.
    pub complexity_density: f64,
}

/// A zone's row on the Blackboard: the paper's seven fields, and how it stands.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ZoneEvent {
    /// IdZone.
    pub id: u32,
    /// IdWork.
    pub work: u64,
    /// Its pixels: x0, y0, x1, y1.
    pub rect: [u32; 4],
    /// Size, in pixels.
    pub size: u64,
    /// Complexity: predicted cost of all its pixels, in average pixels of the picture.
    pub complexity: f64,
    /// Neighbor Difference: how much the cost of a pixel differs from that of zones beside it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub neighbor_difference: Option<f64>,
    /// `open`, `profiled`, `awarded`, `done`, …
    pub state: String,
    /// Who has it or had it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub agent: Option<String>,
    /// T_est: seconds of reference-machine time that it should take.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_estimated: Option<f64>,
    /// T_real: seconds of reference-machine time that it took.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_measured: Option<f64>,
    /// How often it was taken from an agent that failed or fell silent.
    pub attempt: u32,
    /// What it is painted with, once that is chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub choice: Option<ZoneChoice>,
    /// Which rules decided that, and how strongly: `path_tracing: 12 0.83, 22 0.40`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reasons: Option<String>,
    /// Samples a pixel that it has.
    pub samples: u32,
    /// Its estimated relative error, where one was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
}

/// The settings that a zone is painted with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ZoneChoice {
    /// Recursion level: bounces of light.
    pub max_depth: u32,
    /// Light samples at each bounce.
    pub light_samples: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Widths of the interpolation bands beyond its edges, in pixels: left, top, right, bottom.
    pub bands: [u32; 4],
}

/// An agent's row on the Blackboard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AgentEvent {
    /// Its name.
    pub agent: String,
    /// V_cp: relative computing power; 1 is the reference machine, 0.5 is twice as fast.
    pub power: f64,
    /// Processors that work on its zones at once.
    pub lanes: f64,
    /// Its credit: the sum of T_est − T over its zones, in seconds of reference-machine time.
    pub credit: f64,
    /// How far its promises held lately: 1 when what it promised took as long as it said, 0.5 when it took twice as long.
    pub reliability: f64,
    /// Seconds since rendering began, where that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// How often it has failed since it last painted something.
    pub failures: u32,
    /// Why it is left out of the work, if it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
}

/// A round of the auction: agents were called, bid, and zones were given away.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RoundEvent {
    /// Its number: the conversation of its messages.
    pub round: u64,
    /// Seconds since rendering began.
    pub seconds: f64,
    /// Zones on offer.
    pub offers: u32,
    /// Agents that were called.
    pub called: u32,
    /// Agents that made a proposal.
    pub bidders: u32,
    /// Bids for single zones, all proposals together.
    pub bids: u32,
    /// Zones, or parts of zones, that were given away.
    pub awards: u32,
    /// Whether it would have been otherwise if all had been believed alike.
    pub credit_decided: bool,
}

/// Zones, or parts of zones, that an agent took from another: they waited there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TheftEvent {
    /// Seconds since rendering began.
    pub seconds: f64,
    /// Who had them.
    pub from: String,
    /// Who has them.
    pub to: String,
    /// How many.
    pub zones: u32,
}

/// The sum of all rounds of an auction, and of what agents took from each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AuctionEvent {
    /// How many there were.
    pub rounds: u64,
    /// Of them those with several bidders.
    pub contested: u64,
    /// Share of the first half of them that had several bidders.
    pub contested_of_first_half: f64,
    /// Rounds that would have been otherwise if all had been believed alike.
    pub credit_decided: u64,
    /// Agents that made a proposal, all rounds together.
    pub bidders: u64,
    /// Bids for single zones, all rounds together.
    pub bids: u64,
    /// Zones, or parts of zones, that were given away.
    pub awards: u64,
    /// How often an agent took zones from another.
    pub thefts: u64,
    /// Zones that changed hands so.
    pub stolen: u64,
}

/// How well T_est of zones before profiling agreed with what they took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ForecastEvent {
    /// Zones that were painted as a whole, and are compared.
    pub zones: usize,
    /// Spearman's rank correlation, −1 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rank_correlation: Option<f64>,
    /// Median of |T_est − T| ∕ T.
    pub median_error: f64,
    /// The sum of all T_est over the sum of all T.
    pub total_ratio: f64,
    /// Jobs before from which this machine has learnt; 0: the survey and the benchmark alone told.
    pub jobs_learnt: u64,
}

impl From<&ZoneRow> for ZoneEvent {
    fn from(row: &ZoneRow) -> Self {
        let choice = row.choice.map(|choice| ZoneChoice {
            max_depth: choice.tunables.max_depth,
            light_samples: choice.tunables.light_samples,
            samples: choice.samples,
            bands: [choice.bands.left, choice.bands.top, choice.bands.right, choice.bands.bottom],
        });
        Self {
            id: row.zone.0,
            work: row.work.0,
            rect: corners(&row.rect),
            size: row.size(),
            complexity: row.complexity,
            neighbor_difference: Some(row.neighbor_difference.mean),
            state: state_word(row.state).to_owned(),
            agent: row.agent.as_ref().map(ToString::to_string),
            seconds_estimated: row.time_estimated.map(|time| time.as_secs_f64()),
            seconds_measured: row.time_measured.map(|time| time.as_secs_f64()),
            attempt: row.attempt,
            choice,
            reasons: row.reasons.as_deref().map(str::to_owned),
            samples: row.samples_done(),
            error: row.error,
        }
    }
}

impl RoundEvent {
    /// A round that ended so many seconds after rendering began.
    pub fn new(round: &RoundSummary, seconds: f64) -> Self {
        let RoundSummary { round, offers, called, bidders, bids, awards, credit_decided } = *round;
        Self { round, seconds, offers, called, bidders, bids, awards, credit_decided }
    }
}

impl AuctionEvent {
    /// All rounds and thefts, as they ended.
    pub fn of(all: &[RoundSummary], thefts: &[Theft]) -> Self {
        let mut tally = AuctionTally::of(all);
        thefts.iter().for_each(|theft| tally.add_theft(theft));
        let AuctionTally { rounds, contested, credit_decided, bidders, bids, awards, thefts, stolen } = tally;
        let contested_of_first_half = AuctionTally::contested_of_first_half(all);
        Self { rounds, contested, contested_of_first_half, credit_decided, bidders, bids, awards, thefts, stolen }
    }
}

impl ForecastEvent {
    /// - `jobs_learnt`: jobs before from which the machine that looked at the scene has learnt.
    pub fn new(forecast: &Forecast, jobs_learnt: u64) -> Self {
        let Forecast { zones, rank_correlation, median_error, total_ratio } = *forecast;
        Self { zones, rank_correlation, median_error, total_ratio, jobs_learnt }
    }
}

impl AgentEvent {
    /// An agent as it stands so many seconds after rendering began, where that is known.
    pub fn new(row: &AgentRow, seconds: Option<f64>) -> Self {
        Self {
            agent: row.agent.to_string(),
            power: row.power.get(),
            lanes: row.lanes,
            credit: row.credit.sum,
            reliability: row.credit.reliability(),
            seconds,
            failures: row.failures,
            left_out: row.left_out.clone(),
        }
    }
}

impl Zone {
    /// A zone as the Analyst has cut it.
    pub fn new(id: u32, rect: &Rect, complexity_density: f64) -> Self {
        Self { id, rect: corners(rect), complexity_density }
    }
}

/// x0, y0, x1, y1.
pub(crate) fn corners(rect: &Rect) -> [u32; 4] {
    [rect.x0, rect.y0, rect.x1, rect.y1]
}

fn state_word(state: ZoneState) -> &'static str {
    match state {
        ZoneState::Open => "open",
        ZoneState::Profiling => "profiling",
        ZoneState::Profiled => "profiled",
        ZoneState::Awarded => "awarded",
        ZoneState::Done => "done",
        ZoneState::Failed => "failed",
    }
}
