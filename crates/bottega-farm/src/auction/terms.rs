//! The terms of an auction: by which rule, who bids, what for, and what comes of it.

use super::{field::Field, member::MemberId};
use crate::{Bid, ZoneId};

/// Zones that wait in the hand of one agent at most, where they are dealt out: a heartbeat tells of all of them.
const DEALT_MAX: u32 = 64;

/// The rule that finds a zone's winner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum AuctionRule {
    /// The most complex open zone goes to the bidder with the most credit.
    Paper,
    /// As [`Self::FinishingTime`], but each agent is taken at its word: to see what credit is worth.
    Promised,
    /// An agent gets the largest zone that it finishes before the work as a whole can be expected to end; when there is
    /// none, only what nobody else would finish sooner. So a slow agent does not take the last big zone. When it finishes is
    /// what it promises, weighed by how far its promises held.
    #[default]
    FinishingTime,
    /// No rounds: the Master deals zones out as they are profiled, each to the agent that would finish it soonest, and agents
    /// take from each other what waits. What agents promise is weighed as by [`Self::FinishingTime`].
    Stealing,
}

impl AuctionRule {
    /// Whether what agents promise is weighed by how far their promises held.
    pub(crate) fn weighs_promises(self) -> bool {
        matches!(self, Self::FinishingTime | Self::Stealing)
    }

    /// Zones that a Master lets an agent have in hand at most.
    ///
    /// - `prefetch`: those that it is to have begun or have next.
    pub(crate) fn window(self, prefetch: u32) -> u32 {
        if self == Self::Stealing { prefetch.max(DEALT_MAX) } else { prefetch }
    }
}

/// The proposal of a bidder.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// Zones that it has room for.
    pub room: u32,
    /// When it would finish which zone.
    pub bids: Vec<Bid>,
}

/// One who has made a proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Bidder {
    /// Who.
    pub agent: MemberId,
    /// Its credit.
    pub credit: f64,
    /// What its word is worth by how far its promises held: 1 where they did, 0.5 where it needed twice as long.
    pub worth: f64,
    /// Its own time for a second of the reference machine's, all its processors together, by its own word.
    pub own: f64,
    /// What it said.
    pub proposal: Proposal,
}

/// A zone, or the first part of one, and who gets it.
#[derive(Clone, Debug, PartialEq)]
pub struct Award {
    /// Which zone.
    pub zone: ZoneId,
    /// Who.
    pub agent: MemberId,
    /// How much of the zone, 0..1; `None`: all of it.
    pub share: Option<f64>,
}

/// The knowledge at the end of a round.
pub struct BidderStanding<'a> {
    /// All agents of the Master, also those that do not bid now.
    pub field: &'a Field,
    /// When the round ends, in seconds.
    pub now: f64,
    /// T_est of all that nobody has in hand, in seconds.
    pub open: f64,
    /// Whether a zone can be cut; `None`: none is.
    pub can_cut: Option<&'a dyn Fn(ZoneId) -> bool>,
}

/// The decision of a round.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decision {
    /// Who gets what.
    pub awards: Vec<Award>,
    /// Whether it would have been otherwise if all had been believed alike.
    pub credit_decided: bool,
}
