//! The rows of the work: the Master's view of the Blackboard, and its pending writes.

use std::{collections::BTreeMap, sync::Arc};

use bottega_agents::{AgentId, Entry, Revision, StoreReply, StoreRequest, Ticket};
use rustc_hash::FxHashMap;

use super::worth::KeptPromise;
use crate::{
    AgentRow, Blackboard, FarmAction, FarmEffect, FarmMessage, FarmValue, WorkId, WorkKeys, ZoneId, ZoneRow,
    compare_and_set,
};

/// A pending write of a zone's row.
#[derive(Clone, Debug)]
pub(super) struct Write {
    /// The ticket of the last request.
    ticket: Ticket,
    /// The new row.
    pub(super) row: Arc<ZoneRow>,
    /// The revision that the row must have before.
    pub(super) expected_revision: Revision,
    pub(super) then: RowFollowUp,
}

/// The action after a row is written.
#[derive(Clone, Debug)]
pub(super) enum RowFollowUp {
    /// Send the order to the agent, in this conversation.
    Order(u64),
    /// Confirm the report to the agent.
    Receive {
        /// The confirmation to send.
        confirmation: Box<FarmMessage>,
        /// True if the report is a success.
        well: bool,
        /// The measured promise, if the report ends an award and its time is valid.
        promise: Option<KeptPromise>,
    },
    /// None: the zone was taken back or prepared for its next order.
    TakenBack,
}

/// The meaning of a reply of the store.
#[derive(Clone, Debug)]
pub(super) enum StoreUpdate {
    /// Nothing new.
    Nothing,
    /// No row, but the state of the subscription or of a write has changed.
    Progress,
    /// A row as it is on the Blackboard now.
    Row(Revision, FarmValue),
    /// A write of this zone failed, because another Master wrote the row; with that row if there is one.
    Conflict(ZoneId, Option<(Revision, FarmValue)>),
}

/// The rows as this Master knows them, the writes without a reply, and the counter of all tickets and conversations.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    keys: WorkKeys,
    board: Blackboard,
    /// Rows of an interrupted work to write to an empty Blackboard first, by ticket, until written.
    kept: BTreeMap<Ticket, FarmValue>,
    /// The ticket of the subscription to the rows.
    subscription: Ticket,
    /// True when the subscription has delivered all existing rows.
    caught_up: bool,
    /// Pending writes. Hash maps for speed, as the one below; never iterated for anything but counts.
    writes: FxHashMap<ZoneId, Write>,
    tickets: FxHashMap<Ticket, ZoneId>,
    last_number: u64,
}

impl Rows {
    pub(super) fn new(work: WorkId) -> Self {
        Self {
            keys: WorkKeys::new(work),
            board: Blackboard::default(),
            kept: BTreeMap::new(),
            subscription: Ticket(0),
            caught_up: false,
            writes: FxHashMap::default(),
            tickets: FxHashMap::default(),
            last_number: 0,
        }
    }

    /// Adds a row of an interrupted work, to be written when the Master starts.
    pub(super) fn restore(&mut self, value: FarmValue) {
        let ticket = Ticket(self.number());
        self.kept.insert(ticket, value);
    }

    /// Forgets all rows and writes. Numbers continue, so that late replies do not match new requests.
    pub(super) fn reset(&mut self, work: WorkId) {
        let kept = std::mem::take(&mut self.kept);
        *self = Self { kept, last_number: self.last_number, ..Self::new(work) };
        self.subscription = Ticket(self.number());
    }

    /// Writes the rows of an interrupted work, and subscribes to all rows.
    pub(super) fn start(&self, actions: &mut Vec<FarmAction>) {
        for (&ticket, value) in &self.kept {
            actions.push(self.put_kept(ticket, value));
        }
        self.subscribe(actions);
    }

    /// Subscribes to all rows of the work.
    pub(super) fn subscribe(&self, actions: &mut Vec<FarmAction>) {
        let prefix = self.keys.prefix();
        actions.push(FarmAction::Store { ticket: self.subscription, request: StoreRequest::Watch { prefix } });
    }

    fn put_kept(&self, ticket: Ticket, value: &FarmValue) -> FarmAction {
        FarmAction::Store { ticket, request: compare_and_set(&self.keys, Revision::ABSENT, value.clone()) }
    }

    /// Processes a reply of the store. Most writes arrive twice, as a reply and through the subscription.
    pub(super) fn take_reply(
        &mut self,
        ticket: Ticket,
        reply: StoreReply<FarmValue>,
        actions: &mut Vec<FarmAction>,
    ) -> StoreUpdate {
        if let Some(value) = self.kept.remove(&ticket) {
            // Written, or it existed already; the subscription delivers it
            if reply == StoreReply::Unavailable {
                actions.push(self.put_kept(ticket, &value));
                self.kept.insert(ticket, value);
            }
            return StoreUpdate::Nothing;
        }
        match reply {
            StoreReply::Changed(Entry { revision, value, .. }) => StoreUpdate::Row(revision, value),
            StoreReply::Written { revision, .. } => {
                let write = self.tickets.get(&ticket).and_then(|zone| self.writes.get(zone));
                let row = write.map(|write| FarmValue::Zone(Arc::clone(&write.row)));
                row.map_or(StoreUpdate::Nothing, |row| StoreUpdate::Row(revision, row))
            }
            StoreReply::Conflict { entry, .. } => {
                let Some(&zone) = self.tickets.get(&ticket) else { return StoreUpdate::Nothing };
                StoreUpdate::Conflict(zone, entry.map(|Entry { revision, value, .. }| (revision, value)))
            }
            // A subscription from before a restart still delivers changes, but its end of the existing rows does not
            // count
            StoreReply::CaughtUp => {
                self.caught_up |= ticket == self.subscription;
                StoreUpdate::Progress
            }
            StoreReply::Unavailable => {
                self.repeat_write(ticket, actions);
                StoreUpdate::Progress
            }
            StoreReply::Got { .. } => StoreUpdate::Nothing,
        }
    }

    /// Takes in a row as it is on the Blackboard now.
    pub(super) fn see(&mut self, revision: Revision, value: FarmValue) {
        self.board.see(revision, value);
    }

    /// Writes a zone's row if its revision is unchanged. One write per zone at a time.
    pub(super) fn write(&mut self, row: Arc<ZoneRow>, then: RowFollowUp, actions: &mut Vec<FarmAction>) {
        let (zone, expected_revision) = (row.zone, self.board.revision(row.zone));
        let ticket = Ticket(self.number());
        let request = compare_and_set(&self.keys, expected_revision, FarmValue::Zone(Arc::clone(&row)));
        actions.push(FarmAction::Store { ticket, request });
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

    /// Ends a write, successful or not.
    pub(super) fn end_write(&mut self, zone: ZoneId) -> Option<Write> {
        let write = self.writes.remove(&zone)?;
        self.tickets.remove(&write.ticket);
        Some(write)
    }

    /// Writes an agent's row to the Blackboard.
    pub(super) fn put_agent(&mut self, row: AgentRow, actions: &mut Vec<FarmAction>) {
        let (key, ticket) = (self.keys.agent(&row.agent), Ticket(self.number()));
        let row = Arc::new(row);
        actions.push(FarmAction::Effect(FarmEffect::AgentChanged(Arc::clone(&row))));
        let request = StoreRequest::Put { key, value: FarmValue::Agent(row) };
        actions.push(FarmAction::Store { ticket, request });
    }

    /// Returns a new number for a conversation or ticket.
    pub(super) fn number(&mut self) -> u64 {
        self.last_number += 1;
        self.last_number
    }

    /// Returns the rows on the Blackboard, without the pending writes.
    pub(super) fn board(&self) -> &Blackboard {
        &self.board
    }

    /// Returns a zone's row and its revision.
    pub(super) fn zone(&self, zone: ZoneId) -> Option<(Revision, &ZoneRow)> {
        self.board.zone(zone)
    }

    /// Returns a zone's row, if no write of it is pending.
    pub(super) fn settled_zone(&self, zone: ZoneId) -> Option<&ZoneRow> {
        self.board.zone(zone).filter(|_| !self.is_being_written(zone)).map(|(_, row)| row)
    }

    /// Returns true if a write of a zone's row is pending.
    pub(super) fn is_being_written(&self, zone: ZoneId) -> bool {
        self.writes.contains_key(&zone)
    }

    /// Returns the pending write of a zone's row.
    pub(super) fn pending_write(&self, zone: ZoneId) -> Option<&Write> {
        self.writes.get(&zone)
    }

    /// Returns true if writes are pending.
    pub(super) fn has_writes(&self) -> bool {
        !self.writes.is_empty()
    }

    /// Returns the pending writes that are followed by an order, in no order.
    pub(super) fn pending_orders(&self) -> impl Iterator<Item = &ZoneRow> {
        self.writes.values().filter(|write| matches!(write.then, RowFollowUp::Order(_))).map(|write| &*write.row)
    }

    /// Returns true if the subscription has delivered all existing rows.
    pub(super) fn is_caught_up(&self) -> bool {
        self.caught_up
    }

    /// Returns the row of a zone after cutting it so that `share` of it is left; `None` if it cannot be cut.
    pub(super) fn cut(&self, zone: ZoneId, share: f64) -> Option<ZoneRow> {
        let (work, (revision, row)) = (self.board.work()?, self.board.zone(zone)?);
        // The row of an earlier piece must exist, because it is derived from the current row.
        let is_whole = row.cut.is_none_or(|cut| self.board.zone(cut.zone).is_some());
        // The piece's id is derived from the revision, which admits one write only, so that ids are unique.
        let offcut = ZoneId(u32::try_from(revision.0).ok()?.checked_add(work.zone_count)?);
        let is_free =
            is_whole && row.votes.is_empty() && self.board.zone(offcut).is_none() && !self.is_being_written(zone);
        row.cut_to(share, offcut, &work.settings.frame, work.settings.goal.grid()).filter(|_| is_free)
    }

    /// Returns the agents, with their fencing tokens, whose orders become void when a zone held by two agents gets
    /// `row`.
    pub(super) fn voided_orders(&self, row: &ZoneRow) -> Option<Vec<(AgentId, Revision)>> {
        let (revision, before) = self.board.zone(row.zone)?;
        if before.rival.is_none() || row.is_in_hand() {
            return None;
        }
        let void = before.holders().filter(|agent| row.agent.as_ref() != Some(agent));
        let void = void.filter_map(|agent| Some((agent.clone(), before.fence_of(agent, revision)?)));
        Some(void.collect())
    }

    pub(super) fn assert_invariants(&self) {
        assert_eq!(self.tickets.len(), self.writes.len(), "each write has one open ticket");
    }
}
