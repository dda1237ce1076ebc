//! The default rule: who would have finished what soonest, by what its word is worth.

use super::{
    member::MemberId,
    round::{Candidate, Lot},
    terms::{Award, BidderStanding},
};
use crate::Offer;

/// How far beyond the expected end of all work a zone may be finished, as a share of the time until then.
const SLACK: f64 = 0.02;
/// A piece that takes an agent less than this is not worth its messages.
const PIECE_TIME_MIN: f64 = 0.1;
/// An agent gets zones that take this share of the time that is left, at most: what was estimated wrong can then be made
/// good with the rest (the factoring of Hummel, Schonberg and Flynn 1992).
const SHARE_OF_REST: f64 = 0.5;
/// Zones too large for all bidders that are set against all other agents in one round, at most.
const LEFT_MAX: usize = 4;

/// A round that is decided by when zones would be finished.
pub(super) struct ByTime<'a> {
    /// Not given away, largest first.
    open: Vec<Lot>,
    bidders: Vec<Candidate>,
    standing: &'a BidderStanding<'a>,
    /// When the work as a whole should end, in seconds from now.
    end: f64,
}

/// What a bidder gets.
enum AwardShare {
    All(usize),
    Part(usize, f64),
}

impl<'a> ByTime<'a> {
    pub(super) fn new(offers: &[Offer], mut bidders: Vec<Candidate>, standing: &'a BidderStanding<'a>) -> Self {
        bidders.retain(|bidder| bidder.room > 0);
        let end = standing.field.end(standing.now, standing.open) * (1.0 + SLACK);
        Self { open: Lot::all(offers), bidders, standing, end }
    }

    pub(super) fn award(mut self) -> Vec<Award> {
        let mut winners = Vec::new();
        while let Some(index) = self.first() {
            let Some(gets) = self.best_for(index) else {
                self.bidders.swap_remove(index);
                continue;
            };
            let (place, share) = match gets {
                AwardShare::All(place) => (place, None),
                AwardShare::Part(place, share) => (place, Some(share)),
            };
            let offer = self.open.remove(place);
            let bidder = &mut self.bidders[index];
            winners.push(Award { zone: offer.zone, agent: bidder.bidder.agent, share });
            bidder.win(&offer, share.unwrap_or(1.0));
            if bidder.room == 0 {
                self.bidders.swap_remove(index);
            }
        }
        winners
    }

    /// Whoever is idle first chooses first; of several the one that is more reliable, then who came first.
    fn first(&self) -> Option<usize> {
        (0..self.bidders.len()).min_by(|&a, &b| {
            let (a, b) = (&self.bidders[a], &self.bidders[b]);
            let by_credit = b.bidder.worth.total_cmp(&a.bidder.worth);
            a.ready(&self.open)
                .total_cmp(&b.ready(&self.open))
                .then(by_credit)
                .then(a.bidder.agent.cmp(&b.bidder.agent))
        })
    }

    fn best_for(&self, index: usize) -> Option<AwardShare> {
        let bidder = &self.bidders[index];
        let left = self.end - bidder.ready(&self.open);
        let takes_all = self.standing.can_cut.is_none() || left < 4.0 * PIECE_TIME_MIN;
        let wanted = if takes_all { left } else { left * SHARE_OF_REST };
        let bids = |lot: &Lot| bidder.bids_for(lot);
        if let Some(place) = self.open.iter().position(|lot| bids(lot) && bidder.own(lot) <= wanted) {
            return Some(AwardShare::All(place));
        }
        // All are larger. The largest that can be cut gives it what it can do in time.
        let can_cut = |lot: &Lot| {
            let rest = bidder.own(lot) - wanted;
            let is_worth_it = wanted >= PIECE_TIME_MIN && rest >= PIECE_TIME_MIN;
            bids(lot) && is_worth_it && self.standing.can_cut.is_some_and(|can_cut| can_cut(lot.zone))
        };
        if let Some(place) = self.open.iter().position(can_cut) {
            return Some(AwardShare::Part(place, wanted / bidder.own(&self.open[place])));
        }
        let in_time = |lot: &Lot| bidder.finish(lot).is_some_and(|finish| finish <= self.end);
        if let Some(place) = self.open.iter().position(in_time) {
            return Some(AwardShare::All(place));
        }
        (0..self.open.len().min(LEFT_MAX)).find(|&place| self.nobody_sooner(index, place)).map(AwardShare::All)
    }

    /// Whether none of all agents would have finished a zone before this one, behind all that it has in hand and has won.
    /// All are measured alike, by what the Master knows of them: so of all agents one is the soonest.
    fn nobody_sooner(&self, index: usize, place: usize) -> bool {
        let (lot, now, field) = (&self.open[place], self.standing.now, self.standing.field);
        let time = lot.time;
        let finish = |bidder: &Candidate| field.finish(now, time, bidder.bidder.agent) + bidder.won();
        let own = &self.bidders[index];
        if !own.bids_for(lot) {
            return false;
        }
        let limit = finish(own);
        let mut bids = self.bidders.iter().filter(|bidder| bidder.bids_for(lot));
        let bids_now = |agent: MemberId| self.bidders.iter().any(|it| it.bidder.agent == agent);
        !bids.any(|other| finish(other) < limit) && !field.anybody_sooner(now, time, limit, bids_now)
    }
}
