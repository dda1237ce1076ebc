//! The end of a work: zones of slow agents are also given to idle ones.

use std::time::Duration;

use bottega_agents::Time;

use super::assignments::Assignments;
use crate::{FarmAction, MemberId, Rival, ZoneId, ZoneRow, ZoneState};

/// An idle agent takes a zone over if it needs less than this share of its holder's remaining time.
const WORTH_IT: f64 = 0.8;
/// Time after which an idle agent repeats another agent's profile: profiles are short, so that agent is still preparing
/// or hangs.
const PROFILE_MAX: Duration = Duration::from_secs(20);
/// Number of agents tested as possibly too slow.
const LAGGARDS_MAX: usize = 4;
/// Maximum number of idle agents that take zones over per check.
const HELPERS_MAX: usize = 64;

/// Gives an idle agent a zone that its holder is too slow with, if no other zones wait.
pub(super) fn help_out(now: Time, helper: MemberId, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
    let ledger = &assignments.ledger;
    if !assignments.config.shares_tail || !ledger.open.is_empty() || ledger.next_unseen().is_some() {
        return;
    }
    assignments.roster.keep_laggards();
    if let Some(row) = takeover(now, helper, assignments) {
        tracing::info!(zone = row.zone.0, agent = %assignments.roster.name(helper), "takes a zone over");
        assignments.order(now, row, actions);
    }
}

/// Gives idle agents the zones that their holders are too slow with, if no other zones wait.
pub(super) fn help_all(now: Time, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
    if assignments.config.shares_tail && assignments.ledger.open.is_empty() {
        for agent in assignments.roster.idle(HELPERS_MAX) {
            help_out(now, agent, assignments, actions);
        }
    }
}

/// Returns the row of the zone that an idle agent takes over: its holder becomes the rival.
fn takeover(now: Time, helper: MemberId, assignments: &Assignments) -> Option<ZoneRow> {
    let Assignments { rows, ledger, roster, .. } = assignments;
    // Require an idle helper
    let own = roster.get(helper).filter(|member| member.is_idle())?.own();
    let name = roster.name(helper);
    let is_worth_it = |zone: ZoneId, ready: Time| {
        let Some((_, row)) = rows.zone(zone) else { return false };
        let is_free = row.rival.is_none() && row.is_new_to(name) && !rows.is_being_written(zone);
        let is_others = row.agent.as_ref() != Some(name);
        let since_order = assignments.time_since_order(now, zone);
        if row.state == ZoneState::Profiling {
            // The expected time is unknown, but profiles are short
            return is_free && is_others && since_order.is_some_and(|time| time > PROFILE_MAX);
        }
        // If the holder is late, assume that it needs as long again
        let left = if ready >= now { ready - now } else { since_order.unwrap_or_default() };
        let Some(estimated) = row.time_estimated else { return false };
        let is_faster = own * estimated.as_secs_f64() < WORTH_IT * left.as_secs_f64();
        is_free && is_others && row.state == ZoneState::Awarded && is_faster
    };
    // Search the zones of the slowest agents; the zone that its holder begins last comes first
    let mut zones = roster
        .laggards(now, LAGGARDS_MAX)
        .flat_map(|member| ledger.held_by(member.id).rev().map(|zone| (zone, member.ready)));
    let (zone, _) = zones.find(|&(zone, ready)| is_worth_it(zone, ready))?;
    let (revision, row) = rows.zone(zone)?;
    let rival = row.agent.clone().map(|agent| Rival { agent, fence: revision });
    Some(ZoneRow { agent: Some(name.clone()), rival, ..row.clone() })
}
