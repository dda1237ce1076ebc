//! Assigning work: profiling orders, rounds of the auction, tiles for the film.

use super::*;
use crate::Bid;

impl Master {
    /// Takes all steps that follow from the current state. Called after each event.
    pub(super) fn advance(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if !self.caught_up || !self.board.is_complete() || self.finished {
            return;
        }
        // Start when the rows are complete
        if !self.begun {
            self.begin(now, actions);
        }
        if self.begun && !self.stopping {
            // Write the rows of cut pieces, and discard the samples of agents found wrong
            self.write_offcuts(now, actions);
            self.repaint_dubious(now, actions);
            // Plan the next pass, with a goal of time
            self.plan_pass(now, actions);
            // Order profiles of zones without samples
            self.give_out_profiles(now, actions);
            // Award the zones of rounds that have ended
            self.close_rounds(now, actions);
            // Order second paintings to compare
            self.give_out_comparisons(now, actions);
            // Deal zones out, or open new rounds
            if self.config.auction == AuctionRule::Stealing {
                self.deal(now, actions);
            } else {
                self.recall(now);
                while self.open_round(now, actions) {}
            }
        }
        // Hand painted zones to the film, and end when all are composed
        if self.begun {
            self.compose(actions);
            self.finish(actions);
        }
    }

    /// Starts the work: checks the zones, begins the film and introduces the scene to the agents.
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

    /// Orders profiles, the most complex zone first, from the agents that finish one soonest.
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

    /// Opens a round once an agent needs another zone: calls all agents that need one soonest, up to [`BIDDERS_MAX`].
    /// Returns false if there is nothing to offer or no agent needs a zone.
    fn open_round(&mut self, now: Time, actions: &mut Vec<FarmAction>) -> bool {
        if !self.ledger.open.has_waiting() || !self.roster.is_due(now) {
            return false;
        }
        // Choose the bidders and the zones on offer
        let bidders = self.roster.bidders(BIDDERS_MAX);
        let conversation = self.number();
        let offers = self.ledger.open.offer(conversation, bidders.len());
        // Send the call for proposals
        let deadline = now + self.config.timing.bids;
        let content = FarmContent::Offers(offers.as_slice().into());
        let to = self.names(&bidders);
        let cfp = message(Performative::CallForProposal, protocol::CONTRACT_NET, &self.config.id, to, content);
        actions.push(FarmAction::Send(asking(cfp, conversation, Some(deadline))));
        // Mark the bidders as called
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

    /// True if a proposal bids for a zone on offer. A proposal without such a bid is a refusal, so that it does not
    /// count as competition.
    pub(super) fn is_bid(&self, conversation: u64, proposal: &Proposal) -> bool {
        let offers = self.rounds.get(&conversation).map_or(&[][..], |round| &round.offers);
        let is_offered = |bid: &Bid| offers.iter().any(|offer| offer.zone == bid.zone);
        proposal.room > 0 && proposal.bids.iter().any(is_offered)
    }

    /// Takes in a refusal: the agent is not called again for a heartbeat.
    pub(super) fn take_refusal(&mut self, now: Time, conversation: u64, agent: Option<MemberId>) {
        let awaited = |agent: &MemberId| self.rounds.get(&conversation).is_some_and(|it| it.awaited.contains(agent));
        if let Some(agent) = agent.filter(awaited) {
            self.roster.rest(agent, now + self.config.timing.heartbeat);
        }
        self.take_bid(conversation, agent, None);
    }

    /// Takes in an agent's answer to a call for proposals; `None`: a refusal.
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

    /// Ends the rounds in which all have answered or whose deadline is over.
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

    /// Decides a round, announces the result and writes the awards.
    fn close_round(&mut self, now: Time, conversation: u64, actions: &mut Vec<FarmAction>) {
        let Some(mut round) = self.rounds.remove(&conversation) else { return };
        // Agents that have not answered have refused
        for &agent in &round.awaited {
            self.roster.release(agent);
            self.roster.rest(agent, now + self.config.timing.heartbeat);
        }
        // Decide the round, with bidders in order of their ids
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
        // Return all zones on offer; those awarded below leave when their rows are counted
        for offer in round.offers {
            self.ledger.open.give_back(self.config.auction, conversation, offer);
        }
        let is_lucky = |agent: MemberId| winners.iter().any(|award| award.agent == agent);
        let losers: Vec<MemberId> = bidders.iter().copied().filter(|&agent| !is_lucky(agent)).collect();
        for &agent in &losers {
            // An agent that needs a zone is called again only after a change; others with the next round
            self.roster.pass_over(now, agent);
        }
        // Send reject-proposal to the losers
        if !losers.is_empty() {
            let (me, to) = (&self.config.id, self.names(&losers));
            let reject = message(Performative::RejectProposal, protocol::CONTRACT_NET, me, to, FarmContent::Nothing);
            actions.push(FarmAction::Send(asking(reject, conversation, None)));
        }
        // Write the awards
        for award in &winners {
            self.give(now, award, conversation, actions);
        }
        for &agent in &bidders {
            self.roster.release(agent);
        }
        // Note whether the round was in vain
        self.recalls = true;
        if winners.is_empty() {
            self.in_vain.extend(bidders);
        } else {
            self.in_vain.clear();
        }
    }

    /// Lets the agent that finishes the largest waiting zone soonest bid again. It may have been passed over in a
    /// different situation.
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

    /// Runs the auction's rule on the zones of a round that are still open.
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

    /// Writes an award to the zone's row, cutting the zone if the award is for a part of it.
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

    /// Hands painted zones to the film, as many as it takes at a time.
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

    /// Begins a new film and composes all painted zones again.
    fn begin_film_anew(&mut self, actions: &mut Vec<FarmAction>) {
        let Some(work) = self.board.work().cloned() else { return };
        self.film_is_stale = false;
        self.composition = Composition::default();
        self.board.zones().for_each(|row| self.composition.see(row));
        actions.push(FarmAction::Effect(FarmEffect::BeginFilm(work)));
    }

    /// Workflow, step 8: ends the work when the picture is complete.
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
