//! The waiting work: the bin with its capacity and fill level, and the work announced outside of it.

use super::bin::Bin;
use super::bin_log::{BinLog, BinReport};
use super::demand::Demand;
use super::length::BinLength;
use super::plan::ByPrimitive;
use super::time::Time;
use crate::{HraConfig, Primitive};

/// The units in the bin, and the work that has not entered it yet.
pub(crate) struct WaitingWork<T> {
    pub(super) bin: Bin<T>,
    pub(super) length: BinLength,
    pub(super) demand: Demand,
    log: BinLog,
}

impl<T> WaitingWork<T> {
    pub(super) fn new(config: &HraConfig, resources: usize) -> Self {
        let length = BinLength::new(config, resources);
        let mut demand = Demand::default();
        demand.ran_dry(Time::ZERO);
        Self { bin: Bin::new(), log: BinLog::new(length.capacity()), length, demand }
    }

    /// Notes the fill level of the bin.
    pub(super) fn note_level(&mut self, now: Time) {
        self.log.note(now, self.bin.len(), self.length.capacity());
    }

    /// Notes that a resource has taken units out of the bin.
    pub(super) fn note_taken(&mut self, now: Time, units: usize) {
        self.length.taken(now, units, self.bin.len());
        self.note_level(now);
    }

    /// Returns the number of items in the bin and announced, by primitive.
    pub(super) fn backlog(&self) -> ByPrimitive<f64> {
        Primitive::ALL
            .map(|primitive| self.bin.items_of(primitive).saturating_add(self.demand.announced(primitive)) as f64)
    }

    /// Returns the fill level of the bin until now.
    pub(super) fn report(&mut self, now: Time) -> BinReport {
        self.log.report(now)
    }
}
