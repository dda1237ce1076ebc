//! The orders of a Render Agent: those it holds, and those whose reports the Master has not answered.

use std::{sync::Arc, time::Duration};

use bottega_agents::{Revision, Time};
use rustc_hash::FxHashMap;

use super::{held_order::HeldOrder, speed::Speed};
use crate::{Expert, FarmAction, FarmEffect, Holding, Report, ZoneId, ZoneState, short_map::ShortMap};

/// Age of an order from which its progress is queried: most orders are done earlier.
const LOOK_AFTER: Duration = Duration::from_secs(5);

/// A report without a reply.
#[derive(Clone, Debug)]
pub(super) struct UnansweredReport {
    pub(super) report: Arc<Report>,
    pub(super) conversation: u64,
    /// The time at which the report was made.
    pub(super) since: Time,
}

/// The orders by zone.
#[derive(Clone, Debug, Default)]
pub(super) struct Orders {
    held: ShortMap<HeldOrder>,
    /// Reports that the Master has not answered.
    unanswered: ShortMap<UnansweredReport>,
    /// The newest fencing token of each zone that is neither held nor unanswered, so that late or duplicated orders are
    /// ignored. A hash map for speed; never iterated.
    past: FxHashMap<ZoneId, Revision>,
    /// Time since which the agent works on the first zone that it holds.
    since: Time,
}

impl Orders {
    /// Forgets all orders but the tokens of past ones.
    pub(super) fn clear(&mut self) {
        self.held.clear();
        self.unanswered.clear();
    }

    /// Forgets all orders, when another work begins.
    pub(super) fn reset(&mut self) {
        self.clear();
        self.past.clear();
    }

    /// Cancels the painting of all held zones, and forgets the orders.
    pub(super) fn cancel_all(&mut self, actions: &mut Vec<FarmAction>) {
        for (zone, held) in self.held.iter().filter(|(_, held)| held.begun) {
            actions.push(FarmAction::Effect(FarmEffect::Drop { zone, fence: held.order.fence }));
        }
        self.clear();
    }

    /// Cancels an order after another agent has painted the zone.
    pub(super) fn cancel(&mut self, zone: ZoneId, fence: Revision, actions: &mut Vec<FarmAction>) {
        if let Some(held) = self.take(zone, fence) {
            self.past.insert(zone, fence);
            if held.begun {
                actions.push(FarmAction::Effect(FarmEffect::Drop { zone, fence }));
            }
        }
        self.note_answer(zone, fence);
    }

    /// Adds a held zone.
    pub(super) fn hold(&mut self, now: Time, zone: ZoneId, held: HeldOrder) {
        self.unanswered.remove(zone);
        if self.held.is_empty() {
            self.since = now;
        }
        self.held.insert(zone, held);
    }

    /// Removes a zone that is painted. `None`: the order was taken back and given again since.
    pub(super) fn finish(&mut self, now: Time, zone: ZoneId, fence: Revision) -> Option<HeldOrder> {
        let held = self.take(zone, fence)?;
        self.since = now;
        Some(held)
    }

    fn take(&mut self, zone: ZoneId, fence: Revision) -> Option<HeldOrder> {
        self.held.get(zone).filter(|held| held.order.fence == fence)?;
        self.held.remove(zone)
    }

    /// Removes a zone that is given to a neighbor.
    pub(super) fn give_away(&mut self, zone: ZoneId) {
        self.held.remove(zone);
    }

    /// Keeps a report until the Master has answered it.
    pub(super) fn await_answer(&mut self, zone: ZoneId, report: UnansweredReport) {
        self.unanswered.insert(zone, report);
    }

    /// Removes the unanswered report of this order. Returns true if there was one.
    pub(super) fn note_answer(&mut self, zone: ZoneId, fence: Revision) -> bool {
        let waits = self.unanswered.get(zone).is_some_and(|it| it.report.fence == fence);
        if waits {
            self.unanswered.remove(zone);
            self.past.insert(zone, fence);
        }
        waits
    }

    /// Removes the report of this order, which is refused. If the order comes again, the Master wants the zone after
    /// all.
    pub(super) fn note_refusal(&mut self, zone: ZoneId, fence: Revision) {
        if self.note_answer(zone, fence) {
            self.past.remove(&zone);
        }
    }

    /// Returns the newest fencing token seen for a zone.
    pub(super) fn newest(&self, zone: ZoneId) -> Option<Revision> {
        let held = self.held.get(zone).map(|held| held.order.fence);
        let reported = || self.unanswered.get(zone).map(|it| it.report.fence);
        held.or_else(reported).or_else(|| self.past.get(&zone).copied())
    }

    /// Begins waiting zones: all profiles, and the oldest awards, up to `most` at once.
    pub(super) fn begin_waiting(&mut self, most: usize, speed: &Speed, expert: &Expert, actions: &mut Vec<FarmAction>) {
        let power = speed.power();
        let is_profile = |held: &&mut HeldOrder| held.order.row.state == ZoneState::Profiling;
        let profiles = self.held.values_mut().filter(|held| !held.begun).filter(is_profile);
        profiles.for_each(|held| held.begin(power, expert, actions));
        while self.begun_count() < most {
            let waiting = self.held.values_mut().filter(|held| !held.begun);
            let Some(oldest) = waiting.min_by_key(|held| held.order.fence) else { return };
            oldest.begin(power, expert, actions);
        }
    }

    /// Returns the number of awards that are begun.
    fn begun_count(&self) -> usize {
        self.held.values().filter(|held| held.begun && held.order.row.state == ZoneState::Awarded).count()
    }

    /// Returns the time from now until the agent has painted what it holds.
    pub(super) fn load(&self, now: Time, speed: &Speed, expert: &Expert) -> Duration {
        let times = self.held.values().map(|held| speed.own(held.time(expert).unwrap_or_default()));
        times.sum::<Duration>().saturating_sub(now - self.since)
    }

    /// Returns the dealt zones that are not begun, the last first.
    pub(super) fn waiting(&self) -> Vec<(ZoneId, &HeldOrder)> {
        let waiting = self.held.iter().filter(|(_, held)| !held.begun && held.order.row.state == ZoneState::Awarded);
        let mut waiting: Vec<(ZoneId, &HeldOrder)> = waiting.collect();
        waiting.sort_unstable_by_key(|(_, held)| std::cmp::Reverse(held.order.fence));
        waiting
    }

    /// Returns all orders for the heartbeat: those held with their progress, and those reported.
    pub(super) fn holdings(&self) -> Vec<Holding> {
        let held = self.held.iter().map(|(zone, held)| {
            let progress = if held.begun { held.painted.saturating_add(1) } else { 0 };
            Holding { zone, fence: held.order.fence, progress }
        });
        let reported = self.unanswered.iter();
        let reported = reported.map(|(zone, it)| Holding { zone, fence: it.report.fence, progress: u64::MAX });
        held.chain(reported).collect()
    }

    /// Returns the held zones, with the fencing tokens of their orders.
    pub(super) fn held(&self) -> impl Iterator<Item = (ZoneId, Revision)> {
        self.held.iter().map(|(zone, held)| (zone, held.order.fence))
    }

    /// Returns the orders that have been painted for long, whose progress must be queried.
    pub(super) fn long_running(&self, now: Time) -> Vec<(ZoneId, Revision)> {
        let long = self.held.iter().filter(|(_, held)| held.begun && held.since + LOOK_AFTER <= now);
        long.map(|(zone, held)| (zone, held.order.fence)).collect()
    }

    /// Takes in the progress of orders: painted samples, summed over all pixels.
    pub(super) fn note_progress(&mut self, orders: &[(ZoneId, Revision, u64)]) {
        for (zone, held) in self.held.iter_mut() {
            let found = orders.iter().find(|(other, fence, _)| (*other, *fence) == (zone, held.order.fence));
            held.painted = held.painted.max(found.map_or(0, |(_, _, painted)| *painted));
        }
    }

    /// Returns the unanswered report of a zone.
    pub(super) fn unanswered(&self, zone: ZoneId) -> Option<&UnansweredReport> {
        self.unanswered.get(zone)
    }

    /// Returns the unanswered reports that are at least this old.
    pub(super) fn unanswered_since(&self, now: Time, age: Duration) -> impl Iterator<Item = &UnansweredReport> {
        self.unanswered.values().filter(move |it| now - it.since >= age)
    }

    /// Returns the number of held zones.
    pub(super) fn held_count(&self) -> usize {
        self.held.len()
    }

    /// Returns true if no zone is held.
    pub(super) fn holds_nothing(&self) -> bool {
        self.held.is_empty()
    }

    /// Returns true if no zone is held, and all reports are answered.
    pub(super) fn is_empty(&self) -> bool {
        self.held.is_empty() && self.unanswered.is_empty()
    }

    /// Checks the invariants of the orders; panics if one is violated.
    ///
    /// - `most`: number of awards that the agent works on at once.
    /// - `begins`: true if it can paint.
    pub(super) fn assert_invariants(&self, most: usize, begins: bool) {
        let is_busy = self.begun_count() >= most;
        for (zone, held) in self.held.iter() {
            assert!(self.unanswered.get(zone).is_none(), "a zone in hand is not reported");
            assert!(held.begun || is_busy || !begins, "what can be painted is begun");
        }
    }
}
