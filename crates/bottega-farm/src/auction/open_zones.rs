//! The zones without a winner, ordered by size.

use std::{cmp::Reverse, collections::BTreeMap, time::Duration};

use super::terms::AuctionRule;
use crate::{Offer, ZoneId};

/// Zones offered per bidder in one call for proposals, and the bounds on their total. Most are the largest zones; some
/// are the smallest, for agents too slow for the large ones.
const OFFERS_EACH: usize = 4;
const OFFERS_MIN: usize = 8;
const OFFERS_MAX: usize = 32;
/// One in this many offers is a small zone.
const SMALL_OFFERS: usize = 4;

/// Sort key of a zone: its size; of equal zones the one with the lowest id counts as largest.
type Rank = (u64, Reverse<ZoneId>);

/// The zones that wait for an auction, largest last, and those on offer in a round now. A zone's size is its T_est, or its
/// complexity under [`AuctionRule::Paper`](crate::AuctionRule::Paper).
#[derive(Clone, Debug, Default)]
pub struct OpenZones {
    waiting: BTreeMap<Rank, Offer>,
    /// The zones on offer, with the number of their round.
    offered: BTreeMap<ZoneId, u64>,
    time: Duration,
}

impl OpenZones {
    /// Returns the sort key: T_est by default, complexity under the paper's rule. Positive floats order as their bits
    /// do.
    fn rank(rule: AuctionRule, offer: &Offer) -> Rank {
        let rank = match rule {
            AuctionRule::Paper => offer.complexity.max(0.0).to_bits(),
            AuctionRule::FinishingTime | AuctionRule::Promised | AuctionRule::Stealing => {
                u64::try_from(offer.time_estimated.as_nanos()).unwrap_or(u64::MAX)
            }
        };
        (rank, Reverse(offer.zone))
    }

    /// Adds a zone that is open for auction. Give each call the same `rule`, by which the zones are ordered.
    pub fn insert(&mut self, rule: AuctionRule, offer: Offer) {
        if self.waiting.insert(Self::rank(rule, &offer), offer).is_none() {
            self.time += offer.time_estimated;
        }
    }

    /// Removes a zone, waiting or on offer; no effect if it is neither.
    ///
    /// - `offer`: the same as when the zone was inserted.
    pub fn remove(&mut self, rule: AuctionRule, offer: &Offer) {
        if self.waiting.remove(&Self::rank(rule, offer)).is_some() || self.offered.remove(&offer.zone).is_some() {
            self.time -= offer.time_estimated;
        }
    }

    /// Returns the number of zones, including those on offer.
    pub fn len(&self) -> usize {
        self.waiting.len() + self.offered.len()
    }

    /// Returns true if there are no zones.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty() && self.offered.is_empty()
    }

    /// Returns true if a zone is waiting that is not on offer.
    pub fn has_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Returns T_est of the largest zone that is not on offer, in reference-machine time; `None`: there is none.
    pub fn largest_waiting(&self) -> Option<Duration> {
        self.largest().map(|offer| offer.time_estimated)
    }

    /// Returns the zone with the greatest T_est or complexity that is not on offer; `None`: there is none.
    pub fn largest(&self) -> Option<Offer> {
        self.waiting.last_key_value().map(|(_, offer)| *offer)
    }

    /// Returns the sum of T_est of all zones, in reference-machine time.
    pub fn time_estimated(&self) -> Duration {
        self.time
    }

    /// Takes the zones for one call for proposals, and returns them, largest first: all of them, or the largest and
    /// some of the smallest. The zones are in no other call until they are given back or removed.
    ///
    /// - `round`: the number of the round.
    /// - `bidders`: the number of agents called.
    pub fn offer(&mut self, round: u64, bidders: usize) -> Vec<Offer> {
        // Compute how many to offer, and how many of them are small
        let (count, most) = (self.waiting.len(), (OFFERS_EACH * bidders).clamp(OFFERS_MIN, OFFERS_MAX));
        let small = if count <= most { 0 } else { most / SMALL_OFFERS };
        // Take the largest, then the smallest
        let large = count.min(most) - small;
        let large = (0..large).map_while(|_| self.waiting.pop_last()).map(|(_, offer)| offer);
        let mut offers: Vec<Offer> = large.collect();
        let small: Vec<Offer> = (0..small).map_while(|_| self.waiting.pop_first()).map(|(_, offer)| offer).collect();
        offers.extend(small.into_iter().rev());
        // Mark them as on offer in this round
        self.offered.extend(offers.iter().map(|offer| (offer.zone, round)));
        offers
    }

    /// Puts back a zone that no agent won, unless it was removed meanwhile.
    ///
    /// - `round`: the round in which it was on offer.
    pub fn give_back(&mut self, rule: AuctionRule, round: u64, offer: Offer) {
        // Ignore a zone that was removed, inserted and offered again in another round
        if self.offered.get(&offer.zone) == Some(&round) {
            self.offered.remove(&offer.zone);
            self.waiting.insert(Self::rank(rule, &offer), offer);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_zones_are_offered_by_their_ends_and_to_nobody_twice() {
        let mut open = OpenZones::default();
        let rule = AuctionRule::default();
        for i in 0..100 {
            let time_estimated = Duration::from_secs(u64::from(i));
            open.insert(rule, Offer { zone: ZoneId(i), complexity: 1.0, time_estimated });
        }
        let time = open.time_estimated();
        let offered = open.offer(1, 16);
        assert_eq!(offered.len(), OFFERS_MAX);
        assert_eq!((offered[0].zone, offered[OFFERS_MAX - 1].zone), (ZoneId(99), ZoneId(0)));
        assert_eq!(open.offer(2, 16)[0].zone, ZoneId(75));
        assert_eq!((open.len(), open.time_estimated()), (100, time));
        open.remove(rule, &offered[0]);
        offered.into_iter().for_each(|offer| open.give_back(rule, 1, offer));
        assert_eq!(open.len(), 99);
        assert_eq!(open.offer(2, 16)[0].zone, ZoneId(98));
    }
}
