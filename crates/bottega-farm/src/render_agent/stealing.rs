//! Stealing: an agent begins the zones dealt to it one after the other, and takes waiting zones from its neighbors when
//! it has none.
//!
//! Source: Blumofe and Leiserson, *Scheduling Multithreaded Computations by Work Stealing* (1999): idle workers ask,
//! busy ones are not interrupted by a master. A neighbor gives as much as makes both finish together, since agents
//! differ in speed. The Master records the new holder, but does not choose it.

use std::time::Duration;

use super::{held_order::HeldOrder, speed::Speed};
use crate::{Expert, PassedOrder, ZoneId, adaptation::scaled};

/// Maximum number of zones given at a time.
const YIELDED_MAX: usize = 16;
/// Minimum share for each side when a zone is divided.
const SHARE_MIN: f64 = 0.2;

/// A neighbor that asks for zones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbor {
    /// Own seconds per second of the reference machine.
    own_seconds: f64,
    /// Time until the neighbor has painted what it holds.
    load: Duration,
}

impl Neighbor {
    /// Makes a neighbor as it describes itself.
    pub(super) fn new(own_seconds: f64, load: Duration) -> Self {
        let own_seconds = if own_seconds.is_finite() { own_seconds.clamp(1e-6, 1e6) } else { 1.0 };
        Self { own_seconds, load }
    }
}

/// Returns the orders to give to a neighbor, the last of `waiting` first, while the neighbor finishes them before
/// this agent finishes everything. Of the next zone such a part is given that both finish together.
///
/// - `waiting`: the zones that are not begun, the last first.
/// - `load`: time until this agent has painted all that it holds.
pub(super) fn orders_for(
    neighbor: Neighbor,
    waiting: Vec<(ZoneId, &HeldOrder)>,
    load: Duration,
    speed: &Speed,
    expert: &Expert,
) -> Vec<PassedOrder> {
    let (mut mine, mut theirs) = (load, neighbor.load);
    let mut orders = Vec::new();
    // Give whole zones while the neighbor finishes first
    for (zone, held) in waiting.into_iter().take(YIELDED_MAX) {
        let time = held.time(expert).unwrap_or_default();
        let (fence, here, there) = (held.order.fence, speed.own(time), scaled(time, neighbor.own_seconds));
        if theirs.saturating_add(there) < mine {
            (mine, theirs) = (mine.saturating_sub(here), theirs.saturating_add(there));
            orders.push(PassedOrder { zone, fence, kept: 0.0 });
            continue;
        }
        // Keep the part of the next zone with which both finish together
        let begins = mine.saturating_sub(here).as_secs_f64();
        let kept = theirs.saturating_add(there).as_secs_f64() - begins;
        let kept = kept / here.saturating_add(there).as_secs_f64().max(1e-9);
        if kept > SHARE_MIN && kept < 1.0 - SHARE_MIN {
            orders.push(PassedOrder { zone, fence, kept });
        }
        break;
    }
    orders
}
