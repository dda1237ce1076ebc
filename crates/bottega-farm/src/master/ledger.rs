//! What the rows of the Blackboard mean for the Master, kept in step with them so that no event costs a look at all.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use bottega_agents::AgentId;

use crate::{AuctionRule, Offer, ZoneId, ZoneRow, ZoneState, auction::OpenZones};

/// The zones by what is to be done with them. A zone whose row is being written counts as already written.
#[derive(Clone, Debug, Default)]
pub(super) struct Ledger {
    rule: AuctionRule,
    /// As they are counted now.
    rows: BTreeMap<ZoneId, ZoneRow>,
    /// Nobody has seen them; the most complex first.
    unseen: BTreeSet<(Reverse<u64>, ZoneId)>,
    /// Waiting for an auction.
    pub(super) open: OpenZones,
    /// Zones by agent with T_est.
    hands: BTreeMap<AgentId, BTreeMap<ZoneId, Duration>>,
    settled: usize,
    chosen: usize,
}

impl Ledger {
    pub(super) fn new(rule: AuctionRule) -> Self {
        Self { rule, ..Self::default() }
    }

    /// Counts a zone as `row` says from now on. Returns the agents whose hands have changed.
    pub(super) fn count(&mut self, row: &ZoneRow) -> Vec<AgentId> {
        let mut changed = Vec::new();
        if let Some(before) = self.rows.remove(&row.zone) {
            self.uncount(&before, &mut changed);
        }
        match row.state {
            ZoneState::Open => _ = self.unseen.insert((complexity_rank(row), row.zone)),
            ZoneState::Profiled => self.open.insert(self.rule, offer(row)),
            ZoneState::Done | ZoneState::Failed => self.settled += 1,
            ZoneState::Profiling | ZoneState::Awarded => {
                if let Some(agent) = &row.agent {
                    let time = row.time_estimated.unwrap_or_default();
                    self.hands.entry(agent.clone()).or_default().insert(row.zone, time);
                    changed.push(agent.clone());
                }
            }
        }
        self.chosen += usize::from(row.choice.is_some() || row.state == ZoneState::Failed);
        self.rows.insert(row.zone, row.clone());
        changed
    }

    fn uncount(&mut self, row: &ZoneRow, changed: &mut Vec<AgentId>) {
        self.unseen.remove(&(complexity_rank(row), row.zone));
        if row.state == ZoneState::Profiled {
            self.open.remove(self.rule, &offer(row));
        }
        if row.is_in_hand()
            && let Some(agent) = &row.agent
            && let Some(hands) = self.hands.get_mut(agent)
        {
            hands.remove(&row.zone);
            changed.push(agent.clone());
        }
        self.settled -= usize::from(row.is_settled());
        self.chosen -= usize::from(row.choice.is_some() || row.state == ZoneState::Failed);
    }

    /// The zones that an agent has in hand, with T_est.
    pub(super) fn hands(&self, agent: &AgentId) -> BTreeMap<ZoneId, Duration> {
        self.hands.get(agent).cloned().unwrap_or_default()
    }

    /// All agents that have, or had, zones in hand.
    pub(super) fn holders(&self) -> impl Iterator<Item = &AgentId> {
        self.hands.iter().filter(|(_, zones)| !zones.is_empty()).map(|(agent, _)| agent)
    }

    /// The most complex zone that nobody has seen.
    pub(super) fn next_unseen(&self) -> Option<ZoneId> {
        self.unseen.first().map(|(_, zone)| *zone)
    }

    /// Zones done or given up.
    pub(super) fn settled_count(&self) -> usize {
        self.settled
    }

    /// Zones whose band is known.
    pub(super) fn chosen_count(&self) -> usize {
        self.chosen
    }

    pub(super) fn assert_invariants(&self) {
        let in_hand: usize = self.hands.values().map(BTreeMap::len).sum();
        let waiting = self.unseen.len() + self.open.len();
        assert_eq!(in_hand + waiting + self.settled, self.rows.len(), "each zone is in one place");
    }
}

fn complexity_rank(row: &ZoneRow) -> Reverse<u64> {
    Reverse(row.complexity.max(0.0).to_bits())
}

fn offer(row: &ZoneRow) -> Offer {
    Offer { zone: row.zone, complexity: row.complexity, time_estimated: row.time_estimated.unwrap_or_default() }
}
