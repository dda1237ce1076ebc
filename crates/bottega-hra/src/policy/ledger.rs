//! Units under way. Who takes a packet out of here settles it; who finds it gone does not. So every unit is settled
//! once, however many claim to have done it.

use std::collections::BTreeMap;

use super::unit::Unit;

/// What one resource has in hand, by the number of its packet.
pub(crate) struct Ledger<T>(BTreeMap<u64, Vec<Unit<T>>>);

impl<T> Ledger<T> {
    pub(crate) fn new() -> Self {
        Self(BTreeMap::new())
    }

    pub(crate) fn enter(&mut self, sequence: u64, units: Vec<Unit<T>>) {
        self.0.insert(sequence, units);
    }

    /// The units of a packet, if nobody settled it before.
    pub(crate) fn settle(&mut self, sequence: u64) -> Option<Vec<Unit<T>>> {
        self.0.remove(&sequence)
    }

    /// Whether there is anything in hand.
    pub(crate) fn is_busy(&self) -> bool {
        !self.0.is_empty()
    }

    /// The packets in hand.
    pub(crate) fn sequences(&self) -> Vec<u64> {
        self.0.keys().copied().collect()
    }

    /// The units of a packet that was not settled.
    pub(crate) fn look(&self, sequence: u64) -> Option<&[Unit<T>]> {
        self.0.get(&sequence).map(Vec::as_slice)
    }
}
