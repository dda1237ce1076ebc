//! Giving out work: profiles, rounds of the auction, tiles for the film.

use super::*;
use crate::Bid;

impl Master {
    /// Everything that follows from what is known. Called after each event.
    pub(super) fn advance(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if !self.caught_up || !self.board.is_complete() || self.finished {
            return;
        }
        if !self.begun {
            self.begin(now, actions);
        }
        if self.begun && !self.stopping {
            self.write_offcuts(now, actions);
            self.repaint_dubious(now, actions);
            self.plan_pass(now, actions);
            self.give_out_profiles(now, actions);
            self.close_rounds(now, actions);
            self.give_out_comparisons(now, actions);
            if self.config.auction == AuctionRule::Stealing {
                self.deal(now, actions);
            } else {
                self.recall(now);
                while self.open_round(now, actions) {}
            }
        }
        if self.begun {
            self.compose(actions);
            self.finish(actions);
        }
    }

    fn begin(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let Some(work) = self.board.work().cloned() else { return };
        let zones = self.board.zones().filter(|row| row.root.is_none());
        let rects: Vec<_> = zones.map(|row| row.rect).collect();
        let in_order = rects.is_sorted_by_key(|rect| (rect.y0, rect.x0));
        if !in_order || !Partition::covers(work.settings.frame, &rects) {
            let reason = "the zones on the blackboard are no partition of the frame".to_owned();
            actions.push(FarmAction::Effect(FarmEffect::Abandon { reason }));
            actions.push(FarmAction::Stop);
            self.finished = true;
            return;
        }
        self.begun = true;
        self.pass_begun = now;
        actions.push(FarmAction::Effect(FarmEffect::BeginFilm(work)));
        self.introduce(&self.roster.present(), actions);
        self.doubt_all();
    }

    fn give_out_profiles(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        while let Some(zone) = self.ledger.next_unseen() {
            let Some(agent) = self.roster.freest() else { return };
            let Some((_, row)) = self.board.zone(zone) else { return };
            if self.writes.contains_key(&zone) {
                return;
            }
            let agent = Some(self.roster.name(agent).clone());
            let row = ZoneRow { state: ZoneState::Profiling, agent, ..row.clone() };
            let conversation = self.number();
            self.write(now, row, RowFollowUp::Order(conversation), actions);
        }
    }

    /// Calls all who are idle or will be soon, some at a time, once one of them needs another zone. Returns whether there was
    /// anything to call for.
    fn open_round(&mut self, now: Time, actions: &mut Vec<FarmAction>) -> bool {
        if !self.ledger.open.has_waiting() || !self.roster.is_due(now) {
            return false;
        }
        let bidders = self.roster.bidders(BIDDERS_MAX);
        let conversation = self.number();
        let offers = self.ledger.open.offer(conversation, bidders.len());
        let deadline = now + self.config.timing.bids;
        let content = FarmContent::Offers(offers.as_slice().into());
        let to = self.names(&bidders);
        let cfp = message(Performative::CallForProposal, protocol::CONTRACT_NET, &self.config.id, to, content);
        actions.push(FarmAction::Send(asking(cfp, conversation, Some(deadline))));
        self.roster.call(conversation, &bidders);
        self.rounds.insert(
            conversation,
            Round { deadline, offers, called: bidders.len() as u32, awaited: bidders, proposals: Vec::new() },
        );
        true
    }

    pub(super) fn names(&self, agents: &[MemberId]) -> Vec<AgentId> {
        agents.iter().map(|&agent| self.roster.name(agent).clone()).collect()
    }

    /// Whether a proposal is for anything on offer. Who bids for nothing refuses: it must not count as one who could take
    /// what others bid for.
    pub(super) fn is_bid(&self, conversation: u64, proposal: &Proposal) -> bool {
        let offers = self.rounds.get(&conversation).map_or(&[][..], |round| &round.offers);
        let is_offered = |bid: &Bid| offers.iter().any(|offer| offer.zone == bid.zone);
        proposal.room > 0 && proposal.bids.iter().any(is_offered)
    }

    /// An agent wants none of what it was called for: it is not asked again for a while.
    pub(super) fn take_refusal(&mut self, now: Time, conversation: u64, agent: Option<MemberId>) {
        let awaited = |agent: &MemberId| self.rounds.get(&conversation).is_some_and(|it| it.awaited.contains(agent));
        if let Some(agent) = agent.filter(awaited) {
            self.roster.rest(agent, now + self.config.timing.heartbeat);
        }
        self.take_bid(conversation, agent, None);
    }

    /// Takes the answer of an agent to a call for proposals; `None`: it refuses.
    pub(super) fn take_bid(&mut self, conversation: u64, agent: Option<MemberId>, proposal: Option<Proposal>) {
        let Some(round) = self.rounds.get_mut(&conversation) else { return };
        let place = round.awaited.iter().position(|awaited| Some(*awaited) == agent);
        if let Some(agent) = place.map(|place| round.awaited.swap_remove(place)) {
            match proposal {
                Some(proposal) => {
                    round.proposals.push((agent, proposal));
                    self.roster.note_bid(agent);
                }
                None => self.roster.release(agent),
            }
        }
        if round.awaited.is_empty() {
            self.answered.push(conversation);
        }
    }

    /// Ends the rounds in which all have answered, and those whose time is over.
    fn close_rounds(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        for conversation in std::mem::take(&mut self.answered) {
            self.close_round(now, conversation, actions);
        }
        while let Some((&conversation, round)) = self.rounds.first_key_value() {
            if round.deadline > now && !round.awaited.is_empty() {
                return;
            }
            self.close_round(now, conversation, actions);
        }
    }

    fn close_round(&mut self, now: Time, conversation: u64, actions: &mut Vec<FarmAction>) {
        let Some(mut round) = self.rounds.remove(&conversation) else { return };
        // Silence is a refusal.
        for &agent in &round.awaited {
            self.roster.release(agent);
            self.roster.rest(agent, now + self.config.timing.heartbeat);
        }
        round.proposals.sort_unstable_by_key(|(agent, _)| *agent);
        let bidders: Vec<MemberId> = round.proposals.iter().map(|(agent, _)| *agent).collect();
        let bids: usize = round.proposals.iter().map(|(_, proposal)| proposal.bids.len()).sum();
        let Decision { awards: winners, credit_decided } = self.decide(now, &round.offers, round.proposals);
        let summary = RoundSummary {
            round: conversation,
            offers: round.offers.len() as u32,
            called: round.called,
            bidders: bidders.len() as u32,
            bids: bids as u32,
            awards: winners.len() as u32,
            credit_decided,
        };
        actions.push(FarmAction::Effect(FarmEffect::RoundClosed(summary)));
        for offer in round.offers {
            self.ledger.open.give_back(self.config.auction, conversation, offer);
        }
        let is_lucky = |agent: MemberId| winners.iter().any(|award| award.agent == agent);
        let losers: Vec<MemberId> = bidders.iter().copied().filter(|&agent| !is_lucky(agent)).collect();
        for &agent in &losers {
            // Who needs a zone is asked again when things have changed, and not in a circle; the others with the next who does.
            self.roster.pass_over(now, agent);
        }
        if !losers.is_empty() {
            let (me, to) = (&self.config.id, self.names(&losers));
            let reject = message(Performative::RejectProposal, protocol::CONTRACT_NET, me, to, FarmContent::Nothing);
            actions.push(FarmAction::Send(asking(reject, conversation, None)));
        }
        for award in &winners {
            self.give(now, award, conversation, actions);
        }
        for &agent in &bidders {
            self.roster.release(agent);
        }
        self.recalls = true;
        if winners.is_empty() {
            self.in_vain.extend(bidders);
        } else {
            self.in_vain.clear();
        }
    }

    /// The largest zone that nobody took waits for the agent that would have finished it soonest. That one may have been
    /// passed over when things were otherwise.
    fn recall(&mut self, now: Time) {
        if !std::mem::take(&mut self.recalls) || self.roster.is_due(now) || !self.roster.has_passed_over() {
            return;
        }
        if self.config.auction == AuctionRule::Paper {
            return self.roster.ask_again(&self.in_vain);
        }
        let Some(time) = self.ledger.open.largest_waiting() else { return };
        let soonest = self.roster.field().soonest(now.elapsed().as_secs_f64(), time.as_secs_f64());
        if let Some((_, agent)) = soonest.filter(|(_, agent)| !self.in_vain.contains(agent)) {
            self.roster.reconsider(agent);
        }
    }

    fn decide(&self, now: Time, offers: &[Offer], proposals: Vec<(MemberId, Proposal)>) -> Decision {
        let still_open = |offer: &&Offer| {
            let row = self.board.zone(offer.zone);
            let is_open = |row: &ZoneRow| row.state == ZoneState::Profiled && !row.is_waiting();
            row.is_some_and(|(_, row)| is_open(row)) && !self.writes.contains_key(&offer.zone)
        };
        let offers: Vec<Offer> = offers.iter().filter(still_open).copied().collect();
        let bidder = |(agent, proposal): (MemberId, Proposal)| {
            let member = self.roster.get(agent)?;
            let (credit, worth, own) = (member.row.credit.sum, member.worth(), member.promised_own());
            Some(Bidder { agent, credit, worth, own, proposal })
        };
        let bidders = proposals.into_iter().filter_map(bidder).collect();
        let can_cut: &dyn Fn(ZoneId) -> bool = &|zone| self.can_cut(zone);
        let standing = BidderStanding {
            field: self.roster.field(),
            now: now.elapsed().as_secs_f64(),
            open: self.ledger.waiting_time().as_secs_f64(),
            can_cut: self.config.shares_tail.then_some(can_cut),
        };
        decide(self.config.auction, &offers, bidders, &standing)
    }

    pub(super) fn give(&mut self, now: Time, award: &Award, conversation: u64, actions: &mut Vec<FarmAction>) {
        let Some((_, row)) = self.board.zone(award.zone) else { return };
        let row = match award.share {
            None => row.clone(),
            Some(share) => match self.cut(award.zone, share) {
                Some(row) => row,
                None => return,
            },
        };
        let agent = Some(self.roster.name(award.agent).clone());
        let row = ZoneRow { state: ZoneState::Awarded, agent, ..row };
        self.write(now, row, RowFollowUp::Order(conversation), actions);
    }

    fn compose(&mut self, actions: &mut Vec<FarmAction>) {
        if self.film_is_stale {
            if self.composition.composing_count() > 0 {
                return;
            }
            self.begin_film_anew(actions);
        }
        while self.composition.composing_count() < COMPOSING_MAX {
            let all_chosen = self.board.zone_count() == self.ledger.chosen_count();
            let Some((zone, mask)) = self.composition.next(&self.board, all_chosen) else { return };
            let Some(result) = self.board.zone(zone).and_then(|(_, row)| row.result) else { return };
            actions.push(FarmAction::Effect(FarmEffect::Compose { zone, result, mask }));
        }
    }

    /// What was composed is void; the rows say what is to be composed.
    fn begin_film_anew(&mut self, actions: &mut Vec<FarmAction>) {
        let Some(work) = self.board.work().cloned() else { return };
        self.film_is_stale = false;
        self.composition = Composition::default();
        self.board.zones().for_each(|row| self.composition.see(row));
        actions.push(FarmAction::Effect(FarmEffect::BeginFilm(work)));
    }

    /// Workflow, step 8: the picture is whole.
    fn finish(&mut self, actions: &mut Vec<FarmAction>) {
        let zone_count = self.board.zone_count();
        if self.film_is_stale
            || self.ledger.settled_count() < zone_count
            || !self.writes.is_empty()
            || !self.owed.is_empty()
        {
            return;
        }
        let failed: Vec<ZoneId> =
            self.board.zones().filter(|row| row.state == ZoneState::Failed).map(|row| row.zone).collect();
        if self.composition.composed_count() + failed.len() < zone_count {
            return;
        }
        self.finished = true;
        actions.push(FarmAction::Effect(FarmEffect::Finish { failed }));
        let to = self.roster.present();
        if !to.is_empty() {
            let end = FarmContent::LifeCycle(LifeCycle::Terminate);
            let request = message(Performative::Request, protocol::REQUEST, &self.config.id, to, end);
            actions.push(FarmAction::Send(request));
        }
        if let Some(registrant) = &mut self.registrant {
            registrant.leave(actions);
        }
        actions.push(FarmAction::Stop);
    }
}
