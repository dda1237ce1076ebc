//! Whether the orders of an agent go on: an engine may hang while its agent says that it lives.

use super::*;
use crate::{Holding, STEP_MAX};

/// Hung is who takes so many times longer than a step of its order should take at most.
const PATIENCE: f64 = 6.0;
/// And never less than this, for an agent with a processor of its own.
const PATIENCE_MIN: Duration = Duration::from_secs(60);
/// Before an order is begun its agent gets ready what all zones need, of which nobody knows how long it takes.
const READY_WITHIN: Duration = Duration::from_secs(600);

impl Master {
    /// Takes an order back of which nothing was painted for long, though its agent lives. That it takes longer than was
    /// expected is no reason.
    pub(super) fn watch_pace(&mut self, now: Time, agent: MemberId, hands: &[Holding], actions: &mut Vec<FarmAction>) {
        let longest = self.roster.watch(now, agent, hands);
        let Some((longest, stood)) = longest.filter(|(_, stood)| *stood >= PATIENCE_MIN) else { return };
        let (zone, fence) = (longest.zone, longest.fence);
        let name = self.roster.name(agent).clone();
        let Some((revision, row)) = self.board.zone(zone) else { return };
        let is_its = row.fence_of(&name, revision) == Some(fence);
        if !self.begun || self.stopping || !is_its || self.writes.contains_key(&zone) {
            return;
        }
        let in_hand = self.ledger.load(agent).0;
        if self.patience(agent, row, &longest, in_hand).is_none_or(|patience| stood < patience) {
            return;
        }
        let reason = format!("it has painted nothing of {zone} for {} s", stood.as_secs());
        tracing::warn!(zone = zone.0, agent = %name, "an order hangs: {reason}");
        self.withdraw(zone, vec![(name.clone(), fence)], actions);
        if let Some(row) = self.failed(zone, &name) {
            self.write(now, row, Then::TakenBack, actions);
        }
        self.strike(now, &name, (zone, fence), &reason, actions);
    }

    /// How long an order may stand still: some times what a step of it should take its agent, which has so many orders in
    /// hand and may share its processors out among them.
    fn patience(&self, agent: MemberId, row: &ZoneRow, order: &Holding, hands: usize) -> Option<Duration> {
        let member = self.roster.get(agent)?;
        // Agents that share a machine wait for each other.
        let sharing = member.row.lanes.min(1.0).recip();
        let least = PATIENCE_MIN.mul_f64(sharing);
        if order.progress == 0 {
            return Some(READY_WITHIN.mul_f64(sharing));
        }
        let Some(estimated) = row.time_estimated else { return Some(least.mul_f64(hands as f64)) };
        let samples = row.choice.map_or(1, |choice| row.goal_samples(&choice).saturating_sub(row.samples_done()));
        let whole = estimated.as_secs_f64() * member.own();
        let step = whole.min(STEP_MAX.as_secs_f64() * sharing).max(whole / f64::from(samples.max(1)));
        Some(Duration::try_from_secs_f64(PATIENCE * step * hands as f64).unwrap_or(Duration::MAX).max(least))
    }
}
