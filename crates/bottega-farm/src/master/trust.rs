//! Trust: which agents are excluded because they fail often or were found wrong, and which zones depend on their word.

use std::{collections::BTreeMap, sync::Arc};

use bottega_agents::{AgentId, Performative, Revision, Time};
use rustc_hash::FxHashMap;

use super::{assignments::Assignments, roster::Roster, rows::RowFollowUp};
use crate::{
    AgentRow, Blackboard, FarmAction, FarmContent, FarmEffect, MemberId, RelativePower, ZoneId, ZoneRow,
    contents::message, protocol,
};

/// Number of consecutive failures after which an agent is excluded.
const FAILURES_MAX: u32 = 3;
/// Number of consecutive lost or unusable tiles after which an agent is excluded.
const LOST_MAX: u32 = 3;

/// An agent that has just been excluded. Its caller must dismiss it.
#[must_use]
#[derive(Clone, Copy, Debug)]
pub(super) struct Excluded(pub(super) MemberId);

/// The excluded agents, and what may depend on them.
#[derive(Clone, Debug)]
pub(super) struct Trust {
    /// True if paintings are compared, so that agents may be found wrong.
    verifies: bool,
    /// Excluded agents, with the reason in their rows. A hash map for speed; never iterated.
    excluded: FxHashMap<AgentId, Arc<AgentRow>>,
    /// Number of unusable tiles of each agent; mostly empty.
    lost: BTreeMap<MemberId, u32>,
    /// Zones whose rows may depend on a painting of an agent found wrong; mostly empty.
    dubious: Vec<ZoneId>,
}

impl Trust {
    pub(super) fn new(verifies: bool) -> Self {
        Self { verifies, excluded: FxHashMap::default(), lost: BTreeMap::new(), dubious: Vec::new() }
    }

    /// Returns true if an agent is excluded.
    pub(super) fn is_excluded(&self, agent: &AgentId) -> bool {
        self.excluded.contains_key(agent)
    }

    /// Returns true if an agent is excluded for a wrong painting, not for failures.
    pub(super) fn is_wrong(&self, agent: &AgentId) -> bool {
        !self.excluded.is_empty() && self.excluded.get(agent).is_some_and(|row| !has_only_failed(row))
    }

    /// Returns the reason why an agent is excluded, if it is. An agent that only failed is accepted again if there is
    /// no other.
    pub(super) fn refusal(&mut self, agent: &AgentId, roster: &Roster) -> Option<String> {
        let row = self.excluded.get(agent)?;
        if has_only_failed(row) && roster.count() == 0 {
            tracing::warn!(%agent, "takes part again, because no other agent is left");
            self.excluded.remove(agent);
            return None;
        }
        row.left_out.clone()
    }

    /// Takes in the row of an agent that an earlier Master excluded.
    pub(super) fn restore(&mut self, row: &Arc<AgentRow>, board: &Blackboard) {
        self.excluded.insert(row.agent.clone(), Arc::clone(row));
        self.doubt_all(board);
    }

    /// Counts a failure of an agent. After too many it is excluded, unless it is the only one: then the zone is given
    /// up in the end, and reported.
    pub(super) fn count_failure(
        &mut self,
        now: Time,
        agent: &AgentId,
        order: (ZoneId, Revision),
        reason: &str,
        assignments: &mut Assignments,
        actions: &mut Vec<FarmAction>,
    ) -> Option<Excluded> {
        // An agent without a reply repeats its report
        let roster = &mut assignments.roster;
        let id = roster.find(agent).filter(|&id| roster.note_failure(id, order))?;
        let row = roster.update(id, |row| row.failures = row.failures.saturating_add(1))?.clone();
        if row.failures >= FAILURES_MAX && roster.count() > 1 {
            let reason = format!("it failed {} times, the last time: {reason}", row.failures);
            return self.exclude_for_failures(now, id, reason, assignments, actions);
        }
        assignments.rows.put_agent(row, actions);
        None
    }

    /// Clears the failures of an agent that has painted something.
    pub(super) fn clear_failures(agent: &AgentId, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
        let roster = &mut assignments.roster;
        let failed = roster.get_by_name(agent).filter(|member| member.row.failures > 0);
        let Some(id) = failed.map(|member| member.id) else { return };
        roster.forget_failures(id);
        if let Some(row) = roster.update(id, |row| row.failures = 0) {
            let row = row.clone();
            assignments.rows.put_agent(row, actions);
        }
    }

    /// Counts a tile of an agent that was composed.
    pub(super) fn count_composed(&mut self, agent: &AgentId, roster: &Roster) {
        if !self.lost.is_empty()
            && let Some(id) = roster.find(agent)
        {
            self.lost.remove(&id);
        }
    }

    /// Counts a tile of an agent that was lost or unusable.
    pub(super) fn count_lost(
        &mut self,
        now: Time,
        agent: &AgentId,
        reason: &str,
        assignments: &mut Assignments,
        actions: &mut Vec<FarmAction>,
    ) -> Option<Excluded> {
        let id = assignments.roster.find(agent)?;
        let count = self.lost.entry(id).or_default();
        *count += 1;
        if *count < LOST_MAX || assignments.roster.get(id).is_none() || assignments.roster.count() <= 1 {
            return None;
        }
        let reason = format!("what it painted was lost {count} times, the last time: {reason}");
        self.exclude_for_failures(now, id, reason, assignments, actions)
    }

    /// Excludes an agent for its failures: it is not called again, and nothing is accepted from it. Its zones are open
    /// again, and its failures do not count against them.
    fn exclude_for_failures(
        &mut self,
        now: Time,
        agent: MemberId,
        reason: String,
        assignments: &mut Assignments,
        actions: &mut Vec<FarmAction>,
    ) -> Option<Excluded> {
        let row = assignments.roster.get(agent).map(|member| member.row.clone())?;
        for row in forgiven(agent, assignments) {
            if !assignments.rows.is_being_written(row.zone) {
                assignments.write(now, row, RowFollowUp::TakenBack, actions);
            }
        }
        let failures = row.failures.max(FAILURES_MAX);
        Some(self.exclude(agent, AgentRow { failures, ..row }, reason, assignments, actions))
    }

    /// Excludes an agent that painted something wrong, and doubts everything accepted on its word alone.
    pub(super) fn convict(
        &mut self,
        agent: &AgentId,
        reason: String,
        assignments: &mut Assignments,
        actions: &mut Vec<FarmAction>,
    ) -> Option<Excluded> {
        if self.is_wrong(agent) {
            return None;
        }
        // Find the last known row of the agent
        let known = assignments.roster.get_by_name(agent).map(|member| member.row.clone());
        let known = known.or_else(|| self.excluded.get(agent).map(|row| (**row).clone()));
        let known = known.or_else(|| assignments.rows.board().agent(agent).cloned());
        let row = known.unwrap_or_else(|| AgentRow::new(agent.clone(), RelativePower::REFERENCE, 1.0));
        // Exclude it, and check all zones that may depend on it
        let id = assignments.roster.number(agent);
        let excluded = self.exclude(id, AgentRow { failures: 0, agreed: 0, ..row }, reason, assignments, actions);
        self.doubt_all(assignments.rows.board());
        Some(excluded)
    }

    /// Excludes an agent and refuses it from now on.
    ///
    /// - `row`: the known row of the agent.
    fn exclude(
        &mut self,
        agent: MemberId,
        row: AgentRow,
        reason: String,
        assignments: &mut Assignments,
        actions: &mut Vec<FarmAction>,
    ) -> Excluded {
        let name = row.agent.clone();
        tracing::warn!(agent = %name, "left out of the work: {reason}");
        self.lost.remove(&agent);
        let row = Arc::new(AgentRow { left_out: Some(reason.clone()), ..row });
        self.excluded.insert(name.clone(), Arc::clone(&row));
        // Tell the agent and the observers
        let content = FarmContent::LeftOut { reason: reason.clone() };
        let (me, to) = (&assignments.config.id, vec![name.clone()]);
        actions.push(FarmAction::Send(message(Performative::Refuse, protocol::SUBSCRIBE, me, to, content)));
        actions.push(FarmAction::Effect(FarmEffect::LeftOut { agent: name, reason }));
        assignments.rows.put_agent((*row).clone(), actions);
        Excluded(agent)
    }

    /// Returns true if a row depends on an agent found wrong, or counts its vote.
    fn is_dubious(&self, row: &ZoneRow) -> bool {
        let mut sources = row.votes.iter().map(|vote| &vote.agent).chain(&row.word_of);
        sources.any(|agent| self.is_wrong(agent))
    }

    /// Checks a new row. Cheap unless an agent was found wrong.
    pub(super) fn doubt(&mut self, row: &ZoneRow) {
        if self.verifies && !self.excluded.is_empty() && self.is_dubious(row) {
            self.dubious.push(row.zone);
        }
    }

    /// Checks all zones for votes and paintings of agents found wrong.
    pub(super) fn doubt_all(&mut self, board: &Blackboard) {
        if self.verifies && !self.excluded.is_empty() {
            let zones = board.zones().filter(|row| self.is_dubious(row)).map(|row| row.zone);
            self.dubious = zones.collect();
        }
    }

    /// Opens zones again that were accepted on the word of an agent found wrong, and removes its votes elsewhere.
    pub(super) fn repaint_dubious(&mut self, now: Time, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
        while let Some(zone) = self.dubious.pop() {
            // Zones that are held or being written are checked again afterwards
            let row = assignments.rows.settled_zone(zone);
            let Some(row) = row.filter(|row| !row.is_in_hand() && self.is_dubious(row)) else { continue };
            // Paint the zone again if it rests on the agent's word alone; else drop the agent's vote
            let row = if row.word_of.as_ref().is_some_and(|agent| self.is_wrong(agent)) {
                row.unpainted()
            } else {
                let votes = row.votes.iter().filter(|vote| !self.is_wrong(&vote.agent)).cloned().collect();
                ZoneRow { votes, ..row.clone() }
            };
            assignments.write(now, row, RowFollowUp::TakenBack, actions);
        }
    }
}

/// Returns the zone's row after a failure of `agent`. `None`: unchanged, because the agent that took it over continues.
/// If this failure excludes the agent, its failures do not count against the zone.
pub(super) fn row_after_failure(zone: ZoneId, agent: &AgentId, assignments: &Assignments) -> Option<ZoneRow> {
    let (_, row) = assignments.rows.zone(zone)?;
    let member = assignments.roster.get_by_name(agent);
    let is_last_straw =
        member.is_some_and(|member| member.row.failures + 1 >= FAILURES_MAX) && assignments.roster.count() > 1;
    match (&row.agent, &row.rival) {
        (Some(newer), Some(rival)) if rival.agent == *agent && newer != agent => None,
        (_, Some(rival)) if rival.agent != *agent => Some(ZoneRow { agent: None, ..row.clone() }),
        _ if is_last_straw => {
            let failed = member.map_or(&[][..], |member| &member.failed);
            let before = failed.iter().filter(|(other, _)| *other == zone).count() as u32;
            Some(row.reopened(row.attempt.saturating_sub(before)))
        }
        _ => Some(row.taken_back()),
    }
}

/// Returns the rows of zones on which an agent failed, without those attempts.
fn forgiven(agent: MemberId, assignments: &Assignments) -> Vec<ZoneRow> {
    let failed = assignments.roster.get(agent).map_or(&[][..], |member| &member.failed);
    let mut forgiven: Vec<ZoneRow> = Vec::new();
    for &(zone, _) in failed {
        if forgiven.iter().any(|other| other.zone == zone) {
            continue;
        }
        let count = failed.iter().filter(|(other, _)| *other == zone).count() as u32;
        if let Some((_, row)) = assignments.rows.zone(zone).filter(|(_, row)| !row.is_in_hand() && row.attempt > 0) {
            forgiven.push(row.forgiven(count));
        }
    }
    forgiven
}

/// Returns true if an excluded agent only failed, and was not found wrong.
fn has_only_failed(row: &AgentRow) -> bool {
    row.failures >= FAILURES_MAX
}
