//! The choice of work for a resource that asks for some.

use std::time::Duration;

use super::bin::{BinHead, PacketBound};
use super::time::Time;
use super::unit::Unit;
use crate::ResourceId;

/// Minimum time after which a resource that got nothing asks again.
pub(super) const ASK_AGAIN_MIN: Duration = Duration::from_micros(200);

/// The choice for a resource.
pub(super) enum LaneChoice<T> {
    /// A unit that failed elsewhere.
    Retry(Unit<T>),
    /// Units from this position of the bin.
    Draw { head: BinHead, bound: PacketBound },
    /// Nothing before that time: other resources finish sooner, and must be awake for that.
    Decline { until: Time, sooner: Vec<ResourceId> },
    /// Nothing that it supports is waiting.
    Nothing,
}

impl<T> LaneChoice<T> {
    /// Chooses nothing at the moment: the work is about to enter the bin.
    pub(super) fn shortly(now: Time) -> Self {
        Self::Decline { until: now.after(ASK_AGAIN_MIN), sooner: Vec::new() }
    }
}
