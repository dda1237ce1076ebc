//! Statistics of an auction's rounds.

use bottega_agents::AgentId;
use serde::{Deserialize, Serialize};

/// The figures of one round of the auction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RoundSummary {
    /// The id of the round's conversation.
    pub round: u64,
    /// Number of zones on offer.
    pub offers: u32,
    /// Number of agents called.
    pub called: u32,
    /// Number of agents that made a proposal.
    pub bidders: u32,
    /// Number of bids for single zones, over all proposals.
    pub bids: u32,
    /// Number of zones, or pieces of zones, awarded.
    pub awards: u32,
    /// Number of zones awarded to a bidder that did not choose them, because it finishes them sooner than the one that
    /// did.
    pub outbid: u32,
    /// True if credit decided an award: see [`Decision::credit_decided`](crate::Decision::credit_decided).
    pub credit_decided: bool,
}

impl RoundSummary {
    /// Returns true if several agents bid.
    pub fn is_contested(&self) -> bool {
        self.bidders >= 2
    }
}

/// A transfer of waiting zones from one agent to another by stealing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Theft {
    /// The agent that held the zones.
    pub from: AgentId,
    /// The agent that took the zones.
    pub to: AgentId,
    /// Number of zones, including pieces.
    pub zones: u32,
}

/// Totals over all rounds of a work, and over its thefts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AuctionTally {
    /// Number of rounds.
    pub rounds: u64,
    /// Number of rounds with several bidders.
    pub contested: u64,
    /// Number of zones awarded to a bidder that did not choose them, because it finishes them sooner than the one that
    /// did.
    pub outbid: u64,
    /// Number of rounds in which credit decided an award: see [`RoundSummary::credit_decided`].
    pub credit_decided: u64,
    /// Number of proposals, over all rounds.
    pub bidders: u64,
    /// Number of bids for single zones, over all rounds.
    pub bids: u64,
    /// Number of zones, or pieces of zones, awarded.
    pub awards: u64,
    /// Number of times that an agent took zones from another.
    pub thefts: u64,
    /// Number of zones taken in these thefts, including pieces.
    pub stolen: u64,
}

impl AuctionTally {
    /// Makes the totals of rounds that have ended.
    pub fn of(rounds: &[RoundSummary]) -> Self {
        let mut tally = Self::default();
        rounds.iter().for_each(|round| tally.add(round));
        tally
    }

    /// Returns the share of contested rounds among the first half of the rounds, 0..=1; 0 without rounds.
    pub fn contested_of_first_half(rounds: &[RoundSummary]) -> f64 {
        let half = &rounds[..rounds.len().div_ceil(2)];
        let contested = half.iter().filter(|round| round.is_contested()).count();
        contested as f64 / half.len().max(1) as f64
    }

    /// Counts one more round.
    pub fn add(&mut self, round: &RoundSummary) {
        self.rounds += 1;
        self.contested += u64::from(round.is_contested());
        self.outbid += u64::from(round.outbid);
        self.credit_decided += u64::from(round.credit_decided);
        self.bidders += u64::from(round.bidders);
        self.bids += u64::from(round.bids);
        self.awards += u64::from(round.awards);
    }

    /// Counts one more theft.
    pub fn add_theft(&mut self, theft: &Theft) {
        self.thefts += 1;
        self.stolen += u64::from(theft.zones);
    }
}
