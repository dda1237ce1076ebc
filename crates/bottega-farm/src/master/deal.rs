//! Dealing: assignment of zones without auction rounds, and transfer of waiting zones between agents.
//!
//! Each zone is dealt, the largest first, to the agent that finishes it soonest (Graham's longest-processing-time rule,
//! for agents of different speeds). After that agents take zones from each other; the Master records the holder,
//! because the row's revision is the fencing token.

use super::*;
use crate::{PassedOrder, Theft};

/// Maximum number of neighbors of an agent.
const NEIGHBORS_MAX: usize = 8;

impl Master {
    /// Deals waiting zones, the largest first, until the agent that finishes the next one soonest has no room for it.
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

    /// Handles the transfer of orders that an agent has not begun to another agent.
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
            // Orders not transferred return to the giver with its next heartbeat.
            return;
        }
        let mut passed = 0;
        for &PassedOrder { zone, fence, kept } in orders {
            let Some((revision, row)) = self.board.zone(zone) else { continue };
            let is_its = row.state == ZoneState::Awarded && row.agent.as_ref() == Some(from) && revision == fence;
            if !is_its || row.rival.is_some() || !row.is_new_to(to) || self.writes.contains_key(&zone) {
                continue;
            }
            // Where a zone is cut, the giver keeps the first part, and the rest is dealt, normally to the idle
            // receiver.
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

    /// Sends an agent its neighbors if they have changed.
    pub(super) fn tell_neighbors(&mut self, agent: MemberId, actions: &mut Vec<FarmAction>) {
        let Some(neighbors) = self.roster.new_neighbors(agent, NEIGHBORS_MAX) else { return };
        let to = vec![self.roster.name(agent).clone()];
        let content = FarmContent::Neighbors(self.names(&neighbors));
        let inform = message(Performative::Inform, protocol::SUBSCRIBE, &self.config.id, to, content);
        actions.push(FarmAction::Send(inform));
    }
}
