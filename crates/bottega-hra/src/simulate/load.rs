//! The load of a simulation: units, and when they are submitted.

use std::time::Duration;

use crate::{DataId, Primitive, Time};

/// A unit that will be submitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// When. It goes in then, or when the bin has room.
    pub at: Time,
    /// What is asked for.
    pub primitive: Primitive,
    /// Of how many items.
    pub size: u64,
    /// Bytes that travel with it.
    pub payload_bytes: u64,
    /// Bytes of its answer.
    pub answer_bytes: u64,
    /// Data that it needs, and bytes of it.
    pub data: Option<(DataId, u64)>,
    /// Higher goes first.
    pub priority: i32,
    /// Longest wait.
    pub max_delay: Duration,
    /// Life time.
    pub validity: Duration,
}

impl Arrival {
    /// A unit without data that may wait for ever.
    pub fn new(at: Time, primitive: Primitive, size: u64) -> Self {
        let (max_delay, validity) = (Duration::MAX, Duration::MAX);
        Self { at, primitive, size, payload_bytes: 0, answer_bytes: 0, data: None, priority: 0, max_delay, validity }
    }
}

/// All that will be submitted, in the order of time. What comes at one moment is one group, known as a whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Load {
    /// The units.
    pub arrivals: Vec<Arrival>,
    /// When all that still waits is cancelled.
    pub cancelled: Vec<Time>,
}

impl Load {
    /// One group at the start: `units` units of `size` items, of these primitives by turns.
    pub fn batch(units: usize, size: u64, primitives: &[Primitive]) -> Self {
        let turns = primitives.iter().cycle().take(units);
        let arrivals = turns.map(|&primitive| Arrival::new(Time::ZERO, primitive, size)).collect();
        Self { arrivals, cancelled: Vec::new() }
    }
}
