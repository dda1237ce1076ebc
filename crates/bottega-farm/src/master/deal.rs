//! Dealing: assignment of zones without auction rounds, and transfer of waiting zones between agents.
//!
//! Each zone is dealt, the largest first, to the agent that finishes it soonest (Graham's longest-processing-time rule,
//! for agents of different speeds). After that agents take zones from each other; the Master records the holder,
//! because the row's revision is the fencing token.

use bottega_agents::{AgentId, Performative, Time};

use super::assignments::Assignments;
use crate::{
    Award, FarmAction, FarmContent, FarmEffect, MemberId, PassedOrder, Theft, ZoneRow, ZoneState, contents::message,
    protocol,
};

/// Maximum number of neighbors of an agent.
const NEIGHBORS_MAX: usize = 8;

/// Deals waiting zones, the largest first, until the agent that finishes the next one soonest has no room for it.
pub(super) fn deal(now: Time, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
    while let Some(offer) = assignments.ledger.open.largest() {
        // Find the agent that finishes the largest zone soonest
        let (at, time) = (now.elapsed().as_secs_f64(), offer.time_estimated.as_secs_f64());
        let roster = &assignments.roster;
        let soonest = roster.field().soonest(at, time).map(|(_, agent)| agent);
        let Some(agent) = soonest.filter(|&agent| roster.has_room(agent)) else { return };
        if assignments.rows.is_being_written(offer.zone) {
            return;
        }
        // Award the zone to it
        let conversation = assignments.rows.number();
        assignments.award(now, &Award { zone: offer.zone, agent, share: None }, conversation, actions);
    }
}

/// Transfers orders that an agent has not begun to another agent. Orders not transferred return to the giver with its
/// next heartbeat.
pub(super) fn hand_over(
    now: Time,
    from: &AgentId,
    to: &AgentId,
    orders: &[PassedOrder],
    assignments: &mut Assignments,
    actions: &mut Vec<FarmAction>,
) {
    let mut passed = 0;
    for order in orders {
        if let Some(row) = handed_over(from, to, order, assignments) {
            passed += 1;
            assignments.order(now, row, actions);
        }
    }
    if passed > 0 {
        let theft = Theft { from: from.clone(), to: to.clone(), zones: passed };
        actions.push(FarmAction::Effect(FarmEffect::Stolen(theft)));
    }
}

/// Returns a zone's row after the transfer of its order; `None`: it cannot be transferred.
fn handed_over(from: &AgentId, to: &AgentId, order: &PassedOrder, assignments: &Assignments) -> Option<ZoneRow> {
    let &PassedOrder { zone, fence, kept } = order;
    let Assignments { config, rows, .. } = assignments;
    let (revision, row) = rows.zone(zone)?;
    // Check that the giver holds the zone under this token, and that no other agent works on it
    let is_its = row.state == ZoneState::Awarded && row.agent.as_ref() == Some(from) && revision == fence;
    if !is_its || row.rival.is_some() || !row.is_new_to(to) || rows.is_being_written(zone) {
        return None;
    }
    // Where a zone is cut, the giver keeps the first part, and the rest is dealt, normally to the idle receiver.
    let share = Some(kept).filter(|kept| config.shares_tail && *kept > 0.0 && *kept < 1.0);
    match share.and_then(|share| rows.cut(zone, share)) {
        Some(row) => Some(row),
        None if kept > 0.5 => None,
        None => Some(ZoneRow { agent: Some(to.clone()), ..row.clone() }),
    }
}

/// Sends an agent its neighbors if they have changed.
pub(super) fn send_neighbors(agent: MemberId, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
    let Some(neighbors) = assignments.roster.new_neighbors(agent, NEIGHBORS_MAX) else { return };
    let to = vec![assignments.roster.name(agent).clone()];
    let content = FarmContent::Neighbors(assignments.names(&neighbors));
    let inform = message(Performative::Inform, protocol::SUBSCRIBE, &assignments.config.id, to, content);
    actions.push(FarmAction::Send(inform));
}
