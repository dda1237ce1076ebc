//! Events about zones, agents, auction rounds and forecasts.

use bottega_farm::{AgentRow, AuctionTally, Forecast, RoundSummary, Theft, ZoneRow, ZoneState};
use bottega_image::Rect;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A zone of the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Zone {
    /// Number of the zone, from 0.
    pub id: u32,
    /// Corners of the zone in pixels: x0, y0, x1, y1.
    pub rect: [u32; 4],
    /// Mean predicted cost of the zone's pixels; 1 is the mean of the picture.
    pub complexity_density: f64,
}

/// A zone's row on the Blackboard: the paper's seven fields, and the state of the zone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ZoneEvent {
    /// IdZone: number of the zone.
    pub id: u32,
    /// IdWork: number of the work that the zone is part of.
    pub work: u64,
    /// Corners of the zone in pixels: x0, y0, x1, y1.
    pub rect: [u32; 4],
    /// Size: number of pixels.
    pub size: u64,
    /// Complexity: predicted cost of all its pixels; unit: one average pixel of the picture.
    pub complexity: f64,
    /// Neighbor Difference: absolute difference of the cost per pixel from the zones that share an edge, averaged by the length
    /// of the edges; missing in rows of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub neighbor_difference: Option<f64>,
    /// The state: `open`, `profiling`, `profiled`, `awarded`, `done` or `failed`.
    pub state: String,
    /// Name of the agent to which the zone was awarded last; missing before the first award.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub agent: Option<String>,
    /// T_est: estimated time of the zone's remaining samples, in seconds on the reference machine; missing without an estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_estimated: Option<f64>,
    /// T_real: measured time of the zone's last painting, in seconds on the reference machine; missing before it is measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_measured: Option<f64>,
    /// Number of times the zone was taken from an agent that failed or stopped responding.
    pub attempt: u32,
    /// The settings that the zone is painted with; missing before they are chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub choice: Option<ZoneChoice>,
    /// The rules that decided the settings and their degrees of firing: `path_tracing: 12 0.83, 22 0.40`; missing if no rules
    /// did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reasons: Option<String>,
    /// Samples per pixel taken so far.
    pub samples: u32,
    /// The zone's estimated relative error; missing if no error was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
}

/// The settings that a zone is painted with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ZoneChoice {
    /// Recursion level: maximum number of bounces of light.
    pub max_depth: u32,
    /// Light samples per bounce.
    pub light_samples: u32,
    /// Samples per pixel of the zone.
    pub samples: u32,
    /// Widths of the interpolation bands beyond the edges of the zone, in pixels: left, top, right, bottom.
    pub bands: [u32; 4],
}

/// An agent's row on the Blackboard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AgentEvent {
    /// Name of the agent.
    pub agent: String,
    /// V_cp: relative computing power; 1 is the reference machine, 0.5 is twice as fast.
    pub power: f64,
    /// Number of processors that work on the agent's zones at the same time.
    pub lanes: f64,
    /// Credit: the sum of T_est − T over its zones, in seconds on the reference machine.
    pub credit: f64,
    /// Recent reliability: estimated over measured time. 1 if zones took as long as promised, 0.5 if twice as long.
    pub reliability: f64,
    /// Seconds since rendering began; missing if unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Number of failures since the last zone it finished.
    pub failures: u32,
    /// The reason why the agent is excluded from the work; missing if it is not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
}

/// One round of the auction: a call for proposals, bids and awards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RoundEvent {
    /// Number of the round; also the conversation id of its messages.
    pub round: u64,
    /// Seconds since rendering began.
    pub seconds: f64,
    /// Number of zones offered.
    pub offers: u32,
    /// Number of agents that got the call for proposals.
    pub called: u32,
    /// Number of agents that sent a proposal.
    pub bidders: u32,
    /// Number of bids for single zones, over all proposals.
    pub bids: u32,
    /// Number of zones, or parts of zones, awarded.
    pub awards: u32,
    /// Number of zones awarded to another agent than the first that needed one, because it finishes them sooner.
    pub outbid: u32,
    /// True if credit changed the outcome: with equal credit for all, other agents win.
    pub credit_decided: bool,
}

/// A theft: an agent has taken zones, or parts of zones, that were waiting at another agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TheftEvent {
    /// Seconds since rendering began.
    pub seconds: f64,
    /// Name of the agent that lost the zones.
    pub from: String,
    /// Name of the agent that took the zones.
    pub to: String,
    /// Number of zones taken.
    pub zones: u32,
}

/// Totals over all rounds of an auction and all thefts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AuctionEvent {
    /// Total number of rounds.
    pub rounds: u64,
    /// Number of rounds with several bidders.
    pub contested: u64,
    /// Share of the rounds in the first half that had several bidders, 0 to 1.
    pub contested_of_first_half: f64,
    /// Number of zones awarded to another agent than the first that needed one, because it finishes them sooner.
    pub outbid: u64,
    /// Number of rounds whose outcome was changed by credit.
    pub credit_decided: u64,
    /// Number of agents that sent a proposal, summed over all rounds.
    pub bidders: u64,
    /// Number of bids for single zones, over all rounds.
    pub bids: u64,
    /// Number of zones, or parts of zones, awarded.
    pub awards: u64,
    /// Total number of thefts.
    pub thefts: u64,
    /// Number of zones taken in all thefts.
    pub stolen: u64,
}

/// The accuracy of T_est before profiling, compared with the measured times T.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ForecastEvent {
    /// Number of zones compared: those painted as a whole.
    pub zones: usize,
    /// Spearman's rank correlation of T_est and T, −1 to 1; missing if undefined.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rank_correlation: Option<f64>,
    /// Median of |T_est − T| ∕ T.
    pub median_error: f64,
    /// The sum of all T_est over the sum of all T.
    pub total_ratio: f64,
    /// Number of earlier jobs that the estimates have learned from; 0: they rest on the survey and the benchmark alone.
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
    /// Makes the event of a round that ended `seconds` after rendering began.
    pub fn new(round: &RoundSummary, seconds: f64) -> Self {
        let RoundSummary { round, offers, called, bidders, bids, awards, outbid, credit_decided } = *round;
        Self { round, seconds, offers, called, bidders, bids, awards, outbid, credit_decided }
    }
}

impl AuctionEvent {
    /// Returns the totals of all rounds and thefts, given in the order in which they ended.
    pub fn of(all: &[RoundSummary], thefts: &[Theft]) -> Self {
        let mut tally = AuctionTally::of(all);
        thefts.iter().for_each(|theft| tally.add_theft(theft));
        let AuctionTally { rounds, contested, outbid, credit_decided, bidders, bids, awards, thefts, stolen } = tally;
        let contested_of_first_half = AuctionTally::contested_of_first_half(all);
        Self {
            rounds,
            contested,
            contested_of_first_half,
            outbid,
            credit_decided,
            bidders,
            bids,
            awards,
            thefts,
            stolen,
        }
    }
}

impl ForecastEvent {
    /// Makes the event of a forecast.
    ///
    /// - `jobs_learnt`: number of earlier jobs that the machine which surveyed the scene has learned from.
    pub fn new(forecast: &Forecast, jobs_learnt: u64) -> Self {
        let Forecast { zones, rank_correlation, median_error, total_ratio } = *forecast;
        Self { zones, rank_correlation, median_error, total_ratio, jobs_learnt }
    }
}

impl AgentEvent {
    /// Makes the event of an agent's row; `seconds`: time since rendering began, if known.
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
    /// Makes a zone from its number, its pixels and its mean complexity per pixel.
    pub fn new(id: u32, rect: &Rect, complexity_density: f64) -> Self {
        Self { id, rect: corners(rect), complexity_density }
    }
}

/// Returns the corners of a rectangle in pixels: x0, y0, x1, y1.
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
