//! The end of a work: zones are cut so that all agents end together, and what slow agents hold is given to idle ones too.

use super::*;

/// An idle agent takes a zone over when it would be painted in this share of the time that its holder will still need.
const WORTH_IT: f64 = 0.8;
/// An idle agent profiles a zone too that another has been at for longer than this: it is short, or its agent gets ready or hangs.
const PROFILE_MAX: Duration = Duration::from_secs(20);
/// Agents that are looked at as possibly too slow.
const LAGGARDS_MAX: usize = 4;
/// Idle agents that may take something over at one look.
const HELPERS_MAX: usize = 64;

impl Master {
    /// Whether a zone that waits for an auction is large enough for two, and no write to it is under way.
    pub(super) fn can_cut(&self, zone: ZoneId) -> bool {
        self.cut(zone, 0.5).is_some()
    }

    /// The row of a zone of which only a share is left.
    pub(super) fn cut(&self, zone: ZoneId, share: f64) -> Option<ZoneRow> {
        let (work, (revision, row)) = (self.board.work()?, self.board.zone(zone)?);
        // What was cut off before must have its row: it is told from the present one.
        let is_whole = row.cut.is_none_or(|cut| self.board.zone(cut.zone).is_some());
        // A revision makes one write at most, of all that any Master may try: so no two pieces get one id.
        let offcut = ZoneId(u32::try_from(revision.0).ok()?.checked_add(work.zone_count)?);
        let is_free =
            is_whole && row.votes.is_empty() && self.board.zone(offcut).is_none() && !self.writes.contains_key(&zone);
        row.cut_to(share, offcut, &work.settings.frame, work.settings.goal.grid()).filter(|_| is_free)
    }

    /// Remembers that the other part of a cut zone must have a row, until it has.
    pub(super) fn note_cut(&mut self, row: &ZoneRow) {
        self.owed.remove(&row.zone);
        if let Some(cut) = row.cut.filter(|cut| self.board.zone(cut.zone).is_none()) {
            self.owed.insert(cut.zone, row.zone);
            self.due.push(cut.zone);
        }
    }

    /// Writes the rows of what was cut off. The row of the zone that was cut is the word that counts: a Master that dies
    /// in between is followed by one that finds it.
    pub(super) fn write_offcuts(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        while let Some(piece) = self.due.pop() {
            let Some(&zone) = self.owed.get(&piece).filter(|_| !self.writes.contains_key(&piece)) else { continue };
            if let Some(row) = self.board.zone(zone).and_then(|(_, row)| row.offcut()) {
                self.write(now, row, RowFollowUp::TakenBack, actions);
            }
        }
    }

    /// An agent has just finished something. If there is nothing for it to do, it may take over what another is too slow
    /// with.
    pub(super) fn help_out(&mut self, now: Time, agent: MemberId, actions: &mut Vec<FarmAction>) {
        if !self.config.shares_tail
            || self.stopping
            || !self.ledger.open.is_empty()
            || self.ledger.next_unseen().is_some()
        {
            return;
        }
        self.roster.keep_laggards();
        let Some(helper) = self.roster.get(agent).filter(|member| member.is_idle()) else { return };
        let (own, name) = (helper.own(), self.roster.name(agent));
        let worth_it = |zone: ZoneId, ready: Time| {
            let (_, row) = self.board.zone(zone)?;
            let is_free = row.rival.is_none() && row.is_new_to(name) && !self.writes.contains_key(&zone);
            let sent = self.sent.get(&zone);
            if row.state == ZoneState::Profiling {
                // Nobody knows how long it should take, but it is short, or has been forgotten.
                let is_long = sent.is_some_and(|&sent| now - sent > PROFILE_MAX);
                return (is_free && is_long && row.agent.as_ref() != Some(name)).then_some(zone);
            }
            let left = if ready >= now {
                ready - now
            } else {
                // It should have been finished. Nothing better is known than that it goes on as it did.
                sent.map_or(Duration::ZERO, |&sent| now - sent)
            };
            let takes = own * row.time_estimated?.as_secs_f64();
            let gain = takes < WORTH_IT * left.as_secs_f64();
            (is_free && row.state == ZoneState::Awarded && gain && row.agent.as_ref() != Some(name)).then_some(zone)
        };
        let zones = self.roster.laggards(now, LAGGARDS_MAX).flat_map(|member| {
            // The last one it will come to last.
            self.ledger.hands(member.id).rev().map(|zone| (zone, member.ready))
        });
        let found = zones.into_iter().find_map(|(zone, ready)| worth_it(zone, ready));
        let Some((revision, row)) = found.and_then(|zone| self.board.zone(zone)) else { return };
        let rival = row.agent.clone().map(|agent| Rival { agent, fence: revision });
        tracing::info!(zone = row.zone.0, agent = %name, "takes a zone over");
        let row = ZoneRow { agent: Some(name.clone()), rival, ..row.clone() };
        let conversation = self.number();
        self.write(now, row, RowFollowUp::Order(conversation), actions);
    }

    /// The same for all who have nothing to do.
    pub(super) fn help_all(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if self.begun && self.config.shares_tail && self.ledger.open.is_empty() {
            for agent in self.roster.idle(HELPERS_MAX) {
                self.help_out(now, agent, actions);
            }
        }
    }

    /// Of a zone that two agents have and that `row` says to be painted: who has it in vain, under which token.
    pub(super) fn rivals(&self, row: &ZoneRow) -> Option<Vec<(AgentId, Revision)>> {
        let (revision, before) = self.board.zone(row.zone)?;
        if before.rival.is_none() || row.is_in_hand() {
            return None;
        }
        let vain = before.holders().filter(|agent| row.agent.as_ref() != Some(agent));
        let vain = vain.filter_map(|agent| Some((agent.clone(), before.fence_of(agent, revision)?)));
        Some(vain.collect())
    }

    /// A zone that two agents had is painted: the other one may stop.
    pub(super) fn withdraw(&self, zone: ZoneId, vain: Vec<(AgentId, Revision)>, actions: &mut Vec<FarmAction>) {
        for (agent, fence) in vain {
            let content = FarmContent::Withdrawn { zone, fence };
            let cancel = message(Performative::Cancel, protocol::CONTRACT_NET, &self.config.id, vec![agent], content);
            actions.push(FarmAction::Send(cancel));
        }
    }
}
