//! The choice of work for a resource that asks for some.

use std::time::Duration;

use super::bin::{BinHead, PacketBound};
use super::time::Time;
use super::unit::Unit;
use crate::ResourceId;

/// Shortest time after which a resource that got nothing asks again.
pub(super) const ASK_AGAIN_MIN: Duration = Duration::from_micros(200);

/// What a resource gets.
pub(super) enum LaneChoice<T> {
    /// A unit that failed elsewhere.
    Retry(Unit<T>),
    /// Units from there.
    Draw { head: BinHead, bound: PacketBound },
    /// Nothing before that time: others will be sooner, those named first of all, who must be awake to be so.
    Decline { until: Time, sooner: Vec<ResourceId> },
    /// There is nothing that it can do.
    Nothing,
}

impl<T> LaneChoice<T> {
    /// Nothing just now: what it should do is on its way into the bin.
    pub(super) fn shortly(now: Time) -> Self {
        Self::Decline { until: now.after(ASK_AGAIN_MIN), sooner: Vec::new() }
    }
}
