//! The ledger: the Master's counts and sums over the rows of the Blackboard, updated row by row so that no event needs
//! a pass over all rows.

use std::{cmp::Reverse, collections::BTreeSet, ops::Bound, time::Duration};

use bottega_agents::NumberMap;

use crate::{AuctionRule, MemberId, Offer, ZoneId, ZoneRow, ZoneState, auction::OpenZones};

/// The agents that hold a zone: at most two.
pub(super) type Holders = [Option<MemberId>; 2];

/// The zones by their next step. A zone whose row is being written counts as written.
#[derive(Clone, Debug, Default)]
pub(super) struct Ledger {
    rule: AuctionRule,
    /// The zones as they are counted now.
    zones: NumberMap<CountedZone>,
    /// Zones without samples; the most complex first.
    unseen: BTreeSet<(Reverse<u64>, ZoneId)>,
    /// The sum of T_est of `unseen`.
    unseen_time: Duration,
    /// Zones with a vote that need further ones; the most complex first.
    comparisons: BTreeSet<(Reverse<u64>, ZoneId)>,
    /// The position of the rotation through `comparisons`.
    compared_last: Option<(Reverse<u64>, ZoneId)>,
    /// Zones that wait for an auction or are on offer.
    pub(super) open: OpenZones,
    /// By the number of their agent: the held zones with T_est, in order of their ids. Few per agent.
    held: Vec<Vec<(ZoneId, Duration)>>,
    in_hand: usize,
    /// Number of profiled zones that wait for the next pass.
    waiting: usize,
    settled: usize,
    chosen: usize,
}

/// The counted state of a zone: all that is needed to subtract it again.
#[derive(Clone, Debug, PartialEq)]
struct CountedZone {
    state: ZoneState,
    waiting: bool,
    complexity: f64,
    time_estimated: Duration,
    /// T_est of the zone's current order.
    order_time: Duration,
    chosen: bool,
    voted: bool,
    holders: Holders,
}

impl Ledger {
    pub(super) fn new(rule: AuctionRule) -> Self {
        Self { rule, ..Self::default() }
    }

    /// Counts a zone with its new row. Appends the agents whose load has changed.
    ///
    /// - `holders`: the agents that hold the zone, by the row.
    /// - `order_time`: see [`ZoneRow::order_time`].
    pub(super) fn count(
        &mut self,
        row: &ZoneRow,
        holders: Holders,
        order_time: Option<Duration>,
        changed: &mut Vec<MemberId>,
    ) {
        let counted = CountedZone {
            state: row.state,
            waiting: row.is_waiting(),
            complexity: row.complexity,
            time_estimated: row.time_estimated.unwrap_or_default(),
            order_time: order_time.unwrap_or_default(),
            chosen: row.choice.is_some() || row.state == ZoneState::Failed,
            voted: !row.votes.is_empty(),
            holders,
        };
        if let Some(before) = self.zones.get(row.zone.0) {
            if *before == counted {
                return;
            }
            let before = before.clone();
            self.uncount(row.zone, &before, changed);
        }
        match row.state {
            ZoneState::Open | ZoneState::Profiled if counted.voted => {
                self.comparisons.insert(counted.rank(row.zone));
            }
            ZoneState::Open => {
                self.unseen.insert(counted.rank(row.zone));
                self.unseen_time += counted.time_estimated;
            }
            ZoneState::Profiled if counted.waiting => self.waiting += 1,
            ZoneState::Profiled => self.open.insert(self.rule, counted.offer(row.zone)),
            ZoneState::Done | ZoneState::Failed => self.settled += 1,
            ZoneState::Profiling | ZoneState::Awarded => {
                self.in_hand += 1;
                for &agent in counted.holders.iter().flatten() {
                    self.take(agent, row.zone, counted.order_time);
                    changed.push(agent);
                }
            }
        }
        self.chosen += usize::from(counted.chosen);
        self.zones.insert(row.zone.0, counted);
    }

    /// Subtracts a zone as it was counted before.
    fn uncount(&mut self, zone: ZoneId, before: &CountedZone, changed: &mut Vec<MemberId>) {
        match before.state {
            ZoneState::Open | ZoneState::Profiled if before.voted => {
                self.comparisons.remove(&before.rank(zone));
            }
            ZoneState::Open => {
                self.unseen.remove(&before.rank(zone));
                self.unseen_time -= before.time_estimated;
            }
            ZoneState::Profiled if before.waiting => self.waiting -= 1,
            ZoneState::Profiled => self.open.remove(self.rule, &before.offer(zone)),
            ZoneState::Done | ZoneState::Failed => self.settled -= 1,
            ZoneState::Profiling | ZoneState::Awarded => {
                self.in_hand -= 1;
                for &agent in before.holders.iter().flatten() {
                    self.held[agent.index()].retain(|(other, _)| *other != zone);
                    changed.push(agent);
                }
            }
        }
        self.chosen -= usize::from(before.chosen);
    }

    /// Adds a zone to an agent's load.
    fn take(&mut self, agent: MemberId, zone: ZoneId, time: Duration) {
        if self.held.len() <= agent.index() {
            self.held.resize_with(agent.index() + 1, Vec::new);
        }
        let held = &mut self.held[agent.index()];
        let place = held.partition_point(|(other, _)| *other < zone);
        held.insert(place, (zone, time));
    }

    /// Returns the number of zones that an agent holds, and the sum of their T_est.
    pub(super) fn load(&self, agent: MemberId) -> (usize, Duration) {
        let held = self.held.get(agent.index()).map_or(&[][..], Vec::as_slice);
        (held.len(), held.iter().map(|(_, time)| *time).sum())
    }

    /// Returns the zones that an agent holds.
    pub(super) fn held_by(&self, agent: MemberId) -> impl DoubleEndedIterator<Item = ZoneId> {
        self.held.get(agent.index()).into_iter().flatten().map(|(zone, _)| *zone)
    }

    /// Returns all agents that hold zones.
    pub(super) fn holders(&self) -> impl Iterator<Item = MemberId> {
        let holders = self.held.iter().enumerate().filter(|(_, zones)| !zones.is_empty());
        holders.map(|(index, _)| MemberId(index as u32))
    }

    /// Returns the sum of T_est of all zones without an agent, including those without samples.
    pub(super) fn waiting_time(&self) -> Duration {
        self.open.time_estimated() + self.unseen_time
    }

    /// Returns the most complex zone without samples.
    pub(super) fn next_unseen(&self) -> Option<ZoneId> {
        self.unseen.first().map(|(_, zone)| *zone)
    }

    /// Returns zones that need further votes, in order of their ids.
    ///
    /// - `first`: the number of the most complex ones.
    /// - `next`: the number of others, in rotation.
    pub(super) fn comparisons(&mut self, first: usize, next: usize) -> Vec<ZoneId> {
        let from = self.compared_last.map_or(Bound::Unbounded, Bound::Excluded);
        let in_turn: Vec<_> = self.comparisons.range((from, Bound::Unbounded)).take(next).copied().collect();
        // After the last zone the rotation starts again.
        self.compared_last = in_turn.last().copied();
        let first = self.comparisons.iter().take(first).map(|(_, zone)| *zone);
        let mut zones: Vec<ZoneId> = first.chain(in_turn.iter().map(|(_, zone)| *zone)).collect();
        zones.sort_unstable();
        zones.dedup();
        zones
    }

    /// Returns the number of zones that need further votes.
    pub(super) fn comparison_count(&self) -> usize {
        self.comparisons.len()
    }

    /// Returns the number of zones without an agent: those without samples and those open for auction.
    pub(super) fn waiting_count(&self) -> usize {
        self.unseen.len() + self.open.len()
    }

    /// Returns the number of zones that agents hold.
    pub(super) fn in_hand_count(&self) -> usize {
        self.in_hand
    }

    /// Returns true if all unsettled zones wait for the next pass, and there are any.
    pub(super) fn all_wait(&self) -> bool {
        self.waiting > 0 && self.waiting + self.settled == self.zones.len()
    }

    /// Returns the number of zones done or given up.
    pub(super) fn settled_count(&self) -> usize {
        self.settled
    }

    /// Returns the number of zones whose band is known.
    pub(super) fn chosen_count(&self) -> usize {
        self.chosen
    }

    pub(super) fn assert_invariants(&self) {
        let waiting = self.unseen.len() + self.comparisons.len() + self.open.len() + self.waiting;
        assert_eq!(self.in_hand + waiting + self.settled, self.zones.len(), "each zone is in one place");
    }
}

impl CountedZone {
    fn rank(&self, zone: ZoneId) -> (Reverse<u64>, ZoneId) {
        (Reverse(self.complexity.max(0.0).to_bits()), zone)
    }

    fn offer(&self, zone: ZoneId) -> Offer {
        Offer { zone, complexity: self.complexity, time_estimated: self.time_estimated }
    }
}
