//! Residency: the data in a resource's memory, and the choice of data to evict.

use std::collections::BTreeMap;

use super::unit::Data;
use crate::DataId;

/// The data that a resource holds; the least recently used is evicted first.
#[derive(Debug)]
pub(crate) struct Residency {
    capacity: u64,
    used: u64,
    held: BTreeMap<DataId, ResidentData>,
    uses: u64,
    /// True if the resource uses this process's memory, where all data is resident.
    is_here: bool,
}

#[derive(Debug)]
struct ResidentData {
    bytes: u64,
    last_use: u64,
    /// Number of packets in flight that need it.
    pins: u32,
}

/// The steps to make data resident.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Admission {
    /// Data to evict first.
    pub(crate) evicted: Vec<DataId>,
    /// Bytes to send.
    pub(crate) moved_bytes: u64,
}

impl Residency {
    /// Makes an empty memory of `capacity` bytes; `None`: unlimited.
    pub(crate) fn new(capacity: Option<u64>) -> Self {
        Self { capacity: capacity.unwrap_or(u64::MAX), used: 0, held: BTreeMap::new(), uses: 0, is_here: false }
    }

    /// Returns the residency of a resource in this process's memory: everything is resident.
    pub(crate) fn here() -> Self {
        Self { is_here: true, ..Self::new(None) }
    }

    pub(crate) fn is_resident(&self, id: DataId) -> bool {
        self.is_here || self.held.contains_key(&id)
    }

    /// Returns the bytes of resident data.
    pub(crate) fn used(&self) -> u64 {
        self.used
    }

    /// Makes room for `data` and pins it. `None`: pinned data leaves no room.
    pub(crate) fn admit(&mut self, data: Data) -> Option<Admission> {
        if self.is_here {
            return Some(Admission { evicted: Vec::new(), moved_bytes: 0 });
        }
        self.uses += 1;
        if let Some(held) = self.held.get_mut(&data.id) {
            (held.last_use, held.pins) = (self.uses, held.pins + 1);
            return Some(Admission { evicted: Vec::new(), moved_bytes: 0 });
        }
        let pinned: u64 = self.held.values().filter(|held| held.pins > 0).map(|held| held.bytes).sum();
        if data.bytes > self.capacity.saturating_sub(pinned) {
            return None;
        }
        let mut evicted = Vec::new();
        while data.bytes > self.capacity.saturating_sub(self.used) {
            evicted.extend(Some(self.evict_oldest()?));
        }
        self.used += data.bytes;
        self.held.insert(data.id, ResidentData { bytes: data.bytes, last_use: self.uses, pins: 1 });
        Some(Admission { evicted, moved_bytes: data.bytes })
    }

    /// Unpins data after a packet is done.
    pub(crate) fn release(&mut self, id: DataId) {
        if let Some(held) = self.held.get_mut(&id) {
            held.pins = held.pins.saturating_sub(1);
        }
    }

    /// Evicts all data that no packet in flight needs.
    pub(crate) fn evict_all(&mut self) -> Vec<DataId> {
        std::iter::from_fn(|| self.evict_oldest()).collect()
    }

    /// Takes in the free memory that the resource reports.
    pub(crate) fn set_free(&mut self, free: u64) {
        self.capacity = self.used.saturating_add(free);
    }

    fn evict_oldest(&mut self) -> Option<DataId> {
        let unpinned = self.held.iter().filter(|(_, held)| held.pins == 0);
        let (&id, _) = unpinned.min_by_key(|(_, held)| held.last_use)?;
        self.used -= self.held.remove(&id).map_or(0, |held| held.bytes);
        Some(id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn data(id: u64, bytes: u64) -> Data {
        Data { id: DataId(id), bytes }
    }

    #[test]
    fn the_least_recently_used_goes_first_and_what_is_needed_stays() {
        let mut residency = Residency::new(Some(10));
        for id in 0..2 {
            assert_eq!(residency.admit(data(id, 5)).map(|admission| admission.moved_bytes), Some(5));
        }
        assert_eq!(residency.admit(data(2, 5)), None, "both are needed");
        residency.release(DataId(0));
        residency.release(DataId(1));
        assert_eq!(residency.admit(data(0, 5)).map(|admission| admission.moved_bytes), Some(0));
        residency.release(DataId(0));
        assert_eq!(residency.admit(data(2, 5)).map(|admission| admission.evicted), Some(vec![DataId(1)]));
        assert_eq!(residency.admit(data(3, 11)), None, "it would not fit into an empty memory");
        assert!(residency.is_resident(DataId(0)));
    }

    proptest! {
        #[test]
        fn never_more_than_the_capacity(steps in prop::collection::vec((0_u64..12, any::<bool>()), 1..200)) {
            let mut residency = Residency::new(Some(40));
            let mut pinned: Vec<u64> = Vec::new();
            for (id, release) in steps {
                if release {
                    if let Some(id) = pinned.pop() {
                        residency.release(DataId(id));
                    }
                } else if let Some(admission) = residency.admit(data(id, 3 + id)) {
                    prop_assert!(admission.evicted.iter().all(|evicted| !pinned.contains(&evicted.0)));
                    pinned.push(id);
                }
                prop_assert!(residency.used() <= 40);
                prop_assert!(pinned.iter().all(|&id| residency.is_resident(DataId(id))));
            }
        }
    }
}
