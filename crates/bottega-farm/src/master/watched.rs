//! Progress of an agent's orders.

use std::time::Duration;

use bottega_agents::Time;

use crate::Holding;

/// The orders of an agent, with the time of their last progress.
#[derive(Clone, Debug, Default)]
pub(super) struct WatchedZones {
    /// In the order of their age, the oldest first.
    orders: Vec<(Holding, Time)>,
    /// Time since which the first one is the first.
    since: Time,
}

/// The oldest order of an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LongestOrder {
    pub(super) order: Holding,
    /// Time since the order's last progress.
    pub(super) stands: Duration,
    /// Time since the order became the agent's oldest order.
    pub(super) lasts: Duration,
}

impl WatchedZones {
    /// Takes in the progress of an agent's orders. Returns the oldest one; the others may be waiting for their turn.
    pub(super) fn see(&mut self, now: Time, held: &[Holding]) -> Option<LongestOrder> {
        let is_same = |a: &Holding, b: &Holding| (a.zone, a.fence) == (b.zone, b.fence);
        let longest_before = self.orders.first().map(|(known, _)| *known);
        self.orders.retain(|(known, _)| held.iter().any(|order| is_same(order, known)));
        let known_count = self.orders.len();
        for order in held {
            match self.orders.iter_mut().find(|(known, _)| is_same(order, known)) {
                Some((known, moved)) if known.progress < order.progress => (*known, *moved) = (*order, now),
                Some(_) => {}
                None => self.orders.push((*order, now)),
            }
        }
        self.orders[known_count..].sort_unstable_by_key(|(order, _)| order.fence);
        let (order, moved) = self.orders.first_mut()?;
        if longest_before.is_none_or(|before| !is_same(&before, order)) {
            (*moved, self.since) = (now, now);
        }
        Some(LongestOrder { order: *order, stands: now - *moved, lasts: now - self.since })
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
        let mut watched = WatchedZones::default();
        assert_eq!(watched.see(at(0), &[]), None);
        watched.see(at(0), &[hold(1, 0)]);
        watched.see(at(10), &[hold(1, 5), hold(2, 1)]);
        let longest = watched.see(at(70), &[hold(1, 5), hold(2, 1)]).unwrap();
        assert_eq!((longest.order.zone, longest.stands), (ZoneId(1), Duration::from_secs(60)));
        assert_eq!(longest.lasts, Duration::from_secs(70));
        let longest = |order, stands, lasts| {
            let [stands, lasts] = [stands, lasts].map(Duration::from_secs);
            Some(LongestOrder { order, stands, lasts })
        };
        // The second one's turn begins when the first is done.
        assert_eq!(watched.see(at(80), &[hold(2, 1)]), longest(hold(2, 1), 0, 0));
        // Going backwards is not going on.
        assert_eq!(watched.see(at(90), &[hold(2, 0)]), longest(hold(2, 1), 10, 10));
        assert_eq!(watched.see(at(95), &[hold(2, 2)]), longest(hold(2, 2), 0, 15));
    }

    #[test]
    fn of_orders_that_come_together_the_one_that_was_given_first_has_been_there_longest() {
        let mut watched = WatchedZones::default();
        assert_eq!(watched.see(at(0), &[hold(3, 1), hold(2, 1)]).unwrap().order, hold(2, 1));
    }
}
