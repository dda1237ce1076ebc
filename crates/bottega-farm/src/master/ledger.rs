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
    zones: BTreeMap<ZoneId, Counted>,
    /// Nobody has seen them; the most complex first.
    unseen: BTreeSet<(Reverse<u64>, ZoneId)>,
    /// Waiting for an auction, or offered in one.
    pub(super) open: OpenZones,
    /// Zones by agent with T_est.
    hands: BTreeMap<AgentId, BTreeMap<ZoneId, Duration>>,
    in_hand: usize,
    /// Profiled or further, and waiting for the next pass.
    waiting: usize,
    settled: usize,
    chosen: usize,
}

/// What is remembered of a zone: as much as is needed to count it off again.
#[derive(Clone, Debug)]
struct Counted {
    state: ZoneState,
    waiting: bool,
    complexity: f64,
    time_estimated: Duration,
    chosen: bool,
    holders: [Option<AgentId>; 2],
}

impl Ledger {
    pub(super) fn new(rule: AuctionRule) -> Self {
        Self { rule, ..Self::default() }
    }

    /// Counts a zone as `row` says from now on. Returns the agents whose hands have changed.
    pub(super) fn count(&mut self, row: &ZoneRow) -> Vec<AgentId> {
        let mut changed = Vec::new();
        if let Some(before) = self.zones.remove(&row.zone) {
            self.uncount(row.zone, before, &mut changed);
        }
        let mut holders = row.holders().cloned();
        let counted = Counted {
            state: row.state,
            waiting: row.is_waiting(),
            complexity: row.complexity,
            time_estimated: row.time_estimated.unwrap_or_default(),
            chosen: row.choice.is_some() || row.state == ZoneState::Failed,
            holders: [holders.next(), holders.next()],
        };
        match row.state {
            ZoneState::Open => _ = self.unseen.insert(counted.rank(row.zone)),
            ZoneState::Profiled if counted.waiting => self.waiting += 1,
            ZoneState::Profiled => self.open.insert(self.rule, counted.offer(row.zone)),
            ZoneState::Done | ZoneState::Failed => self.settled += 1,
            ZoneState::Profiling | ZoneState::Awarded => {
                self.in_hand += 1;
                for agent in counted.holders.iter().flatten() {
                    self.hands.entry(agent.clone()).or_default().insert(row.zone, counted.time_estimated);
                    changed.push(agent.clone());
                }
            }
        }
        self.chosen += usize::from(counted.chosen);
        self.zones.insert(row.zone, counted);
        changed
    }

    fn uncount(&mut self, zone: ZoneId, before: Counted, changed: &mut Vec<AgentId>) {
        match before.state {
            ZoneState::Open => _ = self.unseen.remove(&before.rank(zone)),
            ZoneState::Profiled if before.waiting => self.waiting -= 1,
            ZoneState::Profiled => self.open.remove(self.rule, &before.offer(zone)),
            ZoneState::Done | ZoneState::Failed => self.settled -= 1,
            ZoneState::Profiling | ZoneState::Awarded => {
                self.in_hand -= 1;
                for agent in before.holders.into_iter().flatten() {
                    if let Some(hands) = self.hands.get_mut(&agent) {
                        hands.remove(&zone);
                    }
                    changed.push(agent);
                }
            }
        }
        self.chosen -= usize::from(before.chosen);
    }

    /// How many zones an agent has in hand, and T_est of all of them.
    pub(super) fn load(&self, agent: &AgentId) -> (usize, Duration) {
        self.hands.get(agent).map_or((0, Duration::ZERO), |hands| (hands.len(), hands.values().sum()))
    }

    /// The zones that an agent has in hand.
    pub(super) fn hands(&self, agent: &AgentId) -> Vec<ZoneId> {
        self.hands.get(agent).map_or_else(Vec::new, |hands| hands.keys().copied().collect())
    }

    /// All agents that have zones in hand.
    pub(super) fn holders(&self) -> impl Iterator<Item = &AgentId> {
        self.hands.iter().filter(|(_, zones)| !zones.is_empty()).map(|(agent, _)| agent)
    }

    /// The most complex zone that nobody has seen.
    pub(super) fn next_unseen(&self) -> Option<ZoneId> {
        self.unseen.first().map(|(_, zone)| *zone)
    }

    /// Whether all zones that are not settled wait for the next pass, and there are any.
    pub(super) fn all_wait(&self) -> bool {
        self.waiting > 0 && self.waiting + self.settled == self.zones.len()
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
        let waiting = self.unseen.len() + self.open.len() + self.waiting;
        assert_eq!(self.in_hand + waiting + self.settled, self.zones.len(), "each zone is in one place");
    }
}

impl Counted {
    fn rank(&self, zone: ZoneId) -> (Reverse<u64>, ZoneId) {
        (Reverse(self.complexity.max(0.0).to_bits()), zone)
    }

    fn offer(&self, zone: ZoneId) -> Offer {
        Offer { zone, complexity: self.complexity, time_estimated: self.time_estimated }
    }
}
