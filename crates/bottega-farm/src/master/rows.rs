//! The Master's reads and writes of the Blackboard.

use bottega_agents::Entry;

use super::{ledger::Holders, roster::Member, *};
use crate::compare_and_set;

/// Agents whose credit is written at one look.
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

    /// Takes an answer of the store. Returns whether it was news: most writes are told of twice, by the answer and by the watch.
    pub(super) fn handle_store(
        &mut self,
        now: Time,
        ticket: Ticket,
        reply: StoreReply<FarmValue>,
        actions: &mut Vec<FarmAction>,
    ) -> bool {
        if let Some(value) = self.kept.remove(&ticket) {
            // Written, or there already; the watch reports it.
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
                // Somebody else wrote this row, and not what was to be written.
                self.end_write(now, zone);
            }
            // A watch from before this Master began again tells of changes, and not that all was told.
            StoreReply::CaughtUp => self.caught_up |= ticket == self.watch,
            StoreReply::Unavailable => self.repeat_write(ticket, actions),
            StoreReply::Got { .. } => return false,
        }
        true
    }

    /// Takes in a row. It may be the one that is being written, seen by the watch before the answer or instead of it. Returns
    /// whether it was news.
    fn see(&mut self, now: Time, revision: Revision, value: FarmValue, actions: &mut Vec<FarmAction>) -> bool {
        match value {
            FarmValue::Zone(row) => self.see_zone(now, revision, &row, actions),
            FarmValue::Agent(row) => {
                // If it is not here it is known from an earlier life of this Master; its lease begins anew. What comes later
                // this Master has written itself, of one that has gone meanwhile.
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
        // A zone has come to wait, or somebody has less to do: those who bid in vain may be the next to have one soonest.
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

    /// Writes a zone's row only if it is still as it was seen. There is one write for a zone at a time.
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

    /// The store did not answer, and may have written or not. The same write again finds out.
    fn repeat_write(&mut self, ticket: Ticket, actions: &mut Vec<FarmAction>) {
        let Some(zone) = self.tickets.remove(&ticket) else { return };
        let again = Ticket(self.number());
        let Some(write) = self.writes.get_mut(&zone) else { return };
        write.ticket = again;
        self.tickets.insert(again, zone);
        let request = compare_and_set(&self.keys, write.expected_revision, FarmValue::Zone(Arc::clone(&write.row)));
        actions.push(FarmAction::Store { ticket: again, request });
    }

    /// A write has ended, well or not: from now on the zone counts as the Blackboard has it.
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

    /// Credit rises or falls in proportion to T_est − T. It is on the Blackboard soon: see [`Self::write_credits`].
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

    /// Writes the credit of some of those whose credit has changed, the one that has waited longest first. A row after
    /// each zone would be as many writes again as the zones themselves are, and what is lost with a Master is little.
    pub(super) fn write_credits(&mut self, actions: &mut Vec<FarmAction>) {
        for _ in 0..CREDITS_AT_ONCE {
            let Some(id) = self.credits_due.pop_front() else { return };
            self.credited.remove(&id);
            if let Some(row) = self.roster.get(id).map(|member| member.row.clone()) {
                self.put_agent(row, actions);
            }
        }
    }

    /// An agent's credit, power or lanes are on the Blackboard.
    pub(super) fn put_agent(&mut self, row: AgentRow, actions: &mut Vec<FarmAction>) {
        let (key, ticket) = (self.keys.agent(&row.agent), Ticket(self.number()));
        let row = Arc::new(row);
        actions.push(FarmAction::Effect(FarmEffect::AgentChanged(Arc::clone(&row))));
        let request = StoreRequest::Put { key, value: FarmValue::Agent(row) };
        actions.push(FarmAction::Store { ticket, request });
    }
}
