//! The orders of an agent, and whether they go on.

use std::time::Duration;

use bottega_agents::Time;

use crate::Holding;

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

#[cfg(test)]
mod tests {
    use bottega_agents::Revision;

    use super::*;
    use crate::ZoneId;

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
