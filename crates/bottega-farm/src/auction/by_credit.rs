//! The paper's rule: the most complex zone first, to the bidder with the most credit. Each bidder wins at most one
//! zone.

use super::{
    round::{Candidate, Lot},
    terms::{Award, Decision},
};
use crate::Offer;

/// Decides one round; `credit_decided` is set if a bidder won against an earlier one because of its credit.
pub(super) fn decide(offers: &[Offer], bidders: &mut [Candidate]) -> Decision {
    // Take the most complex zone first
    let mut by_complexity = Lot::all(offers);
    by_complexity.sort_by(|a, b| b.complexity.total_cmp(&a.complexity));
    let mut decision = Decision::default();
    for lot in by_complexity {
        // Find the bidders that want it and have won nothing yet
        let mut bids = bidders.iter_mut().filter(|bidder| bidder.room > 0 && bidder.bids_for(&lot));
        let Some(mut best) = bids.next() else { continue };
        for other in bids {
            // Choose the bidder with the most credit; of equal ones, the first
            if other.bidder.credit > best.bidder.credit {
                (best, decision.credit_decided) = (other, true);
            }
        }
        // Award the zone; the winner gets no more in this round
        best.room = 0;
        decision.awards.push(Award { zone: lot.zone, agent: best.bidder.agent, share: None });
    }
    decision
}
