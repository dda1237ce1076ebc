//! Bidders and offers within one round.

use super::terms::Bidder;
use crate::{Offer, ZoneId};

/// A bidder within one round.
pub(super) struct Candidate {
    pub(super) bidder: Bidder,
    /// For each offer, in the order of the offers: the time at which it finishes it as its next zone, in seconds from
    /// now, divided by the bidder's worth. `None`: it does not bid for it.
    finish: Vec<Option<f64>>,
    /// Own seconds per second of the reference machine, divided by its worth.
    own: f64,
    pub(super) room: u32,
    /// The number of zones that it lacks: see [`Bidder::needs`].
    pub(super) needs: u32,
    /// Time of the zones won in this round, in its own seconds.
    won: f64,
}

impl Candidate {
    /// Makes a candidate of a bidder for these offers.
    ///
    /// - `worth`: the bidder's reliability: 1 if it kept its promises, 0.5 if zones took twice as long.
    pub(super) fn new(bidder: Bidder, offers: &[Offer], worth: f64) -> Self {
        let bids = &bidder.proposal.bids;
        let bid_for = |(place, offer): (usize, &Offer)| {
            // Bids come in the order of the offers, unless an offer was removed meanwhile.
            let likely = bids.get(place).filter(|bid| bid.zone == offer.zone);
            let bid = likely.or_else(|| bids.iter().find(|bid| bid.zone == offer.zone));
            bid.map(|bid| bid.finish.as_secs_f64() / worth)
        };
        // Sort the bids by offer
        let finish = offers.iter().enumerate().map(bid_for).collect();
        Self {
            finish,
            own: bidder.own / worth,
            room: bidder.proposal.room,
            needs: bidder.needs.min(bidder.proposal.room),
            bidder,
            won: 0.0,
        }
    }

    /// Returns the time of a zone on this bidder, in its own seconds.
    pub(super) fn own(&self, lot: &Lot) -> f64 {
        self.own * lot.time
    }

    /// Returns the finishing time of a zone after those it has won, in seconds from now. `None`: it does not bid for
    /// it.
    pub(super) fn finish(&self, lot: &Lot) -> Option<f64> {
        self.finish[lot.place].map(|finish| finish + self.won)
    }

    pub(super) fn bids_for(&self, lot: &Lot) -> bool {
        self.finish[lot.place].is_some()
    }

    /// Returns the time at which it can start its next zone, in seconds from now: computed from its first bid.
    pub(super) fn ready(&self, open: &[Lot]) -> f64 {
        let begin = |lot: &Lot| Some((self.finish(lot)? - self.own(lot)).max(self.won));
        open.iter().find_map(begin).unwrap_or(self.won)
    }

    /// Returns the time of the zones it has won so far, in its own seconds.
    pub(super) fn won(&self) -> f64 {
        self.won
    }

    /// Adds a share of a zone, 0..=1, to what it has won.
    pub(super) fn win(&mut self, lot: &Lot, share: f64) {
        self.won += self.own(lot) * share;
        self.room -= 1;
        self.needs = self.needs.saturating_sub(1).min(self.room);
    }
}

/// An offer within one round.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lot {
    pub(super) zone: ZoneId,
    /// Index among all offers.
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
