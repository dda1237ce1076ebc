//! Stalls: zones wait although an agent is free. The Master then restarts from the Blackboard.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::Time;

use super::{assignments::Assignments, roster::Member};
use crate::{MemberId, Watchdog};

/// Zones that have waited although agents are free.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stall {
    /// The time without progress.
    pub(super) waited: Duration,
    /// Number of waiting zones.
    pub(super) zones: usize,
    /// Number of free agents.
    pub(super) free: usize,
}

/// Detects stalls. Its default knows no wait.
#[derive(Clone, Debug, Default)]
pub(super) struct StallWatch {
    watchdog: Watchdog,
}

impl StallWatch {
    /// Returns the stall if zones have waited for [`STALLED_AFTER`](crate::STALLED_AFTER) although an agent is free.
    ///
    /// - `is_at_work`: true if the Master gives out zones.
    pub(super) fn check(&mut self, now: Time, is_at_work: bool, assignments: &Assignments) -> Option<Stall> {
        let in_vain = if is_at_work { waits_in_vain(assignments) } else { None };
        let waited = self.watchdog.look(now, in_vain.is_some(), assignments.orders_sent());
        let (waited, (zones, free)) = waited.zip(in_vain)?;
        Some(Stall { waited, zones, free })
    }
}

/// Returns the number of zones that wait for an agent and of agents that are free; `None` if either is zero. A zone whose
/// order is not on the Blackboard yet counts as waiting, and an agent without other orders as free.
///
/// An agent that refuses zones is not free. While others paint, neither is one that was passed over because another
/// agent finishes the zone sooner.
fn waits_in_vain(assignments: &Assignments) -> Option<(usize, usize)> {
    let Assignments { config, rows, ledger, roster, .. } = assignments;
    let mut ordered: BTreeMap<MemberId, usize> = BTreeMap::new();
    let mut being_given = 0;
    // Count zones whose order is being written as waiting
    for row in rows.pending_orders() {
        being_given += 1;
        for agent in row.holders().filter_map(|agent| roster.find(agent)) {
            *ordered.entry(agent).or_default() += 1;
        }
    }
    let zones = ledger.waiting_count() + being_given;
    if zones == 0 {
        return None;
    }
    let somebody_paints = ledger.in_hand_count() > being_given;
    // Count agents that are free and willing to take a zone
    let is_free = |member: &&Member| {
        let in_hand = ledger.load(member.id).0 - ordered.get(&member.id).copied().unwrap_or_default();
        let is_wanted = !somebody_paints || !config.deals() && !member.is_passed_over();
        in_hand == 0 && member.is_willing() && is_wanted
    };
    let free = roster.iter().filter(is_free).count();
    (free > 0).then_some((zones, free))
}
