//! Verification among untrusted agents: compares the paintings of several agents.
//!
//! A step of a zone is accepted when the requested number of agents on different machines agree on it, bit for bit, or
//! by its look if the engine is not bit-identical between agents. Profiles are always compared. The final painting of
//! an agent that was often right may be accepted alone; a share of these is compared anyway, selected by a hash that
//! only this Master can compute. An agent found wrong is excluded, and everything accepted on its word alone is painted
//! again.

use super::*;
use crate::Vote;

/// Number of confirmed paintings from which an agent may be believed.
const BELIEVED_FROM: u32 = 10;
/// Minimum share of paintings that is compared, for any agent.
const COMPARED_MIN: f64 = 0.1;
/// Zones to compare that are tested after each event: the most complex ones, and the next in rotation.
const LARGEST_LOOKED_AT: usize = 8;
const NEXT_LOOKED_AT: usize = 16;

/// Number of consecutive checks with too few machines before it is reported.
const LACKING_MAX: u32 = 10;

/// The agents found right and wrong by a comparison.
#[derive(Clone, Debug, Default)]
pub(super) struct Verdict {
    right: Vec<AgentId>,
    wrong: Vec<AgentId>,
}

impl Master {
    /// True if paintings are compared.
    pub(super) fn verifies(&self) -> bool {
        self.config.verify > 1
    }

    /// The row after a valid report: accepted, or waiting for further votes.
    ///
    /// - `accepted`: the row if the report is accepted.
    pub(super) fn compared(
        &self,
        before: &ZoneRow,
        accepted: ZoneRow,
        painting: &Painting,
        agent: &AgentId,
    ) -> (ZoneRow, Verdict) {
        let accepted = ZoneRow { agent: Some(agent.clone()), rival: None, ..accepted };
        if !self.verifies() {
            return (accepted, Verdict::default());
        }
        let zone = before.zone;
        let is_there = |vote: &Vote| !self.is_gone(zone, &vote.painting);
        let counts = |vote: &&Vote| vote.agent != *agent && !self.is_wrong(&vote.agent) && is_there(vote);
        // Collect the votes that count, including the new one
        let mut votes: Vec<Vote> = before.votes.iter().filter(counts).cloned().collect();
        votes.push(Vote { agent: agent.clone(), painting: *painting });
        // Split them into those that agree with the report and those that do not
        let (same, other): (Vec<&Vote>, Vec<&Vote>) =
            votes.iter().partition(|vote| vote.agent == *agent || self.is_same(zone, painting, &vote.painting));
        let is_last = accepted.state == ZoneState::Done;
        let is_believed = || is_last && other.is_empty() && same.iter().any(|vote| self.believes(vote, zone));
        // Wait for further votes, unless enough agree or the agent is believed
        if same.len() < self.config.verify as usize && !is_believed() {
            let state = if before.state == ZoneState::Profiling { ZoneState::Open } else { ZoneState::Profiled };
            let agent = accepted.agent;
            return (ZoneRow { state, agent, rival: None, votes, ..before.clone() }, Verdict::default());
        }
        // Take the median of T_est of those that agree
        let mut times: Vec<Duration> = same.iter().map(|vote| vote.painting.time_left).collect();
        times.sort_unstable();
        let time_left = times.get((times.len() - 1) / 2).copied();
        let time_estimated = if is_last { accepted.time_estimated } else { time_left };
        let names = |votes: &[&Vote]| votes.iter().map(|vote| vote.agent.clone()).collect();
        let is_checked = same.len() > 1;
        let right = if is_checked { names(&same) } else { Vec::new() };
        let verdict = Verdict { right, wrong: names(&other) };
        let word_of = (!is_checked).then(|| agent.clone());
        (ZoneRow { votes: Vec::new(), word_of, time_estimated, ..accepted }, verdict)
    }

    /// True if an agent's painting is accepted without comparison: it was right often enough, and the painting is not
    /// in the random share that is compared anyway. That share falls with the number of confirmed paintings.
    fn believes(&self, vote: &Vote, zone: ZoneId) -> bool {
        let member = self.roster.get_by_name(&vote.agent).map(|member| &member.row);
        let agreed = member.or_else(|| self.board.agent(&vote.agent)).map_or(0, |row| row.agreed);
        if agreed < BELIEVED_FROM {
            return false;
        }
        let share = (f64::from(BELIEVED_FROM) / f64::from(agreed)).sqrt().max(COMPARED_MIN);
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.config.secret.to_le_bytes());
        hasher.update(&zone.0.to_le_bytes());
        hasher.update(&vote.painting.result.fence.0.to_le_bytes());
        hasher.update(&vote.painting.result.digest.0);
        let mut bits = [0; 4];
        bits.copy_from_slice(&hasher.finalize().as_bytes()[..4]);
        f64::from(u32::from_le_bytes(bits)) >= share * f64::from(u32::MAX)
    }

    /// Counts confirmed paintings, and excludes agents found wrong.
    pub(super) fn pronounce(&mut self, now: Time, zone: ZoneId, verdict: &Verdict, actions: &mut Vec<FarmAction>) {
        for agent in &verdict.right {
            let Some(id) = self.roster.find(agent) else { continue };
            let row = self.roster.update(id, |row| row.agreed = row.agreed.saturating_add(1)).cloned();
            row.into_iter().for_each(|row| self.put_agent(row, actions));
        }
        let right: Vec<&str> = verdict.right.iter().map(|agent| &*agent.name).collect();
        for agent in &verdict.wrong {
            let reason = format!("what it painted of {zone} is not what {} painted", right.join(" and "));
            self.convict(now, agent, reason, actions);
        }
    }

    /// Excludes an agent that painted something wrong, and discards everything accepted on its word alone.
    fn convict(&mut self, now: Time, agent: &AgentId, reason: String, actions: &mut Vec<FarmAction>) {
        if self.is_wrong(agent) {
            return;
        }
        let known = self.roster.get_by_name(agent).map(|member| member.row.clone());
        let known = known.or_else(|| self.left_out.get(agent).map(|row| (**row).clone()));
        let known = known.or_else(|| self.board.agent(agent).cloned());
        let row = known.unwrap_or_else(|| AgentRow::new(agent.clone(), RelativePower::REFERENCE, 1.0));
        let id = self.roster.number(agent);
        self.exclude(now, id, AgentRow { failures: 0, agreed: 0, ..row }, reason, actions);
        self.doubt_all();
    }

    /// True if an agent is excluded for a wrong painting, not for failures.
    pub(super) fn is_wrong(&self, agent: &AgentId) -> bool {
        !self.left_out.is_empty() && self.left_out.get(agent).is_some_and(|row| !Self::only_failed(row))
    }

    /// True if a row depends on an agent found wrong, or counts its vote.
    fn is_dubious(&self, row: &ZoneRow) -> bool {
        let mut said = row.votes.iter().map(|vote| &vote.agent).chain(&row.word_of);
        said.any(|agent| self.is_wrong(agent))
    }

    /// Checks a new row. Cheap unless an agent was found wrong.
    pub(super) fn doubt(&mut self, row: &ZoneRow) {
        if self.verifies() && !self.left_out.is_empty() && self.is_dubious(row) {
            self.dubious.push(row.zone);
        }
    }

    /// Checks all zones for votes and paintings of agents found wrong.
    pub(super) fn doubt_all(&mut self) {
        if self.verifies() && !self.left_out.is_empty() {
            let zones = self.board.zones().filter(|row| self.is_dubious(row)).map(|row| row.zone);
            self.dubious = zones.collect();
        }
    }

    /// Opens zones again that were accepted on the word of an agent found wrong, and removes its votes elsewhere.
    pub(super) fn repaint_dubious(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        while let Some(zone) = self.dubious.pop() {
            // Zones that are held or being written are checked again afterwards
            let row = self.board.zone(zone).map(|(_, row)| row).filter(|row| !row.is_in_hand() && self.is_dubious(row));
            let Some(row) = row.filter(|_| !self.writes.contains_key(&zone)) else { continue };
            let row = if row.word_of.as_ref().is_some_and(|agent| self.is_wrong(agent)) {
                row.unpainted()
            } else {
                let votes = row.votes.iter().filter(|vote| !self.is_wrong(&vote.agent)).cloned().collect();
                ZoneRow { votes, ..row.clone() }
            };
            self.write(now, row, RowFollowUp::TakenBack, actions);
        }
    }

    /// Assigns zones that need further votes to agents on machines that have not voted.
    pub(super) fn give_out_comparisons(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if !self.verifies() || !self.roster.has_free() {
            return;
        }
        let zones: Vec<ZoneId> = self.ledger.comparisons(LARGEST_LOOKED_AT, NEXT_LOOKED_AT);
        for zone in zones {
            let Some((_, row)) = self.board.zone(zone).filter(|_| !self.writes.contains_key(&zone)) else { continue };
            let Some(agent) = self.roster.first_free(|agent| row.is_new_to(agent)) else { continue };
            let agent = Some(self.roster.name(agent).clone());
            let state = if row.state == ZoneState::Open { ZoneState::Profiling } else { ZoneState::Awarded };
            let row = ZoneRow { state, agent, ..row.clone() };
            let conversation = self.number();
            self.write(now, row, RowFollowUp::Order(conversation), actions);
        }
    }

    /// Reports that zones wait for more machines than there are, once that lasts.
    pub(super) fn count_machines(&mut self, actions: &mut Vec<FarmAction>) {
        if !self.verifies() || !self.begun || self.finished {
            return;
        }
        let mut machines: Vec<&str> = self.roster.iter().map(|member| member.row.agent.home()).collect();
        machines.sort_unstable();
        machines.dedup();
        let (present, wanted) = (machines.len(), self.config.verify as usize);
        // No agent is working, and zones wait for one that has not voted
        let is_stuck = self.ledger.in_hand_count() == 0 && self.ledger.comparison_count() > 0;
        let lacks = present < wanted || is_stuck && self.ledger.open.is_empty() && self.ledger.next_unseen().is_none();
        self.lacking = if lacks { self.lacking.saturating_add(1) } else { 0 };
        if self.lacking == LACKING_MAX {
            let needed = wanted.max(present + 1);
            tracing::warn!(present, needed, "too few machines to compare what they paint");
            actions.push(FarmAction::Effect(FarmEffect::TooFew { present, needed }));
        }
    }
}
