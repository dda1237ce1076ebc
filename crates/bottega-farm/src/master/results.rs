//! The results of agents and of the film.

use super::*;
use crate::{BAND_MAX, Goal, Vote};

/// Maximum time of a zone, in reference-machine time, so that sums over all zones do not overflow a [`Duration`].
const TIME_MAX: Duration = Duration::from_secs(1 << 30);

impl Master {
    /// Processes the report of an order: confirms or refuses it, and writes the zone's new row.
    pub(super) fn take_report(
        &mut self,
        now: Time,
        message: &FarmMessage,
        report: &Report,
        actions: &mut Vec<FarmAction>,
    ) {
        if !self.begun {
            // Not all rows are known yet; the agent repeats its report
            return;
        }
        let (zone, fence) = (report.zone, report.fence);
        let me = self.config.id.clone();
        let received = || answer(message, &me, Performative::Confirm, FarmContent::Received { zone, fence });
        let refuse = |reason: &str| FarmContent::Refused { zone, fence, reason: reason.to_owned() };
        let Some((revision, row)) = self.board.zone(zone) else {
            return self.answer(message, Performative::Disconfirm, refuse("there is no such zone"), actions);
        };
        if self.writes.contains_key(&zone) {
            // The agent repeats its report
            return;
        }
        // The time of the order counts only if no other agent has taken the zone over since.
        let sent = self.sent.get(&zone).filter(|_| row.agent.as_ref() == Some(&message.sender)).copied();
        // Check the fencing token
        let valid = row.fence_of(&message.sender, revision) == Some(fence);
        let is_counted = |vote: &Vote| vote.painting.result.fence == fence;
        let is_there = row.result.is_some_and(|result| result.fence == fence) || row.votes.iter().any(is_counted);
        if !valid && is_there {
            // The report is on the Blackboard already; its confirmation was lost
            return actions.push(FarmAction::Send(received()));
        }
        if !valid || self.left_out.contains_key(&message.sender) {
            return self.answer(message, Performative::Disconfirm, refuse("the order is no longer valid"), actions);
        }
        // Wait for a comparison of pixels, if one is needed
        if let Ok(painting) = &report.outcome {
            let row = row.clone();
            if !self.can_compare(&row, painting, message, actions) {
                return;
            }
        }
        // Compute the row after the report
        let is_gone = report.outcome.as_ref().is_ok_and(|painting| self.take_gone(zone, painting));
        let Some((_, row)) = self.board.zone(zone) else { return };
        let after = match &report.outcome {
            Err(reason) => Err(reason.as_str()),
            Ok(_) if is_gone => Err("its pixels cannot be had"),
            Ok(painting) => self
                .accepted(row, fence, painting)
                .map(|accepted| ZoneRow { reasons: report.reasons.clone().or(accepted.reasons.clone()), ..accepted })
                .map(|accepted| self.compared(row, accepted, painting, &message.sender)),
        };
        // Measure how well the agent kept its promise
        let is_estimated = report
            .outcome
            .as_ref()
            .is_ok_and(|it| row.choice.is_none_or(|chosen| chosen.tunables == it.choice.tunables));
        let sender = self.roster.find(&message.sender);
        let taken = sender.and_then(|agent| self.roster.report(now, agent, sent));
        let measured = report.outcome.as_ref().ok().filter(|painting| painting.is_measured);
        // Predictions before profiling are not the agent's promises, and times that include loading are not
        // measurements.
        let taken = taken.filter(|_| is_estimated && row.state == ZoneState::Awarded);
        let promise = taken.zip(measured.filter(|painting| painting.was_ready)).map(|(taken, painting)| {
            let samples = painting.result.samples.saturating_sub(row.samples_done());
            KeptPromise { taken, worth: self.worth.of(sender, row, samples) }
        });
        if let (Some(sender), Some(painting), Ok(_)) = (sender, measured, &after) {
            self.worth.see(sender, row, painting);
        }
        // Write the row and give the verdict on compared agents; or take the zone back and count the failure
        match after {
            Ok((row, verdict)) => {
                self.pass_painted += row.time_measured.unwrap_or_default();
                let then = RowFollowUp::Receive { confirmation: Box::new(received()), well: true, promise };
                self.forget_likeness(&row);
                self.write(now, row, then, actions);
                self.pronounce(now, zone, &verdict, actions);
            }
            Err(reason) => {
                tracing::warn!(zone = zone.0, agent = %message.sender, reason, "zone failed");
                let after = self.failed(zone, &message.sender);
                if report.outcome.is_ok() {
                    self.answer(message, Performative::Disconfirm, refuse(reason), actions);
                    if let Some(row) = after {
                        self.write(now, row, RowFollowUp::TakenBack, actions);
                    }
                } else if let Some(row) = after {
                    let then = RowFollowUp::Receive { confirmation: Box::new(received()), well: false, promise };
                    self.write(now, row, then, actions);
                } else {
                    actions.push(FarmAction::Send(received()));
                }
                let reason = reason.to_owned();
                self.strike(now, &message.sender, (zone, fence), &reason, actions);
            }
        }
    }

    /// The zone's row after a failure of `agent`. `None`: unchanged, because the agent that took it over continues. If
    /// this failure excludes the agent, its failures do not count against the zone.
    pub(super) fn failed(&self, zone: ZoneId, agent: &AgentId) -> Option<ZoneRow> {
        let (_, row) = self.board.zone(zone)?;
        match (&row.agent, &row.rival) {
            (Some(newer), Some(rival)) if rival.agent == *agent && newer != agent => None,
            (_, Some(rival)) if rival.agent != *agent => Some(ZoneRow { agent: None, ..row.clone() }),
            _ if self.is_last_straw(agent) => {
                let failed = self.roster.get_by_name(agent).map_or(&[][..], |member| &member.failed);
                let before = failed.iter().filter(|(other, _)| *other == zone).count() as u32;
                Some(row.reopened(row.attempt.saturating_sub(before)))
            }
            _ => Some(row.taken_back()),
        }
    }

    /// The zone's row after a valid report, or the reason to refuse it.
    fn accepted(&self, row: &ZoneRow, fence: Revision, painting: &Painting) -> Result<ZoneRow, &'static str> {
        let Some(work) = self.board.work() else { return Err("there is no work") };
        let Painting { choice, result, time_measured, busy, is_measured, goal, time_left, error, .. } = *painting;
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
        let is_chosen = row.choice.is_none_or(|chosen| chosen == choice);
        if !is_chosen && !self.decides(row) {
            return Err("the settings are not what was chosen for the zone");
        }
        let row = &if is_chosen { row.clone() } else { row.decided_anew(choice) };
        let complete = result.samples == row.goal_samples(&choice);
        if result.samples > choice.samples || row.state == ZoneState::Awarded && !complete || result.samples == 0 {
            return Err("the number of samples is wrong");
        }
        if time_measured.max(time_left).max(busy) > TIME_MAX {
            return Err("no zone takes so long");
        }
        if error.is_some_and(|error| error.is_nan() || error < 0.0) {
            return Err("the error is no number");
        }
        let wanted = match work.settings.goal {
            Goal::Samples => choice.samples,
            Goal::Error(_) => goal.clamp(result.samples, choice.samples),
            // Until the next pass is planned
            Goal::Time(_) => result.samples,
        };
        let is_timed = matches!(work.settings.goal, Goal::Time(_)) && result.samples < choice.samples;
        let after = ZoneRow { choice: Some(choice), result: Some(result), error, ..row.clone() };
        let profiling = row.state == ZoneState::Profiling;
        Ok(if wanted > result.samples || is_timed {
            let goal = (work.settings.goal != Goal::Samples).then_some(wanted);
            let time_measured = Some(time_measured).filter(|_| !profiling || is_timed);
            // An agent that loaded something during the painting does not know its speed: prefer the measurements of
            // others, or the prediction.
            let left = choice.samples.saturating_sub(result.samples);
            let expected = || self.worth.of(None, row, left).or(row.time_estimated).unwrap_or(time_left);
            let time_estimated = Some(if is_measured { time_left } else { time_left.min(expected()) });
            ZoneRow { state: ZoneState::Profiled, goal, time_estimated, time_measured, ..after }
        } else {
            ZoneRow { state: ZoneState::Done, time_measured: Some(time_measured), ..after }
        })
    }

    /// Processes the film's answer for a zone.
    pub(super) fn composed(
        &mut self,
        now: Time,
        zone: ZoneId,
        outcome: Result<(), String>,
        actions: &mut Vec<FarmAction>,
    ) {
        let asked = self.composition.composed(zone, outcome.is_ok());
        let painter = self.board.zone(zone).and_then(|(_, row)| row.agent.clone()).filter(|_| asked);
        let reason = outcome.err();
        if let Some(reason) = &reason {
            tracing::warn!(zone = zone.0, reason, "the samples of a zone are lost");
            self.lose(now, zone, asked, actions);
        }
        if let Some(painter) = painter {
            self.judge_tile(now, &painter, reason.as_deref(), actions);
        }
    }

    /// Queues a finished zone to be painted again. A zone that is held, or has other samples by now, stays as it is, so
    /// that a repeated request has no effect.
    pub(super) fn requeue(&mut self, now: Time, zone: ZoneId, fence: Option<Revision>, actions: &mut Vec<FarmAction>) {
        let is_free = self.begun && !self.stopping && !self.finished && !self.writes.contains_key(&zone);
        let row = self.board.zone(zone).filter(|_| is_free).map(|(_, row)| row);
        let row = row.filter(|row| row.state == ZoneState::Failed || row.result.map(|result| result.fence) == fence);
        if let Some(row) = row.and_then(ZoneRow::requeued) {
            self.write(now, row, RowFollowUp::TakenBack, actions);
        }
    }

    /// Discards the lost samples of a zone and opens it again.
    fn lose(&mut self, now: Time, zone: ZoneId, asked: bool, actions: &mut Vec<FarmAction>) {
        // If a write is pending, the zone is painted again already, because its painter was found wrong.
        let is_free = asked && !self.writes.contains_key(&zone);
        if let Some((_, row)) = self.board.zone(zone).filter(|(_, row)| is_free && row.state == ZoneState::Done) {
            // Keep the settings, for which its neighbors' bands were made
            let attempt = row.attempt + 1;
            let state = if attempt < crate::ATTEMPTS_MAX { ZoneState::Open } else { ZoneState::Failed };
            let row = ZoneRow { state, attempt, result: None, time_measured: None, ..row.clone() };
            self.write(now, row, RowFollowUp::TakenBack, actions);
        }
    }
}
