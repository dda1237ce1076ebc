//! What becomes of the reports of agents and of the film.

use super::*;

impl Master {
    pub(super) fn take_report(&mut self, message: &FarmMessage, report: &Report, actions: &mut Vec<FarmAction>) {
        if !self.begun {
            // Not all rows are known yet: the agent will repeat it.
            return;
        }
        let (zone, fence) = (report.zone, report.fence);
        let refuse = |reason: &str| FarmContent::Refused { zone, fence, reason: reason.to_owned() };
        let Some((revision, row)) = self.board.zone(zone) else {
            return self.answer(message, Performative::Disconfirm, refuse("there is no such zone"), actions);
        };
        if self.writes.contains_key(&zone) {
            // The agent will repeat it.
            return;
        }
        let valid = row.is_in_hand() && revision == fence && row.agent.as_ref() == Some(&message.sender);
        if !valid && row.result.is_some_and(|result| result.fence == fence) {
            // It is on the blackboard already; the confirmation was lost.
            return self.answer(message, Performative::Confirm, FarmContent::Received { zone, fence }, actions);
        }
        if !valid {
            return self.answer(message, Performative::Disconfirm, refuse("the order is no longer valid"), actions);
        }
        let after = match &report.outcome {
            Err(reason) => {
                tracing::warn!(zone = zone.0, agent = %message.sender, reason, "zone failed");
                Ok(row.taken_back())
            }
            Ok(painting) => self.accepted(row, fence, painting),
        };
        match after {
            Ok(row) => self.write(row, Then::Receive(Box::new(message.clone())), actions),
            Err(reason) => {
                tracing::warn!(zone = zone.0, agent = %message.sender, reason, "report refused");
                let row = row.taken_back();
                self.answer(message, Performative::Disconfirm, refuse(reason), actions);
                self.write(row, Then::TakenBack, actions);
            }
        }
    }

    /// The zone's row after a valid report.
    fn accepted(&self, row: &ZoneRow, fence: Revision, painting: &Painting) -> Result<ZoneRow, &'static str> {
        let Some(work) = self.board.work() else { return Err("there is no work") };
        let Painting { choice, result, time_measured, time_left } = *painting;
        let unchanged = Choice::unchanged(&work.settings);
        let within = choice.samples >= 1
            && choice.samples <= unchanged.samples
            && choice.tunables.max_depth <= unchanged.tunables.max_depth
            && choice.tunables.light_samples <= unchanged.tunables.light_samples;
        if result.fence != fence {
            return Err("the samples were made under another order");
        }
        if work.settings.optimization.rule_input().is_none() && choice != unchanged || !within {
            return Err("the settings are not what the user allows");
        }
        if row.choice.is_some_and(|chosen| chosen != choice) {
            return Err("the settings are not what was chosen for the zone");
        }
        let done = result.samples == choice.samples;
        if result.samples > choice.samples || row.state == ZoneState::Awarded && !done || result.samples == 0 {
            return Err("the number of samples is wrong");
        }
        let profiling = row.state == ZoneState::Profiling;
        let after = ZoneRow { choice: Some(choice), result: Some(result), ..row.clone() };
        Ok(match (profiling, done) {
            (true, false) => ZoneRow { state: ZoneState::Profiled, time_estimated: Some(time_left), ..after },
            // All samples were profiling: there was nothing to estimate.
            (true, true) => ZoneRow { state: ZoneState::Done, time_measured: Some(time_measured), ..after },
            (false, _) => ZoneRow { state: ZoneState::Done, time_measured: Some(time_measured), ..after },
        })
    }

    pub(super) fn composed(&mut self, zone: ZoneId, outcome: Result<(), String>, actions: &mut Vec<FarmAction>) {
        let asked = self.composition.composed(zone, outcome.is_ok());
        let Err(reason) = outcome else { return };
        tracing::warn!(zone = zone.0, reason, "the samples of a zone are lost");
        if let Some((_, row)) = self.board.zone(zone).filter(|(_, row)| asked && row.state == ZoneState::Done) {
            // Paint it again, with the settings that its neighbours' bands were made for.
            let attempt = row.attempt + 1;
            let state = if attempt < crate::ATTEMPTS_MAX { ZoneState::Open } else { ZoneState::Failed };
            let row = ZoneRow { state, attempt, result: None, time_measured: None, ..row.clone() };
            self.write(row, Then::TakenBack, actions);
        }
    }
}
