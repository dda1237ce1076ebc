//! Demand: an estimate of the work still to come.

use std::time::Duration;

use super::plan::ByPrimitive;
use super::time::Time;
use crate::Primitive;

/// Share of the duration of a stream of work by which a resource may finish after all others.
const OVERSHOOT: f64 = 0.02;
/// A pause of one in this many parts of the duration ends a stream.
const PAUSE: u32 = 10;

/// Announced work that is not waiting yet, and the duration of the current stream of work.
///
/// Unannounced work is unknown. But a stream usually continues for about as long as it has lasted, and the risk is
/// small: a resource that finishes 2 % of the duration too late costs 2 %.
#[derive(Clone, Debug, Default)]
pub(crate) struct Demand {
    announced: ByPrimitive<u64>,
    first: Time,
    last: Time,
    idle_since: Option<Time>,
}

impl Demand {
    /// Announces a number of items of a primitive that will follow.
    pub(crate) fn announce(&mut self, primitive: Primitive, items: u64) {
        let announced = &mut self.announced[primitive.index()];
        *announced = announced.saturating_add(items);
    }

    /// Subtracts announced items that have arrived or were withdrawn.
    pub(crate) fn arrived(&mut self, primitive: Primitive, items: u64) {
        let announced = &mut self.announced[primitive.index()];
        *announced = announced.saturating_sub(items);
    }

    pub(crate) fn announced(&self, primitive: Primitive) -> u64 {
        self.announced[primitive.index()]
    }

    /// Notes the arrival of unannounced work.
    pub(crate) fn came(&mut self, now: Time) {
        if let Some(idle) = self.idle_since.take() {
            let (pause, lasted) = (now.since(idle), idle.since(self.first));
            if pause * PAUSE > lasted {
                self.first = now;
            }
        }
        self.last = now;
    }

    /// Returns the start of the current stream of work.
    pub(crate) fn first(&self) -> Time {
        self.first
    }

    /// Notes that nothing is left to do.
    pub(crate) fn ran_dry(&mut self, now: Time) {
        self.idle_since.get_or_insert(now);
    }

    /// Returns the time by which a resource may finish after all others.
    pub(crate) fn overshoot(&self) -> Duration {
        self.last.since(self.first).mul_f64(OVERSHOOT)
    }
}
