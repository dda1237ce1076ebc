//! The load of a simulation: units with their times of submission.

use std::time::Duration;

use crate::{DataId, Primitive, Time};

/// A unit to submit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Time of arrival. The unit is submitted then, or later when the bin has room.
    pub at: Time,
    /// The primitive requested.
    pub primitive: Primitive,
    /// Number of items.
    pub size: u64,
    /// Bytes sent with the unit.
    pub payload_bytes: u64,
    /// Bytes of the unit's answer.
    pub answer_bytes: u64,
    /// The data that the unit needs, and its size in bytes.
    pub data: Option<(DataId, u64)>,
    /// Priority; higher goes first.
    pub priority: i32,
    /// Maximum time between submission and the start on a resource: see
    /// [`WorkUnit::max_delay`](crate::WorkUnit::max_delay).
    pub max_delay: Duration,
    /// Life time, counted from submission. A unit not done by then expires: see
    /// [`WorkUnit::validity`](crate::WorkUnit::validity).
    pub validity: Duration,
}

impl Arrival {
    /// Makes a unit of `size` items that arrives at `at`, with priority 0 and without data, maximum delay or expiry.
    pub fn new(at: Time, primitive: Primitive, size: u64) -> Self {
        let (max_delay, validity) = (Duration::MAX, Duration::MAX);
        Self { at, primitive, size, payload_bytes: 0, answer_bytes: 0, data: None, priority: 0, max_delay, validity }
    }
}

/// All units to submit, in order of time. Those with equal times are submitted as a group: the allocator knows all of
/// them, also those for which the bin has no room.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Load {
    /// The units, in the order of their arrival.
    pub arrivals: Vec<Arrival>,
    /// Times at which all waiting units are cancelled.
    pub cancelled: Vec<Time>,
}

impl Load {
    /// Makes a single group at the start: `units` units of `size` items, of these primitives in turn.
    pub fn batch(units: usize, size: u64, primitives: &[Primitive]) -> Self {
        let turns = primitives.iter().cycle().take(units);
        let arrivals = turns.map(|&primitive| Arrival::new(Time::ZERO, primitive, size)).collect();
        Self { arrivals, cancelled: Vec::new() }
    }
}
