//! The watch over orders: detects engines that hang while their agents still send heartbeats.

use std::time::Duration;

use bottega_agents::Time;

use super::{
    assignments::Assignments,
    roster::{Member, Roster},
    watched::LongestOrder,
};
use crate::{Holding, MemberId, STEP_MAX, ZoneRow};

/// An order hangs after this many times the expected time of one step.
const PATIENCE: f64 = 6.0;
/// Minimum time after which an order hangs, for an agent with a processor of its own.
const PATIENCE_MIN: Duration = Duration::from_secs(60);
/// Time for preparation before an order is begun, whose length is unknown.
const READY_WITHIN: Duration = Duration::from_secs(600);
/// Bound on the factor for agents that share a processor, whatever they report.
const SHARING_MAX: f64 = 32.0;
/// An order with progress is taken back after this many times its expected time, if there are other agents.
const LASTING: f64 = 60.0;
/// Minimum time after which an order with progress is taken back.
const LASTS_MIN: Duration = Duration::from_secs(4 * 3600);
/// Maximum time after which an order with progress is taken back: the expected time is the unconfirmed word of the agent that
/// profiled the zone.
const LASTS_MAX: Duration = Duration::from_secs(24 * 3600);

/// An order that has made no progress for too long.
#[derive(Clone, Debug)]
pub(super) struct HangingOrder {
    pub(super) order: Holding,
    /// The reason, as text for the user; the subject is the agent.
    pub(super) reason: String,
}

/// Returns the agent's longest-held order if it has made no progress for too long. Taking longer than expected is no
/// reason, except far beyond all bounds.
///
/// - `reported`: the orders in the agent's heartbeat. Orders of the Blackboard that are missing there count as without
///   progress; others are ignored.
pub(super) fn hanging_order(
    now: Time,
    agent: MemberId,
    reported: &[Holding],
    assignments: &mut Assignments,
) -> Option<HangingOrder> {
    // Find the order that the agent has worked on longest
    let orders = assignments.orders_of(agent, reported);
    let longest = assignments.roster.watch(now, agent, &orders);
    let LongestOrder { order, stands, lasts } = longest.filter(|it| it.lasts >= PATIENCE_MIN)?;
    let row = assignments.rows.settled_zone(order.zone)?;
    // Compare its times with the allowed ones
    let roster: &Roster = &assignments.roster;
    let [standing, lasting] = patience(roster.get(agent)?, row, &order, orders.len());
    let lasts_too_long = lasts >= lasting && roster.count() > 1;
    if stands < standing && !lasts_too_long {
        return None;
    }
    let reason = if stands < standing {
        format!("it has not painted {} within {} s", order.zone, lasts.as_secs())
    } else {
        format!("it has painted nothing of {} for {} s", order.zone, stands.as_secs())
    };
    Some(HangingOrder { order, reason })
}

/// Returns the allowed time without progress, and the allowed total time, of an agent's order. An agent with `order_count`
/// orders may divide its processors among them.
fn patience(member: &Member, row: &ZoneRow, order: &Holding, order_count: usize) -> [Duration; 2] {
    // Agents that share a machine slow each other down.
    let sharing = member.row.lanes.min(1.0).recip().min(SHARING_MAX);
    let least = PATIENCE_MIN.mul_f64(sharing);
    if order.progress == 0 {
        return [READY_WITHIN.mul_f64(sharing), LASTS_MAX];
    }
    // Without an estimate, use the least bounds
    let Some(estimated) = row.time_estimated else { return [least.mul_f64(order_count as f64), LASTS_MIN] };
    let samples = row.choice.map_or(1, |choice| row.goal_samples(&choice).saturating_sub(row.samples_done()));
    // Compute the expected time of the whole order and of one step of progress
    let whole = estimated.as_secs_f64() * member.own();
    let step = whole.min(STEP_MAX.as_secs_f64() * sharing).max(whole / f64::from(samples.max(1)));
    let of_all = |seconds: f64| Duration::try_from_secs_f64(seconds * order_count as f64).unwrap_or(Duration::MAX);
    let standing = of_all(PATIENCE * step).clamp(least, LASTS_MAX.max(least));
    [standing, of_all(LASTING * whole).clamp(LASTS_MIN, LASTS_MAX)]
}
