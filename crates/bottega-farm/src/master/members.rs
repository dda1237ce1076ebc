//! The Master's agents: their messages, leases and departures.

use super::*;

/// The reason why an agent leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Departure {
    /// It says goodbye, or is excluded: its zones are not to blame.
    Goodbye,
    /// Its lease is over: one of its zones may have crashed it.
    Silence,
}

impl Master {
    pub(super) fn handle_message(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        if message.sender == self.config.id {
            // Ignore messages that claim to be from the Master itself
            return;
        }
        let sender = self.roster.find(&message.sender);
        if let Some(sender) = sender {
            self.roster.hear(now, sender);
        }
        match (message.performative, &message.content) {
            (Performative::Subscribe, FarmContent::Subscription { power, lanes }) => {
                let lanes = if lanes.is_finite() { lanes.clamp(1e-3, 1e6) } else { 1.0 };
                self.subscribe(now, message, *power, lanes, actions);
            }
            (Performative::Cancel, FarmContent::Unsubscription) => {
                if let Some(sender) = sender {
                    self.dismiss(now, sender, Departure::Goodbye, actions);
                }
            }
            (Performative::Inform, FarmContent::Alive { power, hands }) => {
                let known = sender.filter(|&id| self.roster.update(id, |row| row.power = *power).is_some());
                let Some(sender) = known else {
                    return self.answer(message, Performative::Refuse, FarmContent::Nothing, actions);
                };
                self.repeat_orders(now, sender, hands, actions);
                self.watch_pace(now, sender, hands, actions);
                if self.config.auction == AuctionRule::Stealing {
                    self.tell_neighbors(sender, actions);
                    if hands.is_empty() {
                        self.help_out(now, sender, actions);
                    }
                }
            }
            (Performative::Inform, FarmContent::HandedOver { to, orders }) => {
                self.hand_over(now, &message.sender, to, orders, actions);
            }
            (Performative::Propose, FarmContent::Bids { room, bids }) => {
                let proposal = Proposal { room: (*room).min(self.config.prefetch), bids: bids.clone() };
                match self.is_bid(message.conversation_id, &proposal) {
                    true => self.take_bid(message.conversation_id, sender, Some(proposal)),
                    false => self.take_refusal(now, message.conversation_id, sender),
                }
            }
            (Performative::Refuse, FarmContent::Nothing) => self.take_refusal(now, message.conversation_id, sender),
            (Performative::Inform | Performative::Failure, FarmContent::Report(report)) => {
                self.take_report(now, message, report, actions);
            }
            (Performative::Inform, FarmContent::Analyzed(_)) | (Performative::NotUnderstood, _) => {}
            _ => self.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions),
        }
    }

    /// Workflow, steps 1 and 4: adds an agent to the list, and sends it the scene if there is one.
    fn subscribe(
        &mut self,
        now: Time,
        message: &FarmMessage,
        power: RelativePower,
        lanes: f64,
        actions: &mut Vec<FarmAction>,
    ) {
        let agent = &message.sender;
        if let Some(reason) = self.refused(agent) {
            return self.answer(message, Performative::Refuse, FarmContent::LeftOut { reason }, actions);
        }
        let known = self.roster.get_by_name(agent).map(|member| &member.row).or_else(|| self.board.agent(agent));
        let known = known.cloned().unwrap_or_else(|| {
            let credit = self
                .config
                .credits
                .get(bottega_agents::machine_of(&agent.name))
                .map(Credit::carried_over)
                .unwrap_or_default();
            AgentRow { credit, ..AgentRow::new(agent.clone(), power, lanes) }
        });
        let row = AgentRow { power, lanes, left_out: None, ..known };
        let Some(id) = self.roster.join(now, row.clone()) else {
            return self.answer(message, Performative::Refuse, FarmContent::Nothing, actions);
        };
        self.refresh_hands(now, id);
        self.answer(message, Performative::Agree, FarmContent::Subscribed, actions);
        self.introduce(std::slice::from_ref(&row.agent), actions);
        if self.config.auction == AuctionRule::Stealing {
            self.tell_neighbors(id, actions);
        }
        self.put_agent(row, actions);
    }

    /// Sends the scene to agents, once the work has started.
    pub(super) fn introduce(&self, agents: &[AgentId], actions: &mut Vec<FarmAction>) {
        if let Some(work) = self.board.work().filter(|_| self.begun && !agents.is_empty()) {
            let scene = FarmContent::Scene(work.clone());
            let to = agents.to_vec();
            let inform = message(Performative::Inform, protocol::SUBSCRIBE, &self.config.id, to, scene);
            actions.push(FarmAction::Send(inform));
        }
    }

    /// Removes an agent: its zones are open again, or continue with the rival that also holds them.
    pub(super) fn dismiss(&mut self, now: Time, agent: MemberId, how: Departure, actions: &mut Vec<FarmAction>) {
        let round = self.roster.leave(agent).and_then(|member| member.round);
        if let Some(round) = round.and_then(|round| self.rounds.get_mut(&round)) {
            round.awaited.retain(|other| *other != agent);
            round.proposals.retain(|(other, _)| *other != agent);
        }
        self.take_all_back(now, agent, how, actions);
    }

    /// Takes all zones back that an agent holds.
    fn take_all_back(&mut self, now: Time, agent: MemberId, how: Departure, actions: &mut Vec<FarmAction>) {
        let (zones, name) = (self.ledger.hands(agent).collect::<Vec<_>>(), self.roster.name(agent).clone());
        for zone in zones {
            self.take_back(now, zone, &name, how, actions);
        }
    }

    /// Takes a zone back from an agent.
    fn take_back(&mut self, now: Time, zone: ZoneId, agent: &AgentId, how: Departure, actions: &mut Vec<FarmAction>) {
        if let Some((_, row)) = self.board.zone(zone)
            && row.is_in_hand()
            && !self.writes.contains_key(&zone)
        {
            let is_here = |other: &AgentId| other != agent && self.roster.get_by_name(other).is_some();
            let row = match (&row.agent, &row.rival) {
                // The other agent continues with its own valid order
                (Some(other), _) if is_here(other) => return,
                (Some(_), Some(rival)) if is_here(&rival.agent) => ZoneRow { agent: None, ..row.clone() },
                _ if how == Departure::Goodbye => row.reopened(row.attempt),
                _ => row.taken_back(),
            };
            self.write(now, row, RowFollowUp::TakenBack, actions);
        }
    }

    /// Sends orders again that an agent does not report in its heartbeat: the message or the agent's memory was lost.
    fn repeat_orders(&mut self, now: Time, agent: MemberId, known: &[Holding], actions: &mut Vec<FarmAction>) {
        let missing = |zone: &ZoneId| {
            self.board.zone(*zone).is_some_and(|(_, row)| {
                let revision = self.board.revision(*zone);
                let fence = row.fence_of(self.roster.name(agent), revision);
                let is_told = |fence| known.iter().any(|hand| (hand.zone, hand.fence) == (*zone, fence));
                let is_known = fence.is_none_or(is_told);
                let being_written = self.writes.contains_key(zone);
                let on_its_way = self.sent.get(zone).is_some_and(|&sent| now < sent + self.config.timing.heartbeat);
                !is_known && !being_written && !on_its_way
            })
        };
        let zones: Vec<ZoneId> = self.ledger.hands(agent).filter(missing).collect();
        for zone in zones {
            let Some((revision, row)) = self.board.shared(zone) else { continue };
            match &row.agent {
                Some(other) if other == self.roster.name(agent) => {
                    let (row, conversation) = (Arc::clone(row), self.number());
                    self.send_order(now, &row, revision, conversation, actions);
                }
                // Another agent has taken it over
                Some(_) => {}
                // Its order is older than the row and cannot be sent again, so take the zone back
                None => {
                    let row = row.taken_back();
                    self.write(now, row, RowFollowUp::TakenBack, actions);
                }
            }
        }
    }

    /// Sends the order for a row, with its revision as fencing token.
    pub(super) fn send_order(
        &mut self,
        now: Time,
        row: &Arc<ZoneRow>,
        fence: Revision,
        conversation: u64,
        actions: &mut Vec<FarmAction>,
    ) {
        let (Some(work), Some(agent)) = (self.board.work(), &row.agent) else { return };
        // Hide the votes of other agents
        let row =
            if row.votes.is_empty() { row.clone() } else { Arc::new(ZoneRow { votes: Vec::new(), ..(**row).clone() }) };
        let order = Order { work: work.clone(), row: row.clone(), fence, decides: self.decides(&row) };
        let (performative, protocol, content) = if row.state == ZoneState::Profiling {
            (Performative::Request, protocol::REQUEST, FarmContent::Profile(order))
        } else {
            (Performative::AcceptProposal, protocol::CONTRACT_NET, FarmContent::Award(order))
        };
        let order = message(performative, protocol, &self.config.id, vec![agent.clone()], content);
        // An agent that sends no sign of life until then counts as gone
        let reply_by = now + self.config.timing.lease;
        actions.push(FarmAction::Send(asking(order, conversation, Some(reply_by))));
        self.sent.insert(row.zone, now);
        self.orders_sent += 1;
    }

    /// True if the rules of the agent that paints a zone choose its settings: MAGarRO, section 3.4, "when a task is
    /// assigned to an agent". Never if paintings are compared, because all must use the same settings.
    pub(super) fn decides(&self, row: &ZoneRow) -> bool {
        let settings = self.board.work().map(|work| &work.settings);
        !self.verifies() && settings.is_some_and(|settings| row.is_undecided(settings))
    }

    /// Replies to a message.
    pub(super) fn answer(
        &self,
        to: &FarmMessage,
        performative: Performative,
        content: FarmContent,
        actions: &mut Vec<FarmAction>,
    ) {
        actions.push(FarmAction::Send(answer(to, &self.config.id, performative, content)));
    }

    /// The periodic check: stalls, expired leases, hanging orders, credits to write, idle agents.
    pub(super) fn look(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        self.next_look = Some(now + self.config.timing.heartbeat);
        // Restart after a stall
        self.watch_stall(now, actions);
        // Call again the agents that refused or lost
        self.roster.wake(now);
        self.in_vain.clear();
        self.roster.ask_again(&self.in_vain);
        self.roster.rest_orders();
        // Dismiss the agents whose lease is over
        let lease = self.config.timing.lease;
        if now.elapsed() > lease {
            for agent in self.roster.silent(Time::since_start(now.elapsed() - lease)) {
                tracing::info!(agent = %self.roster.name(agent), "agent fell silent");
                self.strike_silent(now, agent, actions);
                self.dismiss(now, agent, Departure::Silence, actions);
            }
        }
        // Take back zones of agents that have not subscribed again after a restart
        let is_lost = |agent: &MemberId| now >= self.expects_until && self.roster.get(*agent).is_none();
        let strangers: Vec<MemberId> = self.ledger.holders().filter(is_lost).collect();
        for agent in strangers {
            self.take_all_back(now, agent, Departure::Silence, actions);
        }
        // Take back orders without progress
        self.watch_all(now, actions);
        self.write_credits(actions);
        self.help_all(now, actions);
        self.count_machines(actions);
    }
}
