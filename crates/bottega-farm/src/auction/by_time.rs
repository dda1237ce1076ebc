//! The default rule: the bidder that is idle first chooses a zone, and the bidder that finishes it soonest gets it. Times
//! are the promised ones, weighted by reliability.

use super::{
    member::MemberId,
    round::{Candidate, Lot},
    terms::{Award, BidderStanding, Decision},
};
use crate::Offer;

/// Tolerance on the expected end of all work, as a share of the time until then: zones may finish that much later.
const SLACK: f64 = 0.02;
/// Minimum time of a piece, in seconds of its agent: smaller pieces cost more in messages than they gain.
const PIECE_TIME_MIN: f64 = 0.1;
/// Share of an agent's remaining time that one zone may take, where zones can be cut: later zones then even out wrong
/// estimates (factoring; Hummel, Schonberg and Flynn 1992).
const SHARE_OF_REST: f64 = 0.5;
/// Maximum number of zones per round that are compared against all other agents because no bidder finishes them in
/// time.
const LEFT_MAX: usize = 4;

/// One round of the auction, decided by finishing times.
pub(super) struct ByTime<'a> {
    /// The offers without a winner, largest first.
    open: Vec<Lot>,
    bidders: Vec<Candidate>,
    standing: &'a BidderStanding<'a>,
    /// Expected end of the whole work, with [`SLACK`], in seconds from now.
    end: f64,
}

/// The part of an open zone that a bidder chooses, by the zone's place in [`ByTime::open`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum AwardShare {
    All(usize),
    Part(usize, f64),
}

impl<'a> ByTime<'a> {
    pub(super) fn new(offers: &[Offer], mut bidders: Vec<Candidate>, standing: &'a BidderStanding<'a>) -> Self {
        // Leave out bidders without room, and compute the expected end of the work
        bidders.retain(|bidder| bidder.room > 0);
        let end = standing.field.end(standing.now, standing.open) * (1.0 + SLACK);
        Self { open: Lot::all(offers), bidders, standing, end }
    }

    /// Awards zones until no bidder lacks another one.
    pub(super) fn award(mut self) -> Decision {
        let mut decision = Decision::default();
        // Take the bidder that is idle first
        while let Some(first) = self.first() {
            // Choose a zone for it; if there is none, it leaves the round
            let Some(gets) = self.best_for(first) else {
                self.bidders.swap_remove(first);
                continue;
            };
            // Give a whole zone to the bidder that finishes it soonest
            let (index, place, share) = match gets {
                AwardShare::All(place) => (self.soonest(first, place), place, None),
                AwardShare::Part(place, share) => (first, place, Some(share)),
            };
            // Award the zone and add its time to the bidder's load
            let offer = self.open.remove(place);
            let bidder = &mut self.bidders[index];
            decision.outbid += u32::from(index != first);
            decision.awards.push(Award { zone: offer.zone, agent: bidder.bidder.agent, share });
            bidder.win(&offer, share.unwrap_or(1.0));
            // Remove a bidder that has no room left
            if bidder.room == 0 {
                self.bidders.swap_remove(index);
            }
        }
        decision
    }

    /// Returns the next bidder to choose, of those that lack zones: the one that is idle first; of several the most
    /// reliable, then the one with the lowest id.
    fn first(&self) -> Option<usize> {
        (0..self.bidders.len()).filter(|&index| self.bidders[index].needs > 0).min_by(|&a, &b| {
            let (a, b) = (&self.bidders[a], &self.bidders[b]);
            let by_credit = b.bidder.worth.total_cmp(&a.bidder.worth);
            a.ready(&self.open)
                .total_cmp(&b.ready(&self.open))
                .then(by_credit)
                .then(a.bidder.agent.cmp(&b.bidder.agent))
        })
    }

    /// Returns the bidder that finishes a zone soonest: `first`, which chose it, or another that would choose the
    /// same one.
    fn soonest(&self, first: usize, place: usize) -> usize {
        // Compare with the other bidders that choose the same zone
        let lot = &self.open[place];
        let finish = |index: usize| self.bidders[index].finish(lot).unwrap_or(f64::INFINITY);
        let mut best = first;
        for other in 0..self.bidders.len() {
            let is_sooner = finish(other) < finish(best);
            if is_sooner && self.best_for(other) == Some(AwardShare::All(place)) {
                best = other;
            }
        }
        best
    }

    /// Returns the time that one more zone may take a bidder, in its own seconds: the time from its load until the
    /// expected end, or a share of it where zones can be cut.
    fn wanted(&self, bidder: &Candidate) -> f64 {
        let left = self.end - bidder.ready(&self.open);
        let takes_all = self.standing.can_cut.is_none() || left < 4.0 * PIECE_TIME_MIN;
        if takes_all { left } else { left * SHARE_OF_REST }
    }

    /// Returns the largest zone, or piece of one, that a bidder should choose now. `None`: none is worth giving it.
    fn best_for(&self, index: usize) -> Option<AwardShare> {
        let bidder = &self.bidders[index];
        let wanted = self.wanted(bidder);
        let bids = |lot: &Lot| bidder.bids_for(lot);
        // Take the largest whole zone that fits in that time
        if let Some(place) = self.open.iter().position(|lot| bids(lot) && bidder.own(lot) <= wanted) {
            return Some(AwardShare::All(place));
        }
        // Else cut the largest zone that can be cut, so that its first piece fits in that time
        let can_cut = |lot: &Lot| {
            let rest = bidder.own(lot) - wanted;
            let is_worth_it = wanted >= PIECE_TIME_MIN && rest >= PIECE_TIME_MIN;
            bids(lot) && is_worth_it && self.standing.can_cut.is_some_and(|can_cut| can_cut(lot.zone))
        };
        if let Some(place) = self.open.iter().position(can_cut) {
            return Some(AwardShare::Part(place, wanted / bidder.own(&self.open[place])));
        }
        // Else take the largest zone that finishes before the expected end
        let in_time = |lot: &Lot| bidder.finish(lot).is_some_and(|finish| finish <= self.end);
        if let Some(place) = self.open.iter().position(in_time) {
            return Some(AwardShare::All(place));
        }
        // Else take a zone that no other agent finishes sooner
        (0..self.open.len().min(LEFT_MAX)).find(|&place| self.nobody_sooner(index, place)).map(AwardShare::All)
    }

    /// Returns true if no agent finishes this zone sooner than the bidder, counting what each has in hand and has won.
    /// Computed from the Master's own estimates for all agents alike, so exactly one agent is the soonest.
    fn nobody_sooner(&self, index: usize, place: usize) -> bool {
        let (lot, now, field) = (&self.open[place], self.standing.now, self.standing.field);
        let time = lot.time;
        let finish = |bidder: &Candidate| field.finish(now, time, bidder.bidder.agent) + bidder.won();
        let own = &self.bidders[index];
        if !own.bids_for(lot) {
            return false;
        }
        // Compare with the other bidders, then with agents that were not called
        let limit = finish(own);
        let mut bids = self.bidders.iter().filter(|bidder| bidder.bids_for(lot));
        let bids_now = |agent: MemberId| self.bidders.iter().any(|it| it.bidder.agent == agent);
        !bids.any(|other| finish(other) < limit) && !field.anybody_sooner(now, time, limit, bids_now)
    }
}
