//! Whether the orders of an agent go on: an engine may hang while its agent says that it lives.

use super::*;
use crate::{Holding, STEP_MAX};

/// Hung is who takes so many times longer than a step of its order should take at most.
const PATIENCE: f64 = 6.0;
/// And never less than this, for an agent with a processor of its own.
const PATIENCE_MIN: Duration = Duration::from_secs(60);
/// Before an order is begun its agent gets ready what all zones need, of which nobody knows how long it takes.
const READY_WITHIN: Duration = Duration::from_secs(600);

/// Orders of an agent that are watched: it has no more, whatever it says.
const WATCHED_MAX: usize = 1 << 10;

/// The orders of an agent, the one that it has had longest first, and when each last went on.
#[derive(Clone, Debug, Default)]
pub(super) struct Watched(Vec<(Holding, Time)>);

impl Watched {
    /// Takes what an agent says of its orders. Returns the one that it has had longest, and how long nothing has been
    /// painted of it while it was that one: the others may wait for their turn.
    pub(super) fn see(&mut self, now: Time, hands: &[Holding]) -> Option<(Holding, Duration)> {
        let hands = &hands[..hands.len().min(WATCHED_MAX)];
        let is_same = |a: &Holding, b: &Holding| (a.zone, a.fence) == (b.zone, b.fence);
        let longest_before = self.0.first().map(|(known, _)| *known);
        self.0.retain(|(known, _)| hands.iter().any(|hand| is_same(hand, known)));
        let known_count = self.0.len();
        for hand in hands {
            match self.0.iter_mut().find(|(known, _)| is_same(hand, known)) {
                Some((known, moved)) if known.progress < hand.progress => (*known, *moved) = (*hand, now),
                Some(_) => {}
                None => self.0.push((*hand, now)),
            }
        }
        self.0[known_count..].sort_unstable_by_key(|(hand, _)| hand.fence);
        let (longest, moved) = self.0.first_mut()?;
        if longest_before.is_none_or(|before| !is_same(&before, longest)) {
            *moved = now;
        }
        Some((*longest, now - *moved))
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    fn hold(zone: u32, progress: u64) -> Holding {
        Holding { zone: ZoneId(zone), fence: Revision(u64::from(zone)), progress }
    }

    fn at(seconds: u64) -> Time {
        Time::since_start(Duration::from_secs(seconds))
    }

    #[test]
    fn only_the_order_that_an_agent_has_had_longest_must_go_on() {
        let mut watched = Watched::default();
        assert_eq!(watched.see(at(0), &[]), None);
        watched.see(at(0), &[hold(1, 0)]);
        watched.see(at(10), &[hold(1, 5), hold(2, 1)]);
        let (longest, stood) = watched.see(at(70), &[hold(1, 5), hold(2, 1)]).unwrap();
        assert_eq!((longest.zone, stood), (ZoneId(1), Duration::from_secs(60)));
        // The second one's turn begins when the first is done.
        assert_eq!(watched.see(at(80), &[hold(2, 1)]), Some((hold(2, 1), Duration::ZERO)));
        // Going backwards is not going on.
        assert_eq!(watched.see(at(90), &[hold(2, 0)]), Some((hold(2, 1), Duration::from_secs(10))));
        assert_eq!(watched.see(at(95), &[hold(2, 2)]), Some((hold(2, 2), Duration::ZERO)));
    }

    #[test]
    fn of_orders_that_come_together_the_one_that_was_given_first_has_been_there_longest() {
        let mut watched = Watched::default();
        assert_eq!(watched.see(at(0), &[hold(3, 1), hold(2, 1)]).unwrap().0, hold(2, 1));
    }
}
