//! Works among agents that are not trusted: what one paints is compared with what others make of the same.
//!
//! A step of a zone is accepted when so many agents of different machines as the user asks for made the same of it: bit for
//! bit, or by the look of it where an engine gives no two of them the same bits. Profiles always are; the painting that ends a zone may be accepted on the word of one agent that was right often, and
//! then a share of it is compared all the same, chosen by a hash that only this Master can compute. Who is found wrong is left
//! out, and what was accepted on its word is painted again.

use super::*;
use crate::Vote;

/// An agent that was found right so often may be believed.
const BELIEVED_FROM: u32 = 10;
/// So much of what is painted is compared, whoever painted it.
const COMPARED_MIN: f64 = 0.1;
/// Zones to compare that are looked at after an event: the largest, and the next in turn.
const LARGEST_LOOKED_AT: usize = 8;
const NEXT_LOOKED_AT: usize = 16;

/// It is told when there are too few machines at so many looks in a row.
const LACKING_MAX: u32 = 10;

/// Who was found right or wrong.
#[derive(Clone, Debug, Default)]
pub(super) struct Verdict {
    right: Vec<AgentId>,
    wrong: Vec<AgentId>,
}

impl Master {
    pub(super) fn verifies(&self) -> bool {
        self.config.verify > 1
    }

    /// The row after a report that is sound as such: accepted, or waiting for what others make of it.
    ///
    /// - `accepted`: the row after it, if the agent is believed.
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
        let mut votes: Vec<Vote> = before.votes.iter().filter(counts).cloned().collect();
        votes.push(Vote { agent: agent.clone(), painting: *painting });
        let (same, other): (Vec<&Vote>, Vec<&Vote>) =
            votes.iter().partition(|vote| vote.agent == *agent || self.is_same(zone, painting, &vote.painting));
        let is_last = accepted.state == ZoneState::Done;
        let is_believed = || is_last && other.is_empty() && same.iter().any(|vote| self.believes(vote, zone));
        if same.len() < self.config.verify as usize && !is_believed() {
            let state = if before.state == ZoneState::Profiling { ZoneState::Open } else { ZoneState::Profiled };
            let agent = accepted.agent;
            return (ZoneRow { state, agent, rival: None, votes, ..before.clone() }, Verdict::default());
        }
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

    /// Whether an agent's word is enough for what it painted: it was right often, and this is not among what is compared
    /// all the same. The more often it was right, the less that is.
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

    /// Remembers who was right, and leaves out who was wrong.
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

    /// An agent has painted something wrong: nothing that rests on its word alone counts any more.
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

    /// Whether an agent is left out because it painted something wrong, not for failing.
    pub(super) fn is_wrong(&self, agent: &AgentId) -> bool {
        !self.left_out.is_empty() && self.left_out.get(agent).is_some_and(|row| !Self::only_failed(row))
    }

    /// Whether a row rests on the word of one that was found wrong, or counts it.
    fn is_dubious(&self, row: &ZoneRow) -> bool {
        let mut said = row.votes.iter().map(|vote| &vote.agent).chain(&row.word_of);
        said.any(|agent| self.is_wrong(agent))
    }

    /// A row has been seen. Cheap where nobody was found wrong.
    pub(super) fn doubt(&mut self, row: &ZoneRow) {
        if self.verifies() && !self.left_out.is_empty() && self.is_dubious(row) {
            self.dubious.push(row.zone);
        }
    }

    /// Looks at all zones for the word of somebody who was found wrong.
    pub(super) fn doubt_all(&mut self) {
        if self.verifies() && !self.left_out.is_empty() {
            let zones = self.board.zones().filter(|row| self.is_dubious(row)).map(|row| row.zone);
            self.dubious = zones.collect();
        }
    }

    /// What was accepted on the word of one that was found wrong is painted again; elsewhere its word counts no more.
    pub(super) fn repaint_dubious(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        while let Some(zone) = self.dubious.pop() {
            // What is being written, or in somebody's hand, is seen again after that.
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

    /// Gives zones that wait for what others make of them to those who have not seen them.
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

    /// Tells when zones wait for more machines than there are, and go on to.
    pub(super) fn count_machines(&mut self, actions: &mut Vec<FarmAction>) {
        if !self.verifies() || !self.begun || self.finished {
            return;
        }
        let mut machines: Vec<&str> = self.roster.iter().map(|member| member.row.agent.home()).collect();
        machines.sort_unstable();
        machines.dedup();
        let (present, wanted) = (machines.len(), self.config.verify as usize);
        // Nobody does anything, and zones wait for one who has not seen them.
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
