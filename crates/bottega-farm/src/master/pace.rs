//! The watch over orders: an engine may hang while its agent says that it lives.

use super::{watched::LongestOrder, *};
use crate::{Holding, STEP_MAX};

/// Hung is who takes so many times longer than a step of its order should take at most.
const PATIENCE: f64 = 6.0;
/// And never less than this, for an agent with a processor of its own.
const PATIENCE_MIN: Duration = Duration::from_secs(60);
/// Before an order is begun its agent gets ready what all zones need, of which nobody knows how long it takes.
const READY_WITHIN: Duration = Duration::from_secs(600);
/// Nobody is waited for longer because more agents than this share its processor, whatever it says.
const SHARING_MAX: f64 = 32.0;
/// An order that is told to go on is waited for so many times longer than it should take, where there are others to paint it.
const LASTING: f64 = 60.0;
/// And never less than this.
const LASTS_MIN: Duration = Duration::from_secs(4 * 3600);
/// No order is waited for longer: how long it takes is the word of whoever profiled it.
const LASTS_MAX: Duration = Duration::from_secs(24 * 3600);

impl Master {
    /// Takes an order back of which nothing was painted for long, though its agent lives. That it takes longer than was
    /// expected is no reason, unless it is beyond all measure.
    ///
    /// - `told`: what the agent says of its orders. Those that it does not tell of stand still; others are not its.
    pub(super) fn watch_pace(&mut self, now: Time, agent: MemberId, told: &[Holding], actions: &mut Vec<FarmAction>) {
        let orders = self.orders_of(agent, told);
        let longest = self.roster.watch(now, agent, &orders);
        let Some(LongestOrder { order, stands, lasts }) = longest.filter(|it| it.lasts >= PATIENCE_MIN) else { return };
        let (zone, fence) = (order.zone, order.fence);
        let name = self.roster.name(agent).clone();
        let Some((_, row)) = self.board.zone(zone) else { return };
        if !self.begun || self.stopping || self.writes.contains_key(&zone) {
            return;
        }
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
        tracing::warn!(zone = zone.0, agent = %name, "an order hangs: {reason}");
        self.withdraw(zone, vec![(name.clone(), fence)], actions);
        if let Some(row) = self.failed(zone, &name) {
            self.write(now, row, RowFollowUp::TakenBack, actions);
        }
        self.strike(now, &name, (zone, fence), &reason, actions);
    }

    /// The same for all who have orders: an agent may say much, and nothing of them.
    pub(super) fn watch_all(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let holders: Vec<MemberId> = self.ledger.holders().collect();
        for agent in holders {
            self.watch_pace(now, agent, &[], actions);
        }
    }

    /// The orders of an agent as the Blackboard has them, and how far they are.
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

    /// How long an order may stand still: some times what a step of it should take its agent, which has so many orders in
    /// hand and may share its processors out among them. And how long it may go on.
    fn patience(&self, agent: MemberId, row: &ZoneRow, order: &Holding, hands: usize) -> Option<[Duration; 2]> {
        let member = self.roster.get(agent)?;
        // Agents that share a machine wait for each other.
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
