//! The results of agents: which reports are accepted, and what they make of a zone's row.

use std::time::Duration;

use bottega_agents::{AgentId, Revision, Time};

use super::{
    assignments::Assignments,
    trust::Trust,
    worth::{KeptPromise, ZoneWorth},
};
use crate::{BAND_MAX, Choice, Goal, Painting, Report, Vote, ZoneId, ZoneRow, ZoneState};

/// Maximum time of a zone, in reference-machine time, so that sums over all zones do not overflow a [`Duration`].
const TIME_MAX: Duration = Duration::from_secs(1 << 30);

/// The answer to a report by its fencing token alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fencing {
    /// The order of the report is valid.
    Valid,
    /// None now: the row is being written, and the agent repeats its report.
    Pending,
    /// The report is on the Blackboard already; its confirmation was lost.
    Known,
    /// The order of the report is not valid, for this reason.
    Refused(&'static str),
}

/// Checks the fencing token of a report.
pub(super) fn check_fence(report: &Report, sender: &AgentId, trust: &Trust, assignments: &Assignments) -> Fencing {
    let &Report { zone, fence, .. } = report;
    let Some((revision, row)) = assignments.rows.zone(zone) else { return Fencing::Refused("there is no such zone") };
    // Wait while the row is being written: its revision is unknown
    if assignments.rows.is_being_written(zone) {
        return Fencing::Pending;
    }
    // Compare the token with that of the current order, and with results that are already known
    let is_valid = row.fence_of(sender, revision) == Some(fence);
    let is_counted = |vote: &Vote| vote.painting.result.fence == fence;
    let is_known = row.result.is_some_and(|result| result.fence == fence) || row.votes.iter().any(is_counted);
    if !is_valid && is_known {
        Fencing::Known
    } else if !is_valid || trust.is_excluded(sender) {
        Fencing::Refused("the order is no longer valid")
    } else {
        Fencing::Valid
    }
}

/// Measures how well an agent kept its promise. `None`: the report ends no award, or its time is not a measurement.
pub(super) fn kept_promise(
    now: Time,
    report: &Report,
    sender: &AgentId,
    worth: &ZoneWorth,
    assignments: &mut Assignments,
) -> Option<KeptPromise> {
    let (_, row) = assignments.rows.zone(report.zone)?;
    // The time of the order counts only if no other agent has taken the zone over since
    let sent = assignments.sent_at(report.zone).filter(|_| row.agent.as_ref() == Some(sender));
    let id = assignments.roster.find(sender)?;
    let taken = assignments.roster.report(now, id, sent)?;
    let painting = report.outcome.as_ref().ok()?;
    let is_estimated = row.choice.is_none_or(|chosen| chosen.tunables == painting.choice.tunables);
    // Predictions before profiling are not the agent's promises, and times that include loading are not measurements.
    if !is_estimated || row.state != ZoneState::Awarded || !painting.is_measured || !painting.was_ready {
        return None;
    }
    let samples = painting.result.samples.saturating_sub(row.samples_done());
    Some(KeptPromise { taken, worth: worth.of(Some(id), row, samples) })
}

/// Returns the zone's row after a valid report, or the reason to refuse it.
pub(super) fn accepted(
    zone: ZoneId,
    fence: Revision,
    painting: &Painting,
    worth: &ZoneWorth,
    assignments: &Assignments,
) -> Result<ZoneRow, &'static str> {
    let Some((_, row)) = assignments.rows.zone(zone) else { return Err("there is no such zone") };
    let Some(work) = assignments.rows.board().work() else { return Err("there is no work") };
    let Painting { choice, result, time_measured, busy, is_measured, goal, time_left, error, .. } = *painting;
    // Check that the settings are within what the user allows
    let unchanged = Choice::unchanged(&work.settings);
    let within = choice.samples >= 1
        && choice.samples <= unchanged.samples
        && choice.tunables.max_depth <= unchanged.tunables.max_depth
        && choice.tunables.light_samples <= unchanged.tunables.light_samples
        && choice.bands.into_array().iter().all(|band| *band <= BAND_MAX);
    if result.fence != fence {
        return Err("the samples were made under another order");
    }
    if work.settings.optimization.rule_input().is_none() && choice != unchanged || !within {
        return Err("the settings are not what the user allows");
    }
    // Accept other settings only from an agent that may choose them
    let is_chosen = row.choice.is_none_or(|chosen| chosen == choice);
    if !is_chosen && !assignments.decides(row) {
        return Err("the settings are not what was chosen for the zone");
    }
    let row = &if is_chosen { row.clone() } else { row.with_choice(choice) };
    // Check the numbers of samples, the times and the error
    let complete = result.samples == row.goal_samples(&choice);
    if result.samples > choice.samples || row.state == ZoneState::Awarded && !complete || result.samples == 0 {
        return Err("the number of samples is wrong");
    }
    if time_measured.max(time_left).max(busy) > TIME_MAX {
        return Err("the time is implausible");
    }
    if error.is_some_and(|error| error.is_nan() || error < 0.0) {
        return Err("the error is not a number");
    }
    // Compute the samples that the zone needs, by the goal of the work
    let wanted = match work.settings.goal {
        Goal::Samples => choice.samples,
        Goal::Error(_) => goal.clamp(result.samples, choice.samples),
        // Until the next pass is planned
        Goal::Time(_) => result.samples,
    };
    let is_timed = matches!(work.settings.goal, Goal::Time(_)) && result.samples < choice.samples;
    // Open the zone for the samples that are left, or close it
    let after = ZoneRow { choice: Some(choice), result: Some(result), error, ..row.clone() };
    let profiling = row.state == ZoneState::Profiling;
    Ok(if wanted > result.samples || is_timed {
        let goal = (work.settings.goal != Goal::Samples).then_some(wanted);
        let time_measured = Some(time_measured).filter(|_| !profiling || is_timed);
        // An agent that loaded something during the painting does not know its speed: prefer the measurements of
        // others, or the prediction.
        let left = choice.samples.saturating_sub(result.samples);
        let expected = || worth.of(None, row, left).or(row.time_estimated).unwrap_or(time_left);
        let time_estimated = Some(if is_measured { time_left } else { time_left.min(expected()) });
        ZoneRow { state: ZoneState::Profiled, goal, time_estimated, time_measured, ..after }
    } else {
        ZoneRow { state: ZoneState::Done, time_measured: Some(time_measured), ..after }
    })
}

/// Returns the row of a finished zone whose samples were lost: open again, or given up.
pub(super) fn without_samples(row: &ZoneRow) -> ZoneRow {
    // Keep the settings, for which its neighbors' bands were made
    let attempt = row.attempt + 1;
    let state = if attempt < crate::ATTEMPTS_MAX { ZoneState::Open } else { ZoneState::Failed };
    ZoneRow { state, attempt, result: None, time_measured: None, ..row.clone() }
}
