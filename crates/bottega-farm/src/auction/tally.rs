//! The tally of an auction's rounds.

use bottega_agents::AgentId;
use serde::{Deserialize, Serialize};

/// One round.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RoundSummary {
    /// Its conversation.
    pub round: u64,
    /// Zones on offer.
    pub offers: u32,
    /// Agents that were called.
    pub called: u32,
    /// Agents that made a proposal.
    pub bidders: u32,
    /// Bids for single zones, all proposals together.
    pub bids: u32,
    /// Zones, or parts of zones, that were given away.
    pub awards: u32,
    /// Whether it would have been otherwise if all had been believed alike.
    pub credit_decided: bool,
}

impl RoundSummary {
    /// Whether several agents bid.
    pub fn is_contested(&self) -> bool {
        self.bidders >= 2
    }
}

/// An agent has taken zones that waited in another's hand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Theft {
    /// Who had them.
    pub from: AgentId,
    /// Who has them.
    pub to: AgentId,
    /// How many, parts of zones too.
    pub zones: u32,
}

/// All rounds of a work, and what agents took from each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AuctionTally {
    /// How many there were.
    pub rounds: u64,
    /// Of them those with several bidders.
    pub contested: u64,
    /// Of them those that would have been otherwise if all had been believed alike.
    pub credit_decided: u64,
    /// Agents that made a proposal, all rounds together.
    pub bidders: u64,
    /// Bids for single zones, all rounds together.
    pub bids: u64,
    /// Zones, or parts of zones, that were given away.
    pub awards: u64,
    /// How often an agent took zones from another.
    pub thefts: u64,
    /// Zones that changed hands so.
    pub stolen: u64,
}

impl AuctionTally {
    /// Of rounds that have ended.
    pub fn of(rounds: &[RoundSummary]) -> Self {
        let mut tally = Self::default();
        rounds.iter().for_each(|round| tally.add(round));
        tally
    }

    /// Of rounds as they ended: what share of the first half of them had several bidders, 0..=1.
    pub fn contested_of_first_half(rounds: &[RoundSummary]) -> f64 {
        let half = &rounds[..rounds.len().div_ceil(2)];
        let contested = half.iter().filter(|round| round.is_contested()).count();
        contested as f64 / half.len().max(1) as f64
    }

    /// Counts one more round.
    pub fn add(&mut self, round: &RoundSummary) {
        self.rounds += 1;
        self.contested += u64::from(round.is_contested());
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
