//! The demand: how much work is still to come, as far as that can be known.

use std::time::Duration;

use super::plan::ByPrimitive;
use super::time::Time;
use crate::Primitive;

/// Part of the time that a stream of work has lasted by which a resource may finish after all others would have.
const OVERSHOOT: f64 = 0.02;
/// A pause this part of the time before ends a stream.
const PAUSE: u32 = 10;

/// What was announced and does not wait yet, and for how long work has been coming.
///
/// Of what was not announced nothing is known. But what has come for so long will mostly go on for about as long, and
/// whatever comes, nobody loses much by this: a resource that ends a work by 2 % of its time too late costs 2 %.
#[derive(Clone, Debug, Default)]
pub(crate) struct Demand {
    announced: ByPrimitive<u64>,
    first: Time,
    last: Time,
    idle_since: Option<Time>,
}

impl Demand {
    /// So many items will come.
    pub(crate) fn announce(&mut self, primitive: Primitive, items: u64) {
        let announced = &mut self.announced[primitive.index()];
        *announced = announced.saturating_add(items);
    }

    /// Items that were announced are here, or will not come.
    pub(crate) fn arrived(&mut self, primitive: Primitive, items: u64) {
        let announced = &mut self.announced[primitive.index()];
        *announced = announced.saturating_sub(items);
    }

    pub(crate) fn announced(&self, primitive: Primitive) -> u64 {
        self.announced[primitive.index()]
    }

    /// Work came that nobody announced.
    pub(crate) fn came(&mut self, now: Time) {
        if let Some(idle) = self.idle_since.take() {
            let (pause, lasted) = (now.since(idle), idle.since(self.first));
            if pause * PAUSE > lasted {
                self.first = now;
            }
        }
        self.last = now;
    }

    /// Since when work has been coming.
    pub(crate) fn first(&self) -> Time {
        self.first
    }

    /// Nothing is left to do.
    pub(crate) fn ran_dry(&mut self, now: Time) {
        self.idle_since.get_or_insert(now);
    }

    /// By how much a resource may finish after all others would have.
    pub(crate) fn overshoot(&self) -> Duration {
        self.last.since(self.first).mul_f64(OVERSHOOT)
    }
}
