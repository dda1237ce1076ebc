//! The paper's rule: the most complex zone first, and of those who want it the one with the most credit. An agent that is
//! idle takes one zone.

use super::{
    round::{Candidate, Lot},
    terms::{Award, Decision},
};
use crate::Offer;

/// Decides a round.
pub(super) fn decide(offers: &[Offer], bidders: &mut [Candidate]) -> Decision {
    let mut by_complexity = Lot::all(offers);
    by_complexity.sort_by(|a, b| b.complexity.total_cmp(&a.complexity));
    let mut decision = Decision::default();
    for lot in by_complexity {
        let mut bids = bidders.iter_mut().filter(|bidder| bidder.room > 0 && bidder.bids_for(&lot));
        let Some(mut best) = bids.next() else { continue };
        for other in bids {
            // Of equal credit the one that came first.
            if other.bidder.credit > best.bidder.credit {
                (best, decision.credit_decided) = (other, true);
            }
        }
        best.room = 0;
        decision.awards.push(Award { zone: lot.zone, agent: best.bidder.agent, share: None });
    }
    decision
}
