//! Dealing: zones go out without a round, and agents pass on what waits in their hands.
//!
//! Each zone is dealt, the largest first, to the agent that would finish it soonest (Graham's rule of the longest processing
//! time, for unequal agents). From then on agents take from each other; the Master writes who has a zone, for the row's revision
//! is the token under which it is painted.

use super::*;
use crate::{PassedOrder, Theft};

/// Neighbors of an agent at most.
const NEIGHBORS_MAX: usize = 8;

impl Master {
    /// Deals out all zones that wait, as long as the agent that would finish the next soonest has room for it.
    pub(super) fn deal(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        while let Some(offer) = self.ledger.open.largest() {
            let (at, time) = (now.elapsed().as_secs_f64(), offer.time_estimated.as_secs_f64());
            let soonest = self.roster.field().soonest(at, time).map(|(_, agent)| agent);
            let Some(agent) = soonest.filter(|&agent| self.roster.has_room(agent)) else { return };
            if self.writes.contains_key(&offer.zone) {
                return;
            }
            let conversation = self.number();
            self.give(now, &Award { zone: offer.zone, agent, share: None }, conversation, actions);
        }
    }

    /// An agent gives orders that it has not begun to another.
    pub(super) fn hand_over(
        &mut self,
        now: Time,
        from: &AgentId,
        to: &AgentId,
        orders: &[PassedOrder],
        actions: &mut Vec<FarmAction>,
    ) {
        let is_here = self.roster.get_by_name(to).is_some() && !self.left_out.contains_key(to);
        if self.config.auction != AuctionRule::Stealing || !self.begun || self.stopping || !is_here {
            // The orders are the giver's again when it tells what it has in hand.
            return;
        }
        let mut passed = 0;
        for &PassedOrder { zone, fence, kept } in orders {
            let Some((revision, row)) = self.board.zone(zone) else { continue };
            let is_its = row.state == ZoneState::Awarded && row.agent.as_ref() == Some(from) && revision == fence;
            if !is_its || row.rival.is_some() || !row.is_new_to(to) || self.writes.contains_key(&zone) {
                continue;
            }
            // Where it is shared, the giver has the first part, and the rest is dealt out: the other one is idle.
            let shared = Some(kept)
                .filter(|kept| self.config.shares_tail && *kept > 0.0 && *kept < 1.0)
                .and_then(|it| self.cut(zone, it));
            let row = match shared {
                Some(row) => row,
                None if kept > 0.5 => continue,
                None => ZoneRow { agent: Some(to.clone()), ..row.clone() },
            };
            passed += 1;
            let conversation = self.number();
            self.write(now, row, RowFollowUp::Order(conversation), actions);
        }
        if passed > 0 {
            let theft = Theft { from: from.clone(), to: to.clone(), zones: passed };
            actions.push(FarmAction::Effect(FarmEffect::Stolen(theft)));
        }
    }

    /// Tells an agent whom it may take zones from, if it does not know yet.
    pub(super) fn tell_neighbors(&mut self, agent: MemberId, actions: &mut Vec<FarmAction>) {
        let Some(neighbors) = self.roster.new_neighbors(agent, NEIGHBORS_MAX) else { return };
        let to = vec![self.roster.name(agent).clone()];
        let content = FarmContent::Neighbors(self.names(&neighbors));
        let inform = message(Performative::Inform, protocol::SUBSCRIBE, &self.config.id, to, content);
        actions.push(FarmAction::Send(inform));
    }
}
