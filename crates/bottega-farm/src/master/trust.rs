//! Exclusion of agents that fail often.

use super::{members::Departure, *};

/// Number of consecutive failures after which an agent is excluded.
const FAILURES_MAX: u32 = 3;
/// Number of consecutive lost or unusable tiles after which an agent is excluded.
const LOST_MAX: u32 = 3;

impl Master {
    /// Counts a failure of an agent. After too many it is excluded, unless it is the only one: then the zone is given
    /// up in the end, and reported.
    pub(super) fn strike(
        &mut self,
        now: Time,
        agent: &AgentId,
        order: (ZoneId, Revision),
        reason: &str,
        actions: &mut Vec<FarmAction>,
    ) {
        // An agent without a reply repeats its report
        let Some(id) = self.roster.find(agent).filter(|&id| self.roster.note_failure(id, order)) else { return };
        let Some(row) = self.roster.update(id, |row| row.failures = row.failures.saturating_add(1)) else { return };
        let row = row.clone();
        if row.failures >= FAILURES_MAX && self.roster.count() > 1 {
            let reason = format!("it failed {} times, the last time: {reason}", row.failures);
            return self.leave_out(now, id, reason, actions);
        }
        self.put_agent(row, actions);
    }

    /// Counts a failure of an agent that fell silent while it held orders.
    pub(super) fn strike_silent(&mut self, now: Time, agent: MemberId, actions: &mut Vec<FarmAction>) {
        let name = self.roster.name(agent).clone();
        if let Some(order) = self.orders_of(agent, &[]).first() {
            self.strike(now, &name, (order.zone, order.fence), "it fell silent", actions);
        }
    }

    /// True if the next failure of an agent excludes it.
    pub(super) fn is_last_straw(&self, agent: &AgentId) -> bool {
        let member = self.roster.get_by_name(agent);
        member.is_some_and(|member| member.row.failures + 1 >= FAILURES_MAX) && self.roster.count() > 1
    }

    /// Clears the failures of an agent that has painted something.
    pub(super) fn succeed(&mut self, agent: &AgentId, actions: &mut Vec<FarmAction>) {
        let failed = self.roster.get_by_name(agent).filter(|member| member.row.failures > 0);
        let Some(id) = failed.map(|member| member.id) else { return };
        self.roster.forget_failures(id);
        if let Some(row) = self.roster.update(id, |row| row.failures = 0) {
            let row = row.clone();
            self.put_agent(row, actions);
        }
    }

    /// Counts a tile of an agent that was composed, or was lost or unusable.
    pub(super) fn judge_tile(&mut self, now: Time, agent: &AgentId, lost: Option<&str>, actions: &mut Vec<FarmAction>) {
        if lost.is_none() && self.lost.is_empty() {
            return;
        }
        let Some(id) = self.roster.find(agent) else { return };
        let Some(reason) = lost else {
            self.lost.remove(&id);
            return;
        };
        let count = self.lost.entry(id).or_default();
        *count += 1;
        if *count >= LOST_MAX && self.roster.get(id).is_some() && self.roster.count() > 1 {
            let reason = format!("what it painted was lost {count} times, the last time: {reason}");
            self.leave_out(now, id, reason, actions);
        }
    }

    /// Excludes an agent for its failures: it is not called again, and nothing is accepted from it. Its zones are open
    /// again, and its failures do not count against them.
    pub(super) fn leave_out(&mut self, now: Time, agent: MemberId, reason: String, actions: &mut Vec<FarmAction>) {
        let Some(row) = self.roster.get(agent).map(|member| member.row.clone()) else { return };
        for (zone, row) in self.forgiven(agent) {
            if !self.writes.contains_key(&zone) {
                self.write(now, row, RowFollowUp::TakenBack, actions);
            }
        }
        let failures = row.failures.max(FAILURES_MAX);
        self.exclude(now, agent, AgentRow { failures, ..row }, reason, actions);
    }

    /// Excludes an agent and refuses it from now on.
    ///
    /// - `row`: the known row of the agent.
    pub(super) fn exclude(
        &mut self,
        now: Time,
        agent: MemberId,
        row: AgentRow,
        reason: String,
        actions: &mut Vec<FarmAction>,
    ) {
        let name = row.agent.clone();
        tracing::warn!(agent = %name, "left out of the work: {reason}");
        self.lost.remove(&agent);
        let row = Arc::new(AgentRow { left_out: Some(reason.clone()), ..row });
        self.left_out.insert(name.clone(), Arc::clone(&row));
        let content = FarmContent::LeftOut { reason: reason.clone() };
        let to = vec![name.clone()];
        let refuse = message(Performative::Refuse, protocol::SUBSCRIBE, &self.config.id, to, content);
        actions.push(FarmAction::Send(refuse));
        actions.push(FarmAction::Effect(FarmEffect::LeftOut { agent: name, reason }));
        self.put_agent((*row).clone(), actions);
        self.dismiss(now, agent, Departure::Goodbye, actions);
    }

    /// The rows of zones on which an agent failed, without those attempts.
    fn forgiven(&self, agent: MemberId) -> Vec<(ZoneId, ZoneRow)> {
        let zones = self.roster.get(agent).map_or(&[][..], |member| &member.failed);
        let mut forgiven: Vec<(ZoneId, ZoneRow)> = Vec::new();
        for &(zone, _) in zones {
            if forgiven.iter().any(|(other, _)| *other == zone) {
                continue;
            }
            let count = zones.iter().filter(|(other, _)| *other == zone).count() as u32;
            if let Some((_, row)) = self.board.zone(zone).filter(|(_, row)| !row.is_in_hand() && row.attempt > 0) {
                forgiven.push((zone, row.forgiven(count)));
            }
        }
        forgiven
    }

    /// True if an excluded agent only failed, and was not found wrong.
    pub(super) fn only_failed(row: &AgentRow) -> bool {
        row.failures >= FAILURES_MAX
    }

    /// The reason why an agent is excluded, if it is. An agent that only failed is accepted again if there is no other.
    pub(super) fn refused(&mut self, agent: &AgentId) -> Option<String> {
        let row = self.left_out.get(agent)?;
        if Self::only_failed(row) && self.roster.count() == 0 {
            tracing::warn!(%agent, "takes part again, for there is nobody else");
            self.left_out.remove(agent);
            return None;
        }
        row.left_out.clone()
    }
}
