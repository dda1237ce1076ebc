//! The ledger of units in progress. Removing a packet settles it, which succeeds once only: so every unit is settled
//! once, however many threads try to.

use std::collections::BTreeMap;

use super::unit::Unit;

/// The units in progress on one resource, by packet number.
pub(crate) struct Ledger<T>(BTreeMap<u64, Vec<Unit<T>>>);

impl<T> Ledger<T> {
    pub(crate) fn new() -> Self {
        Self(BTreeMap::new())
    }

    pub(crate) fn enter(&mut self, sequence: u64, units: Vec<Unit<T>>) {
        self.0.insert(sequence, units);
    }

    /// Removes and returns the units of a packet; `None`: settled before.
    pub(crate) fn settle(&mut self, sequence: u64) -> Option<Vec<Unit<T>>> {
        self.0.remove(&sequence)
    }

    /// Returns true if there are units in progress.
    pub(crate) fn is_busy(&self) -> bool {
        !self.0.is_empty()
    }

    /// Returns the numbers of the packets in progress.
    pub(crate) fn sequences(&self) -> Vec<u64> {
        self.0.keys().copied().collect()
    }

    /// Returns the units of a packet that is not settled.
    pub(crate) fn look(&self, sequence: u64) -> Option<&[Unit<T>]> {
        self.0.get(&sequence).map(Vec::as_slice)
    }
}
