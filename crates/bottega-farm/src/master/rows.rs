//! The Master's reads and writes of the Blackboard.

use bottega_agents::Entry;

use super::{ledger::Holders, roster::Member, *};
use crate::compare_and_set;

/// Maximum number of agents whose credit is written per check.
const CREDITS_AT_ONCE: usize = 32;

impl Master {
    pub(super) fn start(&mut self, actions: &mut Vec<FarmAction>) {
        for (&ticket, value) in &self.kept {
            actions.push(self.put_kept(ticket, value));
        }
        self.watch_rows(actions);
    }

    pub(super) fn watch_rows(&self, actions: &mut Vec<FarmAction>) {
        let prefix = self.keys.prefix();
        actions.push(FarmAction::Store { ticket: self.watch, request: StoreRequest::Watch { prefix } });
    }

    fn put_kept(&self, ticket: Ticket, value: &FarmValue) -> FarmAction {
        FarmAction::Store { ticket, request: compare_and_set(&self.keys, Revision::ABSENT, value.clone()) }
    }

    /// Processes a reply of the store. Returns true if it was new: most writes arrive twice, as a reply and through the
    /// subscription.
    pub(super) fn handle_store(
        &mut self,
        now: Time,
        ticket: Ticket,
        reply: StoreReply<FarmValue>,
        actions: &mut Vec<FarmAction>,
    ) -> bool {
        if let Some(value) = self.kept.remove(&ticket) {
            // Written, or it existed already; the subscription delivers it
            if reply == StoreReply::Unavailable {
                actions.push(self.put_kept(ticket, &value));
                self.kept.insert(ticket, value);
            }
            return false;
        }
        match reply {
            StoreReply::Changed(Entry { revision, value, .. }) => return self.see(now, revision, value, actions),
            StoreReply::Written { revision, .. } => {
                let write = self.tickets.get(&ticket).and_then(|zone| self.writes.get(zone));
                let Some(row) = write.map(|write| Arc::clone(&write.row)) else { return false };
                return self.see_zone(now, revision, &row, actions);
            }
            StoreReply::Conflict { entry, .. } => {
                let Some(zone) = self.tickets.get(&ticket).copied() else { return false };
                if let Some(Entry { revision, value, .. }) = entry {
                    self.see(now, revision, value, actions);
                }
                // Another Master wrote this row with other content
                self.end_write(now, zone);
            }
            // A subscription from before a restart still delivers changes, but its end of the existing rows does not
            // count
            StoreReply::CaughtUp => self.caught_up |= ticket == self.watch,
            StoreReply::Unavailable => self.repeat_write(ticket, actions),
            StoreReply::Got { .. } => return false,
        }
        true
    }

    /// Processes a row. It may be the pending one, delivered by the subscription before or instead of the reply.
    /// Returns true if it was new.
    fn see(&mut self, now: Time, revision: Revision, value: FarmValue, actions: &mut Vec<FarmAction>) -> bool {
        match value {
            FarmValue::Zone(row) => self.see_zone(now, revision, &row, actions),
            FarmValue::Agent(row) => {
                // An agent that is not here is known from before a restart of the Master, and its lease begins again.
                // Rows that arrive later were written by this Master itself, for agents that may have left meanwhile.
                let is_out = self.left_out.contains_key(&row.agent);
                let is_new = !is_out && self.roster.get_by_name(&row.agent).is_none();
                if is_new && row.left_out.is_some() {
                    self.left_out.insert(row.agent.clone(), Arc::clone(&row));
                    self.doubt_all();
                } else if is_new
                    && !self.caught_up
                    && let Some(id) = self.roster.join(now, (*row).clone())
                {
                    self.refresh_hands(now, id);
                }
                self.board.see(revision, FarmValue::Agent(row));
                is_new
            }
            work @ FarmValue::Work(_) => {
                self.board.see(revision, work);
                true
            }
            FarmValue::Page(_) => false,
        }
    }

    /// Processes the row of a zone: updates the counts and completes a pending write.
    fn see_zone(&mut self, now: Time, revision: Revision, row: &Arc<ZoneRow>, actions: &mut Vec<FarmAction>) -> bool {
        let zone = row.zone;
        if !self.board.is_news(zone, revision) {
            return false;
        }
        let rivals = self.rivals(row);
        self.board.see(revision, FarmValue::Zone(Arc::clone(row)));
        if let Some(rivals) = rivals {
            self.withdraw(zone, rivals, actions);
        }
        actions.push(FarmAction::Effect(FarmEffect::ZoneChanged(Arc::clone(row))));
        self.sent.remove(&zone);
        self.film_is_stale |= row.state != ZoneState::Done && self.composition.has(zone);
        self.film_is_stale |= self.composition.is_outdated(row);
        self.composition.see(row);
        self.doubt(row);
        self.note_cut(row);
        // The zone may be open, or its agent has less load: agents that bid in vain may bid again
        if matches!(row.state, ZoneState::Profiled | ZoneState::Done | ZoneState::Failed) {
            self.recalls = true;
            self.in_vain.clear();
        }
        match self.writes.get(&zone) {
            Some(write) if revision > write.expected_revision => {
                let is_written = Arc::ptr_eq(&write.row, row) || write.row == *row;
                if let Some(write) = self.end_write(now, zone).filter(|_| is_written) {
                    self.after_write(now, write, revision, actions);
                }
            }
            _ => self.count(now, row),
        }
        true
    }

    /// Updates the ledger with a row.
    fn count(&mut self, now: Time, row: &ZoneRow) {
        let mut holders: Holders = [None; 2];
        for (place, agent) in holders.iter_mut().zip(row.holders()) {
            *place = Some(self.roster.number(agent));
        }
        let mut changed = std::mem::take(&mut self.changed);
        let order_time = self.board.work().and_then(|work| row.order_time(&work.settings));
        self.ledger.count(row, holders, order_time, &mut changed);
        for agent in changed.drain(..) {
            self.refresh_hands(now, agent);
        }
        self.changed = changed;
    }

    pub(super) fn refresh_hands(&mut self, now: Time, agent: MemberId) {
        self.roster.set_hands(now, agent, self.ledger.load(agent));
    }

    /// Writes a zone's row if its revision is unchanged. One write per zone at a time.
    pub(super) fn write(
        &mut self,
        now: Time,
        row: impl Into<Arc<ZoneRow>>,
        then: RowFollowUp,
        actions: &mut Vec<FarmAction>,
    ) {
        let row = row.into();
        let (zone, expected_revision) = (row.zone, self.board.revision(row.zone));
        let ticket = Ticket(self.number());
        let request = compare_and_set(&self.keys, expected_revision, FarmValue::Zone(Arc::clone(&row)));
        actions.push(FarmAction::Store { ticket, request });
        self.count(now, &row);
        self.tickets.insert(ticket, zone);
        let before = self.writes.insert(zone, Write { ticket, row, expected_revision, then });
        assert!(before.is_none(), "there is one write for a zone at a time");
    }

    /// Repeats a write after the store did not reply, whether or not it was done.
    fn repeat_write(&mut self, ticket: Ticket, actions: &mut Vec<FarmAction>) {
        let Some(zone) = self.tickets.remove(&ticket) else { return };
        let again = Ticket(self.number());
        let Some(write) = self.writes.get_mut(&zone) else { return };
        write.ticket = again;
        self.tickets.insert(again, zone);
        let request = compare_and_set(&self.keys, write.expected_revision, FarmValue::Zone(Arc::clone(&write.row)));
        actions.push(FarmAction::Store { ticket: again, request });
    }

    /// Ends a write, successful or not: the zone counts again as on the Blackboard.
    fn end_write(&mut self, now: Time, zone: ZoneId) -> Option<Write> {
        let write = self.writes.remove(&zone);
        if let Some(write) = &write {
            self.tickets.remove(&write.ticket);
        }
        if let Some(row) = self.board.shared(zone).map(|(_, row)| Arc::clone(row)) {
            self.count(now, &row);
        } else if self.owed.contains_key(&zone) {
            self.due.push(zone);
        }
        write
    }

    /// Takes the action that follows a successful write.
    fn after_write(&mut self, now: Time, write: Write, fence: Revision, actions: &mut Vec<FarmAction>) {
        match write.then {
            RowFollowUp::Order(conversation) => self.send_order(now, &write.row, fence, conversation, actions),
            RowFollowUp::Receive { confirmation, well, promise } => {
                let name = confirmation.receivers.first().cloned();
                let agent = name.as_ref().and_then(|agent| self.roster.find(agent));
                actions.push(FarmAction::Send(*confirmation));
                if let Some(name) = name.filter(|_| well) {
                    self.succeed(&name, actions);
                }
                if write.row.state == ZoneState::Done {
                    self.credit(&write.row, promise, actions);
                }
                if let Some(agent) = agent.filter(|_| self.config.auction != AuctionRule::Stealing) {
                    self.help_out(now, agent, actions);
                }
            }
            RowFollowUp::TakenBack => {}
        }
    }

    /// Updates the agent's credit in proportion to T_est − T. It reaches the Blackboard later: see
    /// [`Self::write_credits`].
    fn credit(&mut self, row: &ZoneRow, promise: Option<KeptPromise>, actions: &mut Vec<FarmAction>) {
        let (Some(estimated), Some(promise), Some(agent)) = (row.time_estimated, promise, &row.agent) else { return };
        let KeptPromise { taken, worth } = promise;
        let Some(id) = self.roster.find(agent) else { return };
        let Some(own) = self.roster.get(id).map(Member::promised_own) else { return };
        if let Some(row) = self.roster.update(id, |row| row.credit.learn(estimated, own, taken, worth)) {
            actions.push(FarmAction::Effect(FarmEffect::AgentChanged(Arc::new(row.clone()))));
            if self.credited.insert(id) {
                self.credits_due.push_back(id);
            }
        }
    }

    /// Writes the changed credits of some agents, those that have waited longest first. A write after each zone would
    /// double the number of writes, and little is lost with a Master.
    pub(super) fn write_credits(&mut self, actions: &mut Vec<FarmAction>) {
        for _ in 0..CREDITS_AT_ONCE {
            let Some(id) = self.credits_due.pop_front() else { return };
            self.credited.remove(&id);
            if let Some(row) = self.roster.get(id).map(|member| member.row.clone()) {
                self.put_agent(row, actions);
            }
        }
    }

    /// Writes an agent's row to the Blackboard.
    pub(super) fn put_agent(&mut self, row: AgentRow, actions: &mut Vec<FarmAction>) {
        let (key, ticket) = (self.keys.agent(&row.agent), Ticket(self.number()));
        let row = Arc::new(row);
        actions.push(FarmAction::Effect(FarmEffect::AgentChanged(Arc::clone(&row))));
        let request = StoreRequest::Put { key, value: FarmValue::Agent(row) };
        actions.push(FarmAction::Store { ticket, request });
    }
}
