//! Bidders and offers during a round.

use super::terms::Bidder;
use crate::{Offer, ZoneId};

/// A bidder during a round.
pub(super) struct Candidate {
    pub(super) bidder: Bidder,
    /// When it would have finished each of the offers, in their order, in seconds from now; `None`: it does not bid for that
    /// one. Its own word, or what its word is worth.
    finish: Vec<Option<f64>>,
    /// Its own time for a second of the reference machine's, likewise.
    own: f64,
    pub(super) room: u32,
    /// What it has won in this round, in its own seconds.
    won: f64,
}

impl Candidate {
    /// - `worth`: what its word is worth: it has kept its promises when this is 1, and needed twice as long at 0.5.
    pub(super) fn new(bidder: Bidder, offers: &[Offer], worth: f64) -> Self {
        let bids = &bidder.proposal.bids;
        let bid_for = |(place, offer): (usize, &Offer)| {
            // They come in the order of the offers, unless something was taken away meanwhile.
            let likely = bids.get(place).filter(|bid| bid.zone == offer.zone);
            let bid = likely.or_else(|| bids.iter().find(|bid| bid.zone == offer.zone));
            bid.map(|bid| bid.finish.as_secs_f64() / worth)
        };
        let finish = offers.iter().enumerate().map(bid_for).collect();
        Self { finish, own: bidder.own / worth, room: bidder.proposal.room, bidder, won: 0.0 }
    }

    pub(super) fn own(&self, lot: &Lot) -> f64 {
        self.own * lot.time
    }

    /// When it would have finished a zone behind what it has won.
    pub(super) fn finish(&self, lot: &Lot) -> Option<f64> {
        self.finish[lot.place].map(|finish| finish + self.won)
    }

    pub(super) fn bids_for(&self, lot: &Lot) -> bool {
        self.finish[lot.place].is_some()
    }

    /// When it would begin one.
    pub(super) fn ready(&self, open: &[Lot]) -> f64 {
        let begin = |lot: &Lot| Some((self.finish(lot)? - self.own(lot)).max(self.won));
        open.iter().find_map(begin).unwrap_or(self.won)
    }

    /// What it has won so far, in its own seconds.
    pub(super) fn won(&self) -> f64 {
        self.won
    }

    /// It wins a share of a zone, 0..=1.
    pub(super) fn win(&mut self, lot: &Lot, share: f64) {
        self.won += self.own(lot) * share;
        self.room -= 1;
    }
}

/// An offer during a round.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lot {
    pub(super) zone: ZoneId,
    /// Among all offers.
    pub(super) place: usize,
    /// T_est, in seconds.
    pub(super) time: f64,
    pub(super) complexity: f64,
}

impl Lot {
    pub(super) fn all(offers: &[Offer]) -> Vec<Self> {
        let lot = |(place, offer): (usize, &Offer)| {
            let (time, complexity) = (offer.time_estimated.as_secs_f64(), offer.complexity);
            Self { zone: offer.zone, place, time, complexity }
        };
        offers.iter().enumerate().map(lot).collect()
    }
}
