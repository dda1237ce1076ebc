//! The end of a work: zones are cut so that all agents finish together, and zones of slow agents are also given to idle
//! ones.

use super::*;

/// An idle agent takes a zone over if it needs less than this share of its holder's remaining time.
const WORTH_IT: f64 = 0.8;
/// Time after which an idle agent repeats another agent's profile: profiles are short, so that agent is still preparing
/// or hangs.
const PROFILE_MAX: Duration = Duration::from_secs(20);
/// Number of agents tested as possibly too slow.
const LAGGARDS_MAX: usize = 4;
/// Maximum number of idle agents that take zones over per check.
const HELPERS_MAX: usize = 64;

impl Master {
    /// True if a waiting zone is large enough to cut and has no pending write.
    pub(super) fn can_cut(&self, zone: ZoneId) -> bool {
        self.cut(zone, 0.5).is_some()
    }

    /// The row of a zone after cutting it so that `share` of it is left; `None` if it cannot be cut.
    pub(super) fn cut(&self, zone: ZoneId, share: f64) -> Option<ZoneRow> {
        let (work, (revision, row)) = (self.board.work()?, self.board.zone(zone)?);
        // The row of an earlier piece must exist, because it is derived from the current row.
        let is_whole = row.cut.is_none_or(|cut| self.board.zone(cut.zone).is_some());
        // The piece's id is derived from the revision, which admits one write only, so that ids are unique.
        let offcut = ZoneId(u32::try_from(revision.0).ok()?.checked_add(work.zone_count)?);
        let is_free =
            is_whole && row.votes.is_empty() && self.board.zone(offcut).is_none() && !self.writes.contains_key(&zone);
        row.cut_to(share, offcut, &work.settings.frame, work.settings.goal.grid()).filter(|_| is_free)
    }

    /// Remembers that the row of a new piece must be written.
    pub(super) fn note_cut(&mut self, row: &ZoneRow) {
        self.owed.remove(&row.zone);
        if let Some(cut) = row.cut.filter(|cut| self.board.zone(cut.zone).is_none()) {
            self.owed.insert(cut.zone, row.zone);
            self.due.push(cut.zone);
        }
    }

    /// Writes the rows of new pieces. The cut in the zone's own row is binding: a Master that fails in between is
    /// followed by one that writes the piece's row.
    pub(super) fn write_offcuts(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        while let Some(piece) = self.due.pop() {
            let Some(&zone) = self.owed.get(&piece).filter(|_| !self.writes.contains_key(&piece)) else { continue };
            if let Some(row) = self.board.zone(zone).and_then(|(_, row)| row.offcut()) {
                self.write(now, row, RowFollowUp::TakenBack, actions);
            }
        }
    }

    /// Gives an idle agent a zone that its holder is too slow with, if no other zones wait.
    pub(super) fn help_out(&mut self, now: Time, agent: MemberId, actions: &mut Vec<FarmAction>) {
        if !self.config.shares_tail
            || self.stopping
            || !self.ledger.open.is_empty()
            || self.ledger.next_unseen().is_some()
        {
            return;
        }
        self.roster.keep_laggards();
        // Require an idle helper
        let Some(helper) = self.roster.get(agent).filter(|member| member.is_idle()) else { return };
        let (own, name) = (helper.own(), self.roster.name(agent));
        let worth_it = |zone: ZoneId, ready: Time| {
            let (_, row) = self.board.zone(zone)?;
            let is_free = row.rival.is_none() && row.is_new_to(name) && !self.writes.contains_key(&zone);
            let sent = self.sent.get(&zone);
            if row.state == ZoneState::Profiling {
                // The expected time is unknown, but profiles are short
                let is_long = sent.is_some_and(|&sent| now - sent > PROFILE_MAX);
                return (is_free && is_long && row.agent.as_ref() != Some(name)).then_some(zone);
            }
            let left = if ready >= now {
                ready - now
            } else {
                // It is late; assume that it needs as long again
                sent.map_or(Duration::ZERO, |&sent| now - sent)
            };
            let takes = own * row.time_estimated?.as_secs_f64();
            let gain = takes < WORTH_IT * left.as_secs_f64();
            (is_free && row.state == ZoneState::Awarded && gain && row.agent.as_ref() != Some(name)).then_some(zone)
        };
        // Search the zones of the slowest agents, from the end of their queues
        let zones = self.roster.laggards(now, LAGGARDS_MAX).flat_map(|member| {
            // The zone that its holder begins last comes first
            self.ledger.hands(member.id).rev().map(|zone| (zone, member.ready))
        });
        let found = zones.into_iter().find_map(|(zone, ready)| worth_it(zone, ready));
        let Some((revision, row)) = found.and_then(|zone| self.board.zone(zone)) else { return };
        // Write the takeover: the old holder becomes the rival
        let rival = row.agent.clone().map(|agent| Rival { agent, fence: revision });
        tracing::info!(zone = row.zone.0, agent = %name, "takes a zone over");
        let row = ZoneRow { agent: Some(name.clone()), rival, ..row.clone() };
        let conversation = self.number();
        self.write(now, row, RowFollowUp::Order(conversation), actions);
    }

    /// Does this for all idle agents.
    pub(super) fn help_all(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if self.begun && self.config.shares_tail && self.ledger.open.is_empty() {
            for agent in self.roster.idle(HELPERS_MAX) {
                self.help_out(now, agent, actions);
            }
        }
    }

    /// The agents, with their fencing tokens, whose orders become void when a zone held by two agents gets `row`.
    pub(super) fn rivals(&self, row: &ZoneRow) -> Option<Vec<(AgentId, Revision)>> {
        let (revision, before) = self.board.zone(row.zone)?;
        if before.rival.is_none() || row.is_in_hand() {
            return None;
        }
        let vain = before.holders().filter(|agent| row.agent.as_ref() != Some(agent));
        let vain = vain.filter_map(|agent| Some((agent.clone(), before.fence_of(agent, revision)?)));
        Some(vain.collect())
    }

    /// Cancels the other agent's order for a zone that was held by two.
    pub(super) fn withdraw(&self, zone: ZoneId, vain: Vec<(AgentId, Revision)>, actions: &mut Vec<FarmAction>) {
        for (agent, fence) in vain {
            let content = FarmContent::Withdrawn { zone, fence };
            let cancel = message(Performative::Cancel, protocol::CONTRACT_NET, &self.config.id, vec![agent], content);
            actions.push(FarmAction::Send(cancel));
        }
    }
}
