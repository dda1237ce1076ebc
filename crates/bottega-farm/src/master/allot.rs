//! Giving out work: profiles, rounds of the auction, tiles for the film.

use super::*;

impl Master {
    /// Everything that follows from what is known. Called after each event.
    pub(super) fn advance(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if !self.caught_up || !self.board.is_complete() || self.finished {
            return;
        }
        if !self.begun {
            self.begin(actions);
        }
        if self.begun && !self.stopping {
            self.give_out_profiles(actions);
            if self.round.as_ref().is_some_and(|round| round.awaited.is_empty() || round.deadline <= now) {
                self.close_round(now, actions);
            }
            if self.round.is_none() {
                self.open_round(now, actions);
            }
        }
        if self.begun {
            self.compose(actions);
            self.finish(actions);
        }
    }

    fn begin(&mut self, actions: &mut Vec<FarmAction>) {
        let Some(work) = self.board.work().cloned() else { return };
        let rects: Vec<_> = self.board.zones().map(|row| row.rect).collect();
        let in_order = rects.is_sorted_by_key(|rect| (rect.y0, rect.x0));
        if !in_order || !Partition::covers(work.settings.frame, &rects) {
            let reason = "the zones on the blackboard are no partition of the frame".to_owned();
            actions.push(FarmAction::Effect(FarmEffect::Abandon { reason }));
            actions.push(FarmAction::Stop);
            self.finished = true;
            return;
        }
        self.begun = true;
        actions.push(FarmAction::Effect(FarmEffect::BeginFilm(work)));
        self.introduce(&self.roster.names(), actions);
    }

    fn give_out_profiles(&mut self, actions: &mut Vec<FarmAction>) {
        while let Some(zone) = self.ledger.next_unseen() {
            let Some(agent) = self.roster.freest(PROFILE_WINDOW) else { return };
            let Some((_, row)) = self.board.zone(zone) else { return };
            if self.writes.contains_key(&zone) {
                return;
            }
            let row = ZoneRow { state: ZoneState::Profiling, agent: Some(agent), ..row.clone() };
            let conversation = self.number();
            self.write(row, Then::Order(conversation), actions);
        }
    }

    fn open_round(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if self.ledger.open.is_empty() {
            return;
        }
        let bidders = self.roster.bidders(now, self.config.prefetch as usize, BIDDERS_MAX);
        if bidders.is_empty() {
            return;
        }
        let (conversation, offers) = (self.number(), self.ledger.open.offers());
        let deadline = now + self.config.timing.bids;
        let to = bidders.iter().cloned().collect();
        let content = FarmContent::Offers(offers.clone());
        let cfp = message(Performative::CallForProposal, protocol::CONTRACT_NET, &self.config.id, to, content);
        actions.push(FarmAction::Send(asking(cfp, conversation, Some(deadline))));
        self.round = Some(Round { conversation, deadline, offers, awaited: bidders, proposals: BTreeMap::new() });
    }

    pub(super) fn take_bid(&mut self, message: &FarmMessage, proposal: Option<Proposal>) {
        let Some(round) = self.round.as_mut().filter(|round| round.conversation == message.conversation_id) else {
            return;
        };
        if round.awaited.remove(&message.sender)
            && let Some(proposal) = proposal
        {
            round.proposals.insert(message.sender.clone(), proposal);
        }
    }

    fn close_round(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let Some(mut round) = self.round.take() else { return };
        // Silence is a refusal.
        for agent in &round.awaited {
            if let Some(member) = self.roster.get_mut(agent) {
                member.rests_until = now + self.config.timing.heartbeat;
            }
        }
        let contenders = self.roster.contenders(now);
        let end = expected_end(&contenders, self.ledger.open.time_estimated());
        let still_open = |offer: &Offer| {
            let row = self.board.zone(offer.zone);
            row.is_some_and(|(_, row)| row.state == ZoneState::Profiled) && !self.writes.contains_key(&offer.zone)
        };
        round.offers.retain(still_open);
        let winners = award(self.config.auction, &round.offers, &round.proposals, &contenders, end);
        let lucky: BTreeSet<&AgentId> = winners.iter().map(|(_, agent)| agent).collect();
        let losers: Vec<AgentId> = round.proposals.keys().filter(|agent| !lucky.contains(agent)).cloned().collect();
        for agent in &losers {
            if let Some(member) = self.roster.get_mut(agent) {
                // Asked again when things have changed, and not in a circle.
                member.passed_over = true;
            }
        }
        if !losers.is_empty() {
            let nothing = FarmContent::Nothing;
            let me = &self.config.id;
            let reject = message(Performative::RejectProposal, protocol::CONTRACT_NET, me, losers, nothing);
            actions.push(FarmAction::Send(asking(reject, round.conversation, None)));
        }
        for (zone, agent) in winners {
            let Some((_, row)) = self.board.zone(zone) else { continue };
            let row = ZoneRow { state: ZoneState::Awarded, agent: Some(agent), ..row.clone() };
            self.write(row, Then::Order(round.conversation), actions);
        }
    }

    fn compose(&mut self, actions: &mut Vec<FarmAction>) {
        while self.composition.composing_count() < COMPOSING_MAX {
            let all_chosen = self.board.work().is_some_and(|w| w.zone_count as usize == self.ledger.chosen_count());
            let Some((zone, mask)) = self.composition.next(&self.board, all_chosen) else { return };
            let Some(result) = self.board.zone(zone).and_then(|(_, row)| row.result) else { return };
            actions.push(FarmAction::Effect(FarmEffect::Compose { zone, result, mask }));
        }
    }

    /// Workflow, step 8: the picture is whole.
    fn finish(&mut self, actions: &mut Vec<FarmAction>) {
        let Some(work) = self.board.work() else { return };
        if self.ledger.settled_count() < work.zone_count as usize || !self.writes.is_empty() {
            return;
        }
        let failed: Vec<ZoneId> =
            self.board.zones().filter(|row| row.state == ZoneState::Failed).map(|row| row.zone).collect();
        if self.composition.composed_count() + failed.len() < work.zone_count as usize {
            return;
        }
        self.finished = true;
        actions.push(FarmAction::Effect(FarmEffect::Finish { failed }));
        let to = self.roster.names();
        if !to.is_empty() {
            let end = FarmContent::LifeCycle(LifeCycle::Terminate);
            let request = message(Performative::Request, protocol::REQUEST, &self.config.id, to, end);
            actions.push(FarmAction::Send(request));
        }
        actions.push(FarmAction::Stop);
    }
}
