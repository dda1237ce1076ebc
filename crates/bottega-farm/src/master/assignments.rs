//! Assignments: which agent holds which zone. Every write of a zone's row passes through here, so that the ledger's
//! counts and the agents' loads always match the rows.

use std::{sync::Arc, time::Duration};

use bottega_agents::{AgentId, Performative, Revision, Time};
use rustc_hash::FxHashMap;

use super::{
    config::MasterConfig,
    ledger::{Holders, Ledger},
    roster::Roster,
    rows::{RowFollowUp, Rows, Write},
};
use crate::{
    Award, FarmAction, FarmContent, Holding, MemberId, Order, ZoneId, ZoneRow, ZoneState,
    contents::{asking, message},
    protocol,
};

/// The reason why an agent leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Departure {
    /// The agent says goodbye, or is excluded: its zones are not to blame.
    Goodbye,
    /// The lease of the agent is over: one of its zones may have crashed it.
    Silence,
}

/// The rows, the counts over them, the agents, and the orders sent to them.
#[derive(Clone, Debug)]
pub(super) struct Assignments {
    pub(super) config: Arc<MasterConfig>,
    pub(super) rows: Rows,
    pub(super) ledger: Ledger,
    pub(super) roster: Roster,
    /// Time at which the current order of a zone was sent. A hash map for speed; never iterated.
    sent: FxHashMap<ZoneId, Time>,
    /// Number of orders sent so far.
    orders_sent: u64,
    /// Scratch space: agents whose load has changed.
    changed: Vec<MemberId>,
}

impl Assignments {
    pub(super) fn new(config: Arc<MasterConfig>, rows: Rows) -> Self {
        let window = match config.verifies() && !config.deals() {
            // What is compared does not wait in a hand while others may be found wrong
            true => config.prefetch as usize,
            false => config.auction.window(config.prefetch) as usize,
        };
        let prefetch = if config.deals() { window } else { config.prefetch as usize };
        Self {
            rows,
            ledger: Ledger::new(config.auction),
            roster: Roster::new(window, prefetch, config.auction.weighs_promises()),
            config,
            sent: FxHashMap::default(),
            orders_sent: 0,
            changed: Vec::new(),
        }
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
        self.rows.write(Arc::clone(&row), then, actions);
        self.count(now, &row);
    }

    /// Writes a zone's row, and sends the order to its agent when that is done.
    pub(super) fn order(&mut self, now: Time, row: ZoneRow, actions: &mut Vec<FarmAction>) {
        let conversation = self.rows.number();
        self.write(now, row, RowFollowUp::Order(conversation), actions);
    }

    /// Writes an award to the zone's row, cutting the zone if the award is for a part of it.
    pub(super) fn award(&mut self, now: Time, award: &Award, conversation: u64, actions: &mut Vec<FarmAction>) {
        let Some((_, row)) = self.rows.zone(award.zone) else { return };
        let row = match award.share {
            None => row.clone(),
            Some(share) => match self.rows.cut(award.zone, share) {
                Some(row) => row,
                None => return,
            },
        };
        let agent = Some(self.roster.name(award.agent).clone());
        let row = ZoneRow { state: ZoneState::Awarded, agent, ..row };
        self.write(now, row, RowFollowUp::Order(conversation), actions);
    }

    /// Orders profiles, the most complex zone first, from the agents that finish one soonest.
    pub(super) fn order_profiles(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        while let Some(zone) = self.ledger.next_unseen() {
            // Give the most complex zone without samples to the agent that profiles it soonest
            let Some(agent) = self.roster.freest() else { return };
            let Some(row) = self.rows.settled_zone(zone) else { return };
            let agent = Some(self.roster.name(agent).clone());
            let row = ZoneRow { state: ZoneState::Profiling, agent, ..row.clone() };
            self.order(now, row, actions);
        }
    }

    /// Ends a write, successful or not: the zone counts again as on the Blackboard.
    pub(super) fn end_write(&mut self, now: Time, zone: ZoneId) -> Option<Write> {
        let write = self.rows.end_write(zone);
        if let Some(row) = self.rows.board().shared(zone).map(|(_, row)| Arc::clone(row)) {
            self.count(now, &row);
        }
        write
    }

    /// Updates the counts and the loads with a row.
    pub(super) fn count(&mut self, now: Time, row: &ZoneRow) {
        // Number the agents that hold the zone
        let mut holders: Holders = [None; 2];
        for (place, agent) in holders.iter_mut().zip(row.holders()) {
            *place = Some(self.roster.number(agent));
        }
        // Count the row, and update the loads of the agents concerned
        let mut changed = std::mem::take(&mut self.changed);
        let order_time = self.rows.board().work().and_then(|work| row.order_time(&work.settings));
        self.ledger.count(row, holders, order_time, &mut changed);
        for agent in changed.drain(..) {
            self.refresh_load(now, agent);
        }
        self.changed = changed;
    }

    /// Updates an agent's load from the ledger.
    pub(super) fn refresh_load(&mut self, now: Time, agent: MemberId) {
        self.roster.set_load(now, agent, self.ledger.load(agent));
    }

    /// Takes all zones back that an agent holds.
    pub(super) fn take_all_back(&mut self, now: Time, agent: MemberId, how: Departure, actions: &mut Vec<FarmAction>) {
        let (zones, name) = (self.ledger.held_by(agent).collect::<Vec<_>>(), self.roster.name(agent).clone());
        for zone in zones {
            if let Some(row) = self.taken_back(zone, &name, how) {
                self.write(now, row, RowFollowUp::TakenBack, actions);
            }
        }
    }

    /// Returns a zone's row after it is taken back from an agent; `None`: unchanged.
    fn taken_back(&self, zone: ZoneId, agent: &AgentId, how: Departure) -> Option<ZoneRow> {
        let row = self.rows.settled_zone(zone).filter(|row| row.is_in_hand())?;
        let is_here = |other: &AgentId| other != agent && self.roster.get_by_name(other).is_some();
        match (&row.agent, &row.rival) {
            // The other agent continues with its own valid order
            (Some(other), _) if is_here(other) => None,
            (Some(_), Some(rival)) if is_here(&rival.agent) => Some(ZoneRow { agent: None, ..row.clone() }),
            _ if how == Departure::Goodbye => Some(row.reopened(row.attempt)),
            _ => Some(row.taken_back()),
        }
    }

    /// Sends orders again that an agent does not report in its heartbeat: the message or the agent's memory was lost.
    pub(super) fn repeat_orders(
        &mut self,
        now: Time,
        agent: MemberId,
        reported: &[Holding],
        actions: &mut Vec<FarmAction>,
    ) {
        let is_missing = |zone: &ZoneId| {
            self.rows.zone(*zone).is_some_and(|(revision, row)| {
                let fence = row.fence_of(self.roster.name(agent), revision);
                let is_reported = |fence| reported.iter().any(|order| (order.zone, order.fence) == (*zone, fence));
                let is_known = fence.is_none_or(is_reported);
                let is_on_its_way = self.sent.get(zone).is_some_and(|&sent| now < sent + self.config.timing.heartbeat);
                !is_known && !self.rows.is_being_written(*zone) && !is_on_its_way
            })
        };
        // Send each missing order again, or take the zone back
        let zones: Vec<ZoneId> = self.ledger.held_by(agent).filter(is_missing).collect();
        for zone in zones {
            let Some((revision, row)) = self.rows.board().shared(zone) else { continue };
            match &row.agent {
                Some(other) if other == self.roster.name(agent) => {
                    let (row, conversation) = (Arc::clone(row), self.rows.number());
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
        let (Some(work), Some(agent)) = (self.rows.board().work(), &row.agent) else { return };
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

    /// Returns true if the rules of the agent that paints a zone choose its settings: MAGarRO, section 3.4, "when a
    /// task is assigned to an agent". Never if paintings are compared, because all must use the same settings.
    pub(super) fn decides(&self, row: &ZoneRow) -> bool {
        let settings = self.rows.board().work().map(|work| &work.settings);
        !self.config.verifies() && settings.is_some_and(|settings| row.is_undecided(settings))
    }

    /// Cancels orders of agents for a zone.
    pub(super) fn withdraw(&self, zone: ZoneId, orders: Vec<(AgentId, Revision)>, actions: &mut Vec<FarmAction>) {
        for (agent, fence) in orders {
            let content = FarmContent::Withdrawn { zone, fence };
            let cancel = message(Performative::Cancel, protocol::CONTRACT_NET, &self.config.id, vec![agent], content);
            actions.push(FarmAction::Send(cancel));
        }
    }

    /// Returns the orders of an agent on the Blackboard, with the progress that it reports.
    pub(super) fn orders_of(&self, agent: MemberId, reported: &[Holding]) -> Vec<Holding> {
        let name = self.roster.name(agent);
        let order = |zone: ZoneId| {
            let (revision, row) = self.rows.zone(zone)?;
            let fence = row.fence_of(name, revision)?;
            let reported = reported.iter().find(|order| (order.zone, order.fence) == (zone, fence));
            Some(Holding { zone, fence, progress: reported.map_or(0, |order| order.progress) })
        };
        self.ledger.held_by(agent).filter_map(order).collect()
    }

    /// Returns the time at which the current order of a zone was sent.
    pub(super) fn sent_at(&self, zone: ZoneId) -> Option<Time> {
        self.sent.get(&zone).copied()
    }

    /// Returns the time since the current order of a zone was sent.
    pub(super) fn time_since_order(&self, now: Time, zone: ZoneId) -> Option<Duration> {
        self.sent_at(zone).map(|sent| now - sent)
    }

    /// Notes that a zone's row has changed, so that its order is no longer the current one.
    pub(super) fn forget_order(&mut self, zone: ZoneId) {
        self.sent.remove(&zone);
    }

    /// Returns the number of orders sent so far.
    pub(super) fn orders_sent(&self) -> u64 {
        self.orders_sent
    }

    /// Returns the names of agents.
    pub(super) fn names(&self, agents: &[MemberId]) -> Vec<AgentId> {
        agents.iter().map(|&agent| self.roster.name(agent).clone()).collect()
    }

    pub(super) fn assert_invariants(&self) {
        self.ledger.assert_invariants();
        self.rows.assert_invariants();
    }
}
