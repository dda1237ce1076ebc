//! The watch over orders: detects engines that hang while their agents still send heartbeats.

use super::{watched::LongestOrder, *};
use crate::{Holding, STEP_MAX};

/// An order hangs after this many times the expected time of one step.
const PATIENCE: f64 = 6.0;
/// Minimum of that time, for an agent with a processor of its own.
const PATIENCE_MIN: Duration = Duration::from_secs(60);
/// Time for preparation before an order is begun, whose length is unknown.
const READY_WITHIN: Duration = Duration::from_secs(600);
/// Bound on the factor for agents that share a processor, whatever they report.
const SHARING_MAX: f64 = 32.0;
/// An order with progress is taken back after this many times its expected time, if there are other agents.
const LASTING: f64 = 60.0;
/// Minimum of that time.
const LASTS_MIN: Duration = Duration::from_secs(4 * 3600);
/// Maximum of that time, because the expected time is the unconfirmed word of the agent that profiled the zone.
const LASTS_MAX: Duration = Duration::from_secs(24 * 3600);

impl Master {
    /// Takes back the agent's longest-held order if it has made no progress for too long. Taking longer than expected
    /// is no reason, except far beyond all bounds.
    ///
    /// - `told`: the orders in the agent's heartbeat. Orders of the Blackboard that are missing there count as
    ///   without progress; others are ignored.
    pub(super) fn watch_pace(&mut self, now: Time, agent: MemberId, told: &[Holding], actions: &mut Vec<FarmAction>) {
        // Find the order that the agent has worked on longest
        let orders = self.orders_of(agent, told);
        let longest = self.roster.watch(now, agent, &orders);
        let Some(LongestOrder { order, stands, lasts }) = longest.filter(|it| it.lasts >= PATIENCE_MIN) else { return };
        let (zone, fence) = (order.zone, order.fence);
        let name = self.roster.name(agent).clone();
        let Some((_, row)) = self.board.zone(zone) else { return };
        if !self.begun || self.stopping || self.writes.contains_key(&zone) {
            return;
        }
        // Compare its times with the allowed ones
        let Some([standing, lasting]) = self.patience(agent, row, &order, orders.len()) else { return };
        let lasts_too_long = lasts >= lasting && self.roster.count() > 1;
        if stands < standing && !lasts_too_long {
            return;
        }
        let reason = if stands < standing {
            format!("it has not painted {zone} within {} s", lasts.as_secs())
        } else {
            format!("it has painted nothing of {zone} for {} s", stands.as_secs())
        };
        // Cancel it, take the zone back and count the failure
        tracing::warn!(zone = zone.0, agent = %name, "an order hangs: {reason}");
        self.withdraw(zone, vec![(name.clone(), fence)], actions);
        if let Some(row) = self.failed(zone, &name) {
            self.write(now, row, RowFollowUp::TakenBack, actions);
        }
        self.strike(now, &name, (zone, fence), &reason, actions);
    }

    /// Checks all agents with orders: an agent may send messages without mentioning its orders.
    pub(super) fn watch_all(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let holders: Vec<MemberId> = self.ledger.holders().collect();
        for agent in holders {
            self.watch_pace(now, agent, &[], actions);
        }
    }

    /// The orders of an agent on the Blackboard, with the progress that it reports.
    pub(super) fn orders_of(&self, agent: MemberId, told: &[Holding]) -> Vec<Holding> {
        let name = self.roster.name(agent);
        let order = |zone: ZoneId| {
            let (revision, row) = self.board.zone(zone)?;
            let fence = row.fence_of(name, revision)?;
            let told = told.iter().find(|told| (told.zone, told.fence) == (zone, fence));
            Some(Holding { zone, fence, progress: told.map_or(0, |told| told.progress) })
        };
        self.ledger.hands(agent).filter_map(order).collect()
    }

    /// The allowed time without progress, and the allowed total time, of an agent's order. An agent with `hands` orders
    /// may divide its processors among them.
    fn patience(&self, agent: MemberId, row: &ZoneRow, order: &Holding, hands: usize) -> Option<[Duration; 2]> {
        let member = self.roster.get(agent)?;
        // Agents that share a machine slow each other down.
        let sharing = member.row.lanes.min(1.0).recip().min(SHARING_MAX);
        let least = PATIENCE_MIN.mul_f64(sharing);
        if order.progress == 0 {
            return Some([READY_WITHIN.mul_f64(sharing), LASTS_MAX]);
        }
        let Some(estimated) = row.time_estimated else { return Some([least.mul_f64(hands as f64), LASTS_MIN]) };
        let samples = row.choice.map_or(1, |choice| row.goal_samples(&choice).saturating_sub(row.samples_done()));
        let whole = estimated.as_secs_f64() * member.own();
        let step = whole.min(STEP_MAX.as_secs_f64() * sharing).max(whole / f64::from(samples.max(1)));
        let of_hands = |seconds: f64| Duration::try_from_secs_f64(seconds * hands as f64).unwrap_or(Duration::MAX);
        let standing = of_hands(PATIENCE * step).clamp(least, LASTS_MAX.max(least));
        Some([standing, of_hands(LASTING * whole).clamp(LASTS_MIN, LASTS_MAX)])
    }
}
