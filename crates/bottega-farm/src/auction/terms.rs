//! The terms of an auction: its rule, bidders, proposals and awards.

use super::{field::Field, member::MemberId};
use crate::{Bid, ZoneId};

/// Maximum number of zones dealt to one agent under [`AuctionRule::Stealing`]: a heartbeat lists them all.
const DEALT_MAX: u32 = 64;
/// Maximum number of zones that an agent may win to come after those it works on.
const RESERVE: u32 = 1;

/// The rule that decides a zone's winner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum AuctionRule {
    /// The most complex open zone goes to the bidder with the most credit.
    Paper,
    /// Like [`Self::FinishingTime`], but promises are not weighted by reliability: a baseline to measure the effect of
    /// credit.
    Promised,
    /// The bidder that is idle first chooses the largest zone that it finishes well before the expected end of the
    /// whole work, and the bidder that finishes it soonest gets it. If there is no such zone, the bidder gets one only
    /// if no other agent finishes that one sooner. So a slow agent does not take the last large zone. The finishing
    /// time is the promised one, weighted by reliability.
    #[default]
    FinishingTime,
    /// No rounds: the Master deals zones out as they are profiled, each to the agent that finishes it soonest, and idle
    /// agents take waiting zones from others. Promises are weighted as under [`Self::FinishingTime`].
    Stealing,
}

impl AuctionRule {
    /// Returns true if promises are weighted by reliability.
    pub(crate) fn weighs_promises(self) -> bool {
        matches!(self, Self::FinishingTime | Self::Stealing)
    }

    /// Returns the number of zones that an agent of this rule works on at once, for a prediction of the time left.
    ///
    /// - `prefetch`: the number that it begins.
    pub(crate) fn at_once(self, prefetch: u32) -> usize {
        // The second zone of a dealt hand keeps processors busy only while the first one drains
        if self == Self::Stealing { 1 } else { prefetch as usize }
    }

    /// Returns the maximum number of zones that the Master lets an agent hold.
    ///
    /// - `prefetch`: the number of zones that an agent works on at once.
    pub(crate) fn window(self, prefetch: u32) -> u32 {
        match self {
            Self::Stealing => prefetch.max(DEALT_MAX),
            Self::Paper => prefetch,
            Self::FinishingTime | Self::Promised => prefetch + RESERVE,
        }
    }
}

/// The proposal of a bidder: its bids, and how many zones it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The number of zones that the agent has room for.
    pub room: u32,
    /// One bid per zone that the agent wants.
    pub bids: Vec<Bid>,
}

/// An agent with its proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Bidder {
    /// The agent's id.
    pub agent: MemberId,
    /// The bidder's credit by the paper: the sum of T_est − T, in seconds.
    pub credit: f64,
    /// The factor on the bidder's promises, from its reliability: 1 if promises were kept, 0.5 if zones took twice as
    /// long.
    pub worth: f64,
    /// Seconds that all processors of the bidder together need for one second of work of the reference machine, as the
    /// bidder reports them.
    pub own: f64,
    /// The number of zones that the agent lacks to have as many as it works on at once.
    pub needs: u32,
    /// The bidder's proposal in this round.
    pub proposal: Proposal,
}

/// The award of a zone, or of its first piece, to an agent.
#[derive(Clone, Debug, PartialEq)]
pub struct Award {
    /// The id of the zone.
    pub zone: ZoneId,
    /// The agent that wins the zone.
    pub agent: MemberId,
    /// The share of the zone to cut off for the winner, 0..1; `None`: all of it.
    pub share: Option<f64>,
}

/// The Master's knowledge at the end of a round.
pub struct BidderStanding<'a> {
    /// All agents of the Master that may take zones, including those that do not bid.
    pub field: &'a Field,
    /// The end of the round, in seconds since the start of the platform.
    pub now: f64,
    /// The sum of T_est of all zones that no agent holds, in reference-machine seconds.
    pub open: f64,
    /// A function that returns true if a zone can be cut; `None`: cutting is off.
    pub can_cut: Option<&'a dyn Fn(ZoneId) -> bool>,
}

/// The decision of a round: its awards, and figures about them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decision {
    /// The awards, one for each zone that has a winner.
    pub awards: Vec<Award>,
    /// Number of zones awarded to a bidder that did not choose them, because it finishes them sooner than the one that
    /// did.
    pub outbid: u32,
    /// True if credit decided an award: the awards differ from those of a round that believes all promises equally, or
    /// under [`AuctionRule::Paper`] a bidder won against an earlier one by more credit.
    pub credit_decided: bool,
}
