//! Verification among untrusted agents: compares the paintings of several agents.
//!
//! A step of a zone is accepted when the requested number of agents on different machines agree on it, bit for bit, or
//! by its look if the engine is not bit-identical between agents. Profiles are always compared. The final painting of
//! an agent that was often right may be accepted alone; a share of these is compared anyway, selected by a hash that
//! only this Master can compute. An agent found wrong is excluded, and everything accepted on its word alone is painted
//! again.

use std::{sync::Arc, time::Duration};

use bottega_agents::{AgentId, Time};

use super::{assignments::Assignments, comparisons::Comparisons, config::MasterConfig, trust::Trust};
use crate::{FarmAction, FarmEffect, FarmMessage, Painting, ResultRef, Vote, ZoneId, ZoneRow, ZoneState};

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
    pub(super) right: Vec<AgentId>,
    pub(super) wrong: Vec<AgentId>,
}

/// The comparison of paintings: votes, pixels, and the machines that are needed.
#[derive(Clone, Debug)]
pub(super) struct Verification {
    config: Arc<MasterConfig>,
    comparisons: Comparisons,
    /// Number of consecutive checks with too few machines to compare paintings.
    lacking: u32,
}

impl Verification {
    pub(super) fn new(config: Arc<MasterConfig>) -> Self {
        Self { config, comparisons: Comparisons::default(), lacking: 0 }
    }

    /// Returns the row after a valid report: accepted, or waiting for further votes.
    ///
    /// - `accepted`: the row if the report is accepted.
    pub(super) fn vote(
        &self,
        before: &ZoneRow,
        accepted: ZoneRow,
        painting: &Painting,
        agent: &AgentId,
        trust: &Trust,
        assignments: &Assignments,
    ) -> (ZoneRow, Verdict) {
        let accepted = ZoneRow { agent: Some(agent.clone()), rival: None, ..accepted };
        if !self.config.verifies() {
            return (accepted, Verdict::default());
        }
        let zone = before.zone;
        let is_there = |vote: &Vote| !self.is_missing(zone, &vote.painting);
        let counts = |vote: &&Vote| vote.agent != *agent && !trust.is_wrong(&vote.agent) && is_there(vote);
        // Collect the votes that count, including the new one
        let mut votes: Vec<Vote> = before.votes.iter().filter(counts).cloned().collect();
        votes.push(Vote { agent: agent.clone(), painting: *painting });
        // Split them into those that agree with the report and those that do not
        let (same, other): (Vec<&Vote>, Vec<&Vote>) =
            votes.iter().partition(|vote| vote.agent == *agent || self.is_same(zone, painting, &vote.painting));
        let is_last = accepted.state == ZoneState::Done;
        let is_believed =
            || is_last && other.is_empty() && same.iter().any(|vote| self.believes(vote, zone, assignments));
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

    /// Returns true if an agent's painting is accepted without comparison: it was right often enough, and the
    /// painting is not in the random share that is compared anyway. That share falls with the number of confirmed
    /// paintings.
    fn believes(&self, vote: &Vote, zone: ZoneId, assignments: &Assignments) -> bool {
        let member = assignments.roster.get_by_name(&vote.agent).map(|member| &member.row);
        let agreed = member.or_else(|| assignments.rows.board().agent(&vote.agent)).map_or(0, |row| row.agreed);
        if agreed < BELIEVED_FROM {
            return false;
        }
        // Compare a share of the paintings that falls with the number of confirmed ones
        let share = (f64::from(BELIEVED_FROM) / f64::from(agreed)).sqrt().max(COMPARED_MIN);
        // Select that share by a keyed hash of the painting, which no agent can predict
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.config.secret.to_le_bytes());
        hasher.update(&zone.0.to_le_bytes());
        hasher.update(&vote.painting.result.fence.0.to_le_bytes());
        hasher.update(&vote.painting.result.digest.0);
        let mut bits = [0; 4];
        bits.copy_from_slice(&hasher.finalize().as_bytes()[..4]);
        f64::from(u32::from_le_bytes(bits)) >= share * f64::from(u32::MAX)
    }

    /// Returns true if two paintings of a zone agree: bit for bit, or by their look.
    fn is_same(&self, zone: ZoneId, one: &Painting, other: &Painting) -> bool {
        if !self.config.compares_by_look {
            return one.is_same(other);
        }
        let pair = (zone, one.result.digest, other.result.digest);
        one.may_look_like(other) && (pair.1 == pair.2 || self.comparisons.result(&pair) == Some(true))
    }

    /// Returns true if the tile of a vote could not be fetched, so the vote does not count.
    fn is_missing(&self, zone: ZoneId, painting: &Painting) -> bool {
        self.comparisons.is_missing(zone, painting.result.digest)
    }

    /// Returns true if the tile of a report could not be fetched, and removes that mark: the next report of it may be of a tile that
    /// exists.
    pub(super) fn take_missing(&mut self, zone: ZoneId, painting: &Painting) -> bool {
        self.comparisons.take_missing(zone, painting.result.digest)
    }

    /// Returns true if the votes of others can be compared with this report now. If not, a comparison of pixels is
    /// pending, and the report is processed after it.
    pub(super) fn can_compare(
        &mut self,
        before: &ZoneRow,
        painting: &Painting,
        report: &FarmMessage,
        trust: &Trust,
        actions: &mut Vec<FarmAction>,
    ) -> bool {
        if !self.config.verifies() || !self.config.compares_by_look {
            return true;
        }
        let zone = before.zone;
        if self.comparisons.is_awaited(zone) {
            // The agent repeats its report later; so does another agent whose report is not the waiting one
            return false;
        }
        // Find a vote whose pixels must be compared with the report's
        let is_open = |vote: &&Vote| {
            let pair = (zone, painting.result.digest, vote.painting.result.digest);
            vote.agent != report.sender
                && !trust.is_wrong(&vote.agent)
                && !self.is_missing(zone, &vote.painting)
                && painting.may_look_like(&vote.painting)
                && pair.1 != pair.2
                && self.comparisons.result(&pair).is_none()
        };
        let Some(vote) = before.votes.iter().find(is_open).filter(|_| !self.is_missing(zone, painting)) else {
            return true;
        };
        // Postpone the report, and have the two tiles compared
        let results = [painting.result, vote.painting.result];
        self.comparisons.postpone(zone, report.clone());
        actions.push(FarmAction::Effect(FarmEffect::Compare { zone, results }));
        false
    }

    /// Records a comparison of two tiles. Returns the report that waited for it.
    ///
    /// - `outcome`: true if they may be the same picture; or the tile that could not be fetched.
    pub(super) fn take_comparison(
        &mut self,
        zone: ZoneId,
        results: [ResultRef; 2],
        outcome: Result<bool, ResultRef>,
    ) -> Option<FarmMessage> {
        let [one, other] = results.map(|result| result.digest);
        match outcome {
            Ok(is_same) => self.comparisons.record((zone, one, other), is_same),
            Err(missing) => self.comparisons.record_missing(zone, missing.digest),
        }
        self.comparisons.take_postponed(zone)
    }

    /// Drops the comparisons of a zone without votes.
    pub(super) fn forget(&mut self, row: &ZoneRow) {
        if row.votes.is_empty() {
            self.comparisons.forget(row.zone);
        }
    }

    /// Assigns zones that need further votes to agents on machines that have not voted.
    pub(super) fn order_comparisons(&self, now: Time, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
        if !self.config.verifies() || !assignments.roster.has_free() {
            return;
        }
        let zones: Vec<ZoneId> = assignments.ledger.comparisons(LARGEST_LOOKED_AT, NEXT_LOOKED_AT);
        for zone in zones {
            let Some(row) = assignments.rows.settled_zone(zone) else { continue };
            // Give the zone to a free agent on a machine without a vote
            let Some(agent) = assignments.roster.first_free(|agent| row.is_new_to(agent)) else { continue };
            let agent = Some(assignments.roster.name(agent).clone());
            let state = if row.state == ZoneState::Open { ZoneState::Profiling } else { ZoneState::Awarded };
            let row = ZoneRow { state, agent, ..row.clone() };
            assignments.order(now, row, actions);
        }
    }

    /// Reports that zones wait for more machines than there are, once that lasts.
    pub(super) fn count_machines(&mut self, assignments: &Assignments, actions: &mut Vec<FarmAction>) {
        if !self.config.verifies() {
            return;
        }
        let Assignments { roster, ledger, .. } = assignments;
        // Count the processes, each of which is a machine for the farm, not the agents
        let mut machines: Vec<&str> = roster.iter().map(|member| member.row.agent.home()).collect();
        machines.sort_unstable();
        machines.dedup();
        let (present, wanted) = (machines.len(), self.config.verify as usize);
        // No agent is working, and zones wait for one that has not voted
        let is_stuck = ledger.in_hand_count() == 0 && ledger.comparison_count() > 0;
        let lacks = present < wanted || is_stuck && ledger.open.is_empty() && ledger.next_unseen().is_none();
        self.lacking = if lacks { self.lacking.saturating_add(1) } else { 0 };
        if self.lacking == LACKING_MAX {
            let needed = wanted.max(present + 1);
            tracing::warn!(present, needed, "too few machines to compare what they paint");
            actions.push(FarmAction::Effect(FarmEffect::TooFew { present, needed }));
        }
    }
}
