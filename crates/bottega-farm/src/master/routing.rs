//! Routing: passes each message, row and answer to the values of the Master that it concerns.

use std::sync::Arc;

use bottega_agents::{AgentId, Performative, Revision, StoreReply, Ticket, Time};

use super::{
    Master,
    assignments::Departure,
    deal,
    pace::{HangingOrder, hanging_order},
    results::{self, Fencing, check_fence, kept_promise},
    rows::{RowFollowUp, StoreUpdate, Write},
    tail,
    trust::{Excluded, Trust, row_after_failure},
    verify::Verdict,
    worth::KeptPromise,
};
use crate::{
    AgentRow, Credit, FarmAction, FarmContent, FarmEffect, FarmMessage, FarmValue, Holding, MemberId, Painting,
    PassedOrder, Proposal, RelativePower, Report, ResultRef, ZoneId, ZoneRow, ZoneState,
    contents::{answer, message},
    protocol,
};

/// Messages of agents.
impl Master {
    pub(super) fn handle_message(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        if message.sender == self.assignments.config.id {
            // Ignore messages that claim to be from the Master itself
            return;
        }
        // Renew the sender's lease
        let sender = self.assignments.roster.find(&message.sender);
        if let Some(sender) = sender {
            self.assignments.roster.hear(now, sender);
        }
        let conversation = message.conversation_id;
        match (message.performative, &message.content) {
            (Performative::Subscribe, FarmContent::Subscription { power, lanes }) => {
                let lanes = if lanes.is_finite() { lanes.clamp(1e-3, 1e6) } else { 1.0 };
                self.subscribe(now, message, *power, lanes, actions);
            }
            (Performative::Cancel, FarmContent::Unsubscription) => {
                if let Some(sender) = sender {
                    self.dismiss(now, sender, Departure::Goodbye, actions);
                }
            }
            (Performative::Inform, FarmContent::Alive { power, orders }) => {
                let roster = &mut self.assignments.roster;
                match sender.filter(|&id| roster.update(id, |row| row.power = *power).is_some()) {
                    Some(sender) => self.take_heartbeat(now, sender, orders, actions),
                    None => self.answer(message, Performative::Refuse, FarmContent::Nothing, actions),
                }
            }
            (Performative::Inform, FarmContent::HandedOver { to, orders }) => {
                self.take_transfer(now, &message.sender, to, orders, actions);
            }
            (Performative::Propose, FarmContent::Bids { room, bids }) => {
                let room = (*room).min(self.assignments.config.prefetch);
                let proposal = Proposal { room, bids: bids.clone() };
                match self.rounds.is_bid(conversation, &proposal) {
                    true => {
                        let roster = &mut self.assignments.roster;
                        self.rounds.take_bid(conversation, sender, Some(proposal), roster);
                    }
                    false => self.take_refusal(now, conversation, sender),
                }
            }
            (Performative::Refuse, FarmContent::Nothing) => self.take_refusal(now, conversation, sender),
            (Performative::Inform | Performative::Failure, FarmContent::Report(report)) => {
                self.take_report(now, message, report, actions);
            }
            (Performative::Inform, FarmContent::Analyzed(_)) | (Performative::NotUnderstood, _) => {}
            _ => self.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions),
        }
    }

    /// Workflow, steps 1 and 4: adds an agent to the list, and sends it the scene if there is one.
    fn subscribe(
        &mut self,
        now: Time,
        message: &FarmMessage,
        power: RelativePower,
        lanes: f64,
        actions: &mut Vec<FarmAction>,
    ) {
        let (agent, assignments) = (&message.sender, &mut self.assignments);
        // Refuse agents that are excluded
        if let Some(reason) = self.trust.refusal(agent, &assignments.roster) {
            return self.answer(message, Performative::Refuse, FarmContent::LeftOut { reason }, actions);
        }
        // Continue with the agent's row if there is one; else begin with the credit of its machine in earlier works
        let known = assignments.roster.get_by_name(agent).map(|member| &member.row);
        let known = known.or_else(|| assignments.rows.board().agent(agent)).cloned().unwrap_or_else(|| {
            let earlier = assignments.config.credits.get(bottega_agents::machine_of(&agent.name));
            let credit = earlier.map(Credit::carried_over).unwrap_or_default();
            AgentRow { credit, ..AgentRow::new(agent.clone(), power, lanes) }
        });
        // Add the agent to the list, unless it is full
        let row = AgentRow { power, lanes, left_out: None, ..known };
        let Some(id) = assignments.roster.join(now, row.clone()) else {
            return self.answer(message, Performative::Refuse, FarmContent::Nothing, actions);
        };
        assignments.refresh_load(now, id);
        // Agree, and send the scene; with stealing, the neighbors too
        self.answer(message, Performative::Agree, FarmContent::Subscribed, actions);
        self.introduce(std::slice::from_ref(&row.agent), actions);
        if self.assignments.config.deals() {
            deal::send_neighbors(id, &mut self.assignments, actions);
        }
        self.assignments.rows.put_agent(row, actions);
    }

    /// Sends the scene to agents, once the work has started.
    pub(super) fn introduce(&self, agents: &[AgentId], actions: &mut Vec<FarmAction>) {
        let work = self.assignments.rows.board().work();
        if let Some(work) = work.filter(|_| self.phase.has_begun && !agents.is_empty()) {
            let (me, scene) = (&self.assignments.config.id, FarmContent::Scene(work.clone()));
            let inform = message(Performative::Inform, protocol::SUBSCRIBE, me, agents.to_vec(), scene);
            actions.push(FarmAction::Send(inform));
        }
    }

    fn take_heartbeat(&mut self, now: Time, sender: MemberId, orders: &[Holding], actions: &mut Vec<FarmAction>) {
        // Send lost orders again, and take back those that hang
        self.assignments.repeat_orders(now, sender, orders, actions);
        self.watch_orders(now, sender, orders, actions);
        if self.assignments.config.deals() {
            deal::send_neighbors(sender, &mut self.assignments, actions);
            if orders.is_empty() {
                self.help_out(now, sender, actions);
            }
        }
    }

    fn take_transfer(
        &mut self,
        now: Time,
        from: &AgentId,
        to: &AgentId,
        orders: &[PassedOrder],
        actions: &mut Vec<FarmAction>,
    ) {
        // Accept the transfer only with stealing, while zones are given out, and to a member
        let is_here = self.assignments.roster.get_by_name(to).is_some() && !self.trust.is_excluded(to);
        if self.assignments.config.deals() && self.phase.gives_out() && is_here {
            deal::hand_over(now, from, to, orders, &mut self.assignments, actions);
        }
    }

    fn take_refusal(&mut self, now: Time, conversation: u64, agent: Option<MemberId>) {
        let rests_until = now + self.assignments.config.timing.heartbeat;
        self.rounds.take_refusal(conversation, agent, rests_until, &mut self.assignments.roster);
    }

    /// Processes the report of an order: confirms or refuses it, and writes the zone's new row.
    fn take_report(&mut self, now: Time, message: &FarmMessage, report: &Report, actions: &mut Vec<FarmAction>) {
        if !self.phase.has_begun {
            // Not all rows are known yet; the agent repeats its report
            return;
        }
        // Check the fencing token
        let (zone, sender) = (report.zone, &message.sender);
        match check_fence(report, sender, &self.trust, &self.assignments) {
            Fencing::Valid => {}
            Fencing::Pending => return,
            Fencing::Known => return actions.push(FarmAction::Send(self.confirmation(message, report))),
            Fencing::Refused(reason) => return self.refuse(message, report, reason, actions),
        }
        // Compute the row after the report, unless a comparison of pixels is needed first
        let after = match &report.outcome {
            Err(reason) => Err(reason.as_str()),
            Ok(painting) => {
                let Some((_, row)) = self.assignments.rows.zone(zone) else { return };
                if !self.verification.can_compare(row, painting, message, &self.trust, actions) {
                    return;
                }
                match self.verification.take_missing(zone, painting) {
                    true => Err("its pixels are not available"),
                    false => self.row_after(report, painting, sender),
                }
            }
        };
        // Measure how well the agent kept its promise, and the worth of the zone
        let promise = kept_promise(now, report, sender, &self.worth, &mut self.assignments);
        if let (Ok(painting), Ok(_)) = (&report.outcome, &after)
            && let Some((_, row)) = self.assignments.rows.zone(zone)
            && let Some(sender) = self.assignments.roster.find(sender).filter(|_| painting.is_measured)
        {
            self.worth.see(sender, row, painting);
        }
        // Write the row and give the verdict on compared agents
        match after {
            Ok((row, verdict)) => {
                self.pass.add(row.time_measured.unwrap_or_default());
                let confirmation = Box::new(self.confirmation(message, report));
                self.verification.forget(&row);
                let then = RowFollowUp::Receive { confirmation, well: true, promise };
                self.assignments.write(now, row, then, actions);
                self.pronounce(now, zone, &verdict, actions);
            }
            Err(reason) => self.take_failure(now, message, report, reason, promise, actions),
        }
    }

    /// Processes a report of a failure, or of a painting that is refused for this reason: takes the zone back and counts
    /// the failure.
    fn take_failure(
        &mut self,
        now: Time,
        message: &FarmMessage,
        report: &Report,
        reason: &str,
        promise: Option<KeptPromise>,
        actions: &mut Vec<FarmAction>,
    ) {
        let (zone, fence, sender) = (report.zone, report.fence, &message.sender);
        tracing::warn!(zone = zone.0, agent = %sender, reason, "zone failed");
        // Compute the zone's row with one more attempt, and answer: a bad painting is refused, a reported failure confirmed
        let row = row_after_failure(zone, sender, &self.assignments);
        if report.outcome.is_ok() {
            self.refuse(message, report, reason, actions);
            if let Some(row) = row {
                self.assignments.write(now, row, RowFollowUp::TakenBack, actions);
            }
        } else {
            let confirmation = self.confirmation(message, report);
            if let Some(row) = row {
                let confirmation = Box::new(confirmation);
                let then = RowFollowUp::Receive { confirmation, well: false, promise };
                self.assignments.write(now, row, then, actions);
            } else {
                actions.push(FarmAction::Send(confirmation));
            }
        }
        self.count_failure(now, sender, (zone, fence), reason, actions);
    }

    /// Returns the zone's row after a valid report of a painting, with the verdict on compared agents; or the reason
    /// to refuse it.
    fn row_after(
        &self,
        report: &Report,
        painting: &Painting,
        sender: &AgentId,
    ) -> Result<(ZoneRow, Verdict), &'static str> {
        let accepted = results::accepted(report.zone, report.fence, painting, &self.worth, &self.assignments)?;
        let accepted = ZoneRow { reasons: report.reasons.clone().or(accepted.reasons.clone()), ..accepted };
        let Some((_, row)) = self.assignments.rows.zone(report.zone) else { return Err("there is no such zone") };
        Ok(self.verification.vote(row, accepted, painting, sender, &self.trust, &self.assignments))
    }

    /// Counts confirmed paintings, and excludes agents found wrong.
    fn pronounce(&mut self, now: Time, zone: ZoneId, verdict: &Verdict, actions: &mut Vec<FarmAction>) {
        // Count a confirmed painting for each agent that was right
        for agent in &verdict.right {
            let Some(id) = self.assignments.roster.find(agent) else { continue };
            let row = self.assignments.roster.update(id, |row| row.agreed = row.agreed.saturating_add(1)).cloned();
            row.into_iter().for_each(|row| self.assignments.rows.put_agent(row, actions));
        }
        // Exclude each agent that was wrong, and take its zones back
        let right: Vec<&str> = verdict.right.iter().map(|agent| &*agent.name).collect();
        for agent in &verdict.wrong {
            let reason = format!("what it painted of {zone} is not what {} painted", right.join(" and "));
            let excluded = self.trust.convict(agent, reason, &mut self.assignments, actions);
            self.dismiss_excluded(now, excluded, actions);
        }
    }

    /// Replies to a message.
    fn answer(
        &self,
        to: &FarmMessage,
        performative: Performative,
        content: FarmContent,
        actions: &mut Vec<FarmAction>,
    ) {
        actions.push(FarmAction::Send(answer(to, &self.assignments.config.id, performative, content)));
    }

    /// Returns the confirmation of a report.
    fn confirmation(&self, message: &FarmMessage, report: &Report) -> FarmMessage {
        let &Report { zone, fence, .. } = report;
        let content = FarmContent::Received { zone, fence };
        answer(message, &self.assignments.config.id, Performative::Confirm, content)
    }

    /// Refuses a report.
    fn refuse(&self, message: &FarmMessage, report: &Report, reason: &str, actions: &mut Vec<FarmAction>) {
        let content = FarmContent::Refused { zone: report.zone, fence: report.fence, reason: reason.to_owned() };
        self.answer(message, Performative::Disconfirm, content, actions);
    }
}

/// Departures, failures and help.
impl Master {
    /// Removes an agent: its zones are open again, or continue with the rival that also holds them.
    pub(super) fn dismiss(&mut self, now: Time, agent: MemberId, how: Departure, actions: &mut Vec<FarmAction>) {
        if let Some(round) = self.assignments.roster.leave(agent).and_then(|member| member.round) {
            self.rounds.remove_agent(round, agent);
        }
        self.assignments.take_all_back(now, agent, how, actions);
    }

    fn dismiss_excluded(&mut self, now: Time, excluded: Option<Excluded>, actions: &mut Vec<FarmAction>) {
        if let Some(Excluded(agent)) = excluded {
            self.dismiss(now, agent, Departure::Goodbye, actions);
        }
    }

    /// Counts a failure of an agent, and dismisses it after too many.
    pub(super) fn count_failure(
        &mut self,
        now: Time,
        agent: &AgentId,
        order: (ZoneId, Revision),
        reason: &str,
        actions: &mut Vec<FarmAction>,
    ) {
        let excluded = self.trust.count_failure(now, agent, order, reason, &mut self.assignments, actions);
        self.dismiss_excluded(now, excluded, actions);
    }

    /// Takes an order of an agent back that has made no progress for too long.
    ///
    /// - `reported`: the orders in the agent's heartbeat.
    pub(super) fn watch_orders(
        &mut self,
        now: Time,
        agent: MemberId,
        reported: &[Holding],
        actions: &mut Vec<FarmAction>,
    ) {
        let hanging = hanging_order(now, agent, reported, &mut self.assignments);
        let Some(HangingOrder { order, reason }) = hanging.filter(|_| self.phase.gives_out()) else { return };
        let (zone, fence, name) = (order.zone, order.fence, self.assignments.roster.name(agent).clone());
        // Cancel it, take the zone back and count the failure
        tracing::warn!(zone = zone.0, agent = %name, "an order hangs: {reason}");
        self.assignments.withdraw(zone, vec![(name.clone(), fence)], actions);
        if let Some(row) = row_after_failure(zone, &name, &self.assignments) {
            self.assignments.write(now, row, RowFollowUp::TakenBack, actions);
        }
        self.count_failure(now, &name, (zone, fence), &reason, actions);
    }

    /// Gives an idle agent a zone that its holder is too slow with.
    fn help_out(&mut self, now: Time, agent: MemberId, actions: &mut Vec<FarmAction>) {
        if !self.phase.is_stopping {
            tail::help_out(now, agent, &mut self.assignments, actions);
        }
    }
}

/// Replies of the store.
impl Master {
    /// Processes a reply of the store. Returns true if it was new.
    pub(super) fn handle_store(
        &mut self,
        now: Time,
        ticket: Ticket,
        reply: StoreReply<FarmValue>,
        actions: &mut Vec<FarmAction>,
    ) -> bool {
        match self.assignments.rows.take_reply(ticket, reply, actions) {
            StoreUpdate::Nothing => false,
            StoreUpdate::Progress => true,
            StoreUpdate::Row(revision, value) => self.see(now, revision, value, actions),
            StoreUpdate::Conflict(zone, row) => {
                if let Some((revision, value)) = row {
                    self.see(now, revision, value, actions);
                }
                self.end_write(now, zone);
                true
            }
        }
    }

    /// Processes a row. It may be the pending one, delivered by the subscription before or instead of the reply.
    /// Returns true if it was new.
    fn see(&mut self, now: Time, revision: Revision, value: FarmValue, actions: &mut Vec<FarmAction>) -> bool {
        match value {
            FarmValue::Zone(row) => self.see_zone(now, revision, &row, actions),
            FarmValue::Agent(row) => self.see_agent(now, revision, row),
            work @ FarmValue::Work(_) => {
                self.assignments.rows.see(revision, work);
                true
            }
            FarmValue::Page(_) => false,
        }
    }

    /// Processes the row of an agent. An agent that is not here is known from before a restart of the Master, and its
    /// lease begins again. Rows that arrive later were written by this Master itself, for agents that may have left
    /// meanwhile.
    fn see_agent(&mut self, now: Time, revision: Revision, row: Arc<AgentRow>) -> bool {
        let assignments = &mut self.assignments;
        let is_new = !self.trust.is_excluded(&row.agent) && assignments.roster.get_by_name(&row.agent).is_none();
        if is_new && row.left_out.is_some() {
            self.trust.restore(&row, assignments.rows.board());
        } else if is_new
            && !assignments.rows.is_caught_up()
            && let Some(id) = assignments.roster.join(now, (*row).clone())
        {
            assignments.refresh_load(now, id);
        }
        assignments.rows.see(revision, FarmValue::Agent(row));
        is_new
    }

    /// Processes the row of a zone: updates the counts and completes a pending write.
    fn see_zone(&mut self, now: Time, revision: Revision, row: &Arc<ZoneRow>, actions: &mut Vec<FarmAction>) -> bool {
        let zone = row.zone;
        if !self.assignments.rows.board().is_new_revision(zone, revision) {
            return false;
        }
        // Update the board, and cancel orders that the row makes void
        let voided = self.assignments.rows.voided_orders(row);
        self.assignments.rows.see(revision, FarmValue::Zone(Arc::clone(row)));
        if let Some(voided) = voided {
            self.assignments.withdraw(zone, voided, actions);
        }
        // Inform the other parts of the Master
        actions.push(FarmAction::Effect(FarmEffect::ZoneChanged(Arc::clone(row))));
        self.assignments.forget_order(zone);
        self.composition.see(row);
        self.trust.doubt(row);
        self.offcuts.see(row, self.assignments.rows.board());
        if matches!(row.state, ZoneState::Profiled | ZoneState::Done | ZoneState::Failed) {
            self.rounds.note_change();
        }
        // Complete the pending write of the zone, if this row is newer; act on it if it is the written row
        match self.assignments.rows.pending_write(zone) {
            Some(write) if revision > write.expected_revision => {
                let is_written = Arc::ptr_eq(&write.row, row) || write.row == *row;
                if let Some(write) = self.end_write(now, zone).filter(|_| is_written) {
                    self.after_write(now, write, revision, actions);
                }
            }
            _ => self.assignments.count(now, row),
        }
        true
    }

    /// Ends a write, successful or not.
    fn end_write(&mut self, now: Time, zone: ZoneId) -> Option<Write> {
        let write = self.assignments.end_write(now, zone);
        if self.assignments.rows.zone(zone).is_none() {
            self.offcuts.note_failed_write(zone);
        }
        write
    }

    /// Takes the action that follows a successful write.
    fn after_write(&mut self, now: Time, write: Write, fence: Revision, actions: &mut Vec<FarmAction>) {
        match write.then {
            RowFollowUp::Order(conversation) => {
                self.assignments.send_order(now, &write.row, fence, conversation, actions);
            }
            RowFollowUp::Receive { confirmation, well, promise } => {
                let name = confirmation.receivers.first().cloned();
                let agent = name.as_ref().and_then(|agent| self.assignments.roster.find(agent));
                actions.push(FarmAction::Send(*confirmation));
                if let Some(name) = name.filter(|_| well) {
                    Trust::clear_failures(&name, &mut self.assignments, actions);
                }
                if write.row.state == ZoneState::Done {
                    self.credits.learn(&write.row, promise, &mut self.assignments.roster, actions);
                }
                if let Some(agent) = agent.filter(|_| !self.assignments.config.deals()) {
                    self.help_out(now, agent, actions);
                }
            }
            RowFollowUp::TakenBack => {}
        }
    }
}

/// Answers of the film, and requests of the user.
impl Master {
    /// Processes the film's answer for a zone.
    pub(super) fn composed(
        &mut self,
        now: Time,
        zone: ZoneId,
        outcome: Result<(), String>,
        actions: &mut Vec<FarmAction>,
    ) {
        // Count a composed zone for its painter
        let was_expected = self.composition.composed(zone, outcome.is_ok());
        let row = self.assignments.rows.zone(zone).map(|(_, row)| row).filter(|_| was_expected);
        let painter = row.and_then(|row| row.agent.clone());
        let Err(reason) = outcome else {
            painter.iter().for_each(|painter| self.trust.count_composed(painter, &self.assignments.roster));
            return;
        };
        // The samples are lost: paint the zone again, and count the loss for its painter
        tracing::warn!(zone = zone.0, reason, "the samples of a zone are lost");
        // If a write is pending, the zone is painted again already, because its painter was found wrong
        let row = self.assignments.rows.settled_zone(zone).filter(|_| was_expected);
        if let Some(row) = row.filter(|row| row.state == ZoneState::Done).map(results::without_samples) {
            self.assignments.write(now, row, RowFollowUp::TakenBack, actions);
        }
        if let Some(painter) = painter {
            let excluded = self.trust.count_lost(now, &painter, &reason, &mut self.assignments, actions);
            self.dismiss_excluded(now, excluded, actions);
        }
    }

    /// Processes a comparison of two tiles, and the report that waited for it.
    pub(super) fn compared(
        &mut self,
        now: Time,
        zone: ZoneId,
        results: [ResultRef; 2],
        outcome: Result<bool, ResultRef>,
        actions: &mut Vec<FarmAction>,
    ) {
        let Some(message) = self.verification.take_comparison(zone, results, outcome) else { return };
        if let FarmContent::Report(report) = &message.content {
            self.take_report(now, &message, report, actions);
        }
    }

    /// Queues a finished zone to be painted again. A zone that is held, or has other samples by now, stays as it is, so
    /// that a repeated request has no effect.
    pub(super) fn requeue(&mut self, now: Time, zone: ZoneId, fence: Option<Revision>, actions: &mut Vec<FarmAction>) {
        let row = self.assignments.rows.settled_zone(zone).filter(|_| self.phase.is_at_work());
        let row = row.filter(|row| row.state == ZoneState::Failed || row.result.map(|result| result.fence) == fence);
        if let Some(row) = row.and_then(ZoneRow::requeued) {
            self.assignments.write(now, row, RowFollowUp::TakenBack, actions);
        }
    }
}
