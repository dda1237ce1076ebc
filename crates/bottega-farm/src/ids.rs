//! Ids of works and zones.

use std::fmt;

/// The paper's IdWork: the number of a work, which is one picture of one scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct WorkId(pub u64);

/// The paper's IdZone: the index of a zone in the partition of its work; a piece that was cut off a zone has a new
/// number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ZoneId(pub u32);

impl ZoneId {
    /// Returns the id as an index into the zones of a partition.
    pub fn index(self) -> usize {
        self.0 as usize
    }

    /// Makes the id of the zone at this index.
    ///
    /// # Panics
    /// If the index is 2³² or more.
    pub fn of_index(index: usize) -> Self {
        Self(u32::try_from(index).expect("a partition has fewer than 2³² zones"))
    }
}

impl fmt::Display for WorkId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "work {}", self.0)
    }
}

impl fmt::Display for ZoneId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "zone {}", self.0)
    }
}
