//! Units in the policy: needs, deadlines and failed attempts.

use std::collections::VecDeque;

use super::cable::CableBytes;
use super::time::Time;
use crate::{DataId, Primitive, ResourceId};

/// Read-only data that a unit needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Data {
    pub(crate) id: DataId,
    pub(crate) bytes: u64,
}

/// The needs of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct UnitNeeds {
    pub(crate) primitive: Primitive,
    /// Number of items.
    pub(crate) size: u64,
    /// Bytes on a cable.
    pub(crate) bytes: CableBytes,
    pub(crate) data: Option<Data>,
}

/// The properties of a unit that determine its scheduling.
#[derive(Clone, Debug)]
pub(crate) struct Meta {
    pub(crate) primitive: Primitive,
    /// Number of items.
    pub(crate) size: u64,
    /// Bytes on a cable.
    pub(crate) bytes: CableBytes,
    pub(crate) data: Option<Data>,
    /// Priority; higher goes first.
    pub(crate) priority: i32,
    pub(crate) submitted: Time,
    /// The time from which the unit goes before all units that are not late.
    pub(crate) late: Time,
    /// The time from which the unit's output is no longer wanted.
    pub(crate) expires: Time,
    pub(crate) attempts: u32,
    /// Resources on which the unit failed.
    pub(crate) failed_on: Vec<ResourceId>,
}

impl Meta {
    pub(crate) fn needs(&self) -> UnitNeeds {
        let &Self { primitive, size, bytes, data, .. } = self;
        UnitNeeds { primitive, size, bytes, data }
    }
}

/// A unit in the policy: its properties, and a load for the driver.
#[derive(Clone, Debug)]
pub(crate) struct Unit<T> {
    pub(crate) meta: Meta,
    pub(crate) load: T,
}

/// A chunk: consecutive waiting units with equal primitive, data and priority, none due before the one in front of it.
/// The bin sorts chunks, not units.
#[derive(Clone, Debug)]
pub(crate) struct Chunk<T> {
    units: VecDeque<Unit<T>>,
    items: u64,
    /// True if the chunk's units were announced, as the rest of a group for which the bin had no room.
    pub(crate) announced: bool,
}

impl<T> Chunk<T> {
    /// Maximum number of units in a chunk, large enough to make the cost per chunk negligible.
    pub(crate) const UNITS_MAX: usize = 512;

    pub(crate) fn new(unit: Unit<T>, announced: bool) -> Self {
        Self::with_room(unit, announced, 1)
    }

    /// Makes a chunk with room for a number of units, within the maximum.
    pub(crate) fn with_room(unit: Unit<T>, announced: bool, units: usize) -> Self {
        let mut chunk = Self { units: VecDeque::with_capacity(units.min(Self::UNITS_MAX)), items: 0, announced };
        chunk.push(unit);
        chunk
    }

    /// Returns true if a unit with `meta` may be appended.
    pub(crate) fn accepts(&self, meta: &Meta, announced: bool) -> bool {
        let Some(last) = self.units.back().map(|unit| &unit.meta) else { return false };
        self.units.len() < Self::UNITS_MAX
            && self.announced == announced
            && (last.primitive, last.priority, last.data) == (meta.primitive, meta.priority, meta.data)
            && last.late <= meta.late
            && last.expires <= meta.expires
    }

    /// Appends a unit that the chunk accepts.
    pub(crate) fn push(&mut self, unit: Unit<T>) {
        self.items = self.items.saturating_add(unit.meta.size);
        self.units.push_back(unit);
    }

    /// Appends all units of another chunk, if it accepts them and has room; otherwise returns it.
    pub(crate) fn join(&mut self, mut other: Self) -> Option<Self> {
        let follows = other.front().is_some_and(|front| self.accepts(front, other.announced));
        if !follows || self.len() + other.len() > Self::UNITS_MAX {
            return Some(other);
        }
        self.items = self.items.saturating_add(other.items);
        self.units.append(&mut other.units);
        None
    }

    pub(crate) fn pop(&mut self) -> Option<Unit<T>> {
        let unit = self.units.pop_front()?;
        self.items = self.items.saturating_sub(unit.meta.size);
        Some(unit)
    }

    /// Takes up to `count` units from the front. The units of a whole chunk are not moved in memory.
    pub(crate) fn draw(&mut self, count: usize, drawn: &mut Vec<Unit<T>>) {
        if count >= self.len() && drawn.is_empty() {
            self.items = 0;
            *drawn = std::mem::take(&mut self.units).into();
        } else {
            drawn.extend((0..count).map_while(|_| self.pop()));
        }
    }

    /// Takes units from the front up to a number and a size in bytes; at least one. Returns true if more may follow.
    pub(crate) fn draw_bytes(
        &mut self,
        (units, most): (usize, CableBytes),
        drawn: &mut Vec<Unit<T>>,
        bytes: &mut CableBytes,
    ) -> bool {
        while drawn.len() < units
            && let Some(front) = self.front()
        {
            let with_it = bytes.add(front.bytes);
            if !drawn.is_empty() && !with_it.fits(most) {
                return false;
            }
            *bytes = with_it;
            drawn.extend(self.pop());
        }
        drawn.len() < units
    }

    /// Returns the properties of the first unit.
    pub(crate) fn front(&self) -> Option<&Meta> {
        self.units.front().map(|unit| &unit.meta)
    }

    pub(crate) fn len(&self) -> usize {
        self.units.len()
    }

    pub(crate) fn items(&self) -> u64 {
        self.items
    }

    /// Removes the units for which `wanted` holds; both parts keep their order.
    pub(crate) fn extract(&mut self, wanted: impl Fn(&Unit<T>) -> bool, out: &mut Vec<Unit<T>>) {
        if !self.units.iter().any(&wanted) {
            return;
        }
        for unit in std::mem::take(&mut self.units) {
            if wanted(&unit) {
                self.items = self.items.saturating_sub(unit.meta.size);
                out.push(unit);
            } else {
                self.units.push_back(unit);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(load: u64, late: u64) -> Unit<u64> {
        let meta = Meta {
            primitive: Primitive::Intersect,
            size: load,
            bytes: CableBytes::default(),
            data: None,
            priority: 0,
            submitted: Time::ZERO,
            late: Time::from_nanos(late),
            expires: Time::NEVER,
            attempts: 0,
            failed_on: Vec::new(),
        };
        Unit { meta, load }
    }

    fn chunk(loads: std::ops::Range<u64>) -> Chunk<u64> {
        let mut units = loads.map(|load| unit(load, load));
        let mut chunk = Chunk::new(units.next().expect("not empty"), false);
        units.for_each(|unit| chunk.push(unit));
        chunk
    }

    fn draw(chunk: &mut Chunk<u64>, count: usize, drawn: &[u64]) -> Vec<u64> {
        let mut units: Vec<_> = drawn.iter().map(|&load| unit(load, 0)).collect();
        chunk.draw(count, &mut units);
        units.iter().map(|unit| unit.load).collect()
    }

    #[test]
    fn units_leave_in_the_order_in_which_they_came_however_many_are_drawn() {
        let mut joined = chunk(1..4);
        assert!(joined.join(chunk(4..7)).is_none());
        assert_eq!((joined.len(), joined.items()), (6, 21));
        assert_eq!(draw(&mut joined, 2, &[]), [1, 2]);
        assert_eq!(draw(&mut joined, 1, &[9]), [9, 3]);
        assert_eq!((joined.len(), joined.items()), (3, 15));
        assert_eq!(draw(&mut joined, 5, &[]), [4, 5, 6]);
        assert_eq!((joined.len(), joined.items()), (0, 0));
    }

    #[test]
    fn what_is_due_before_does_not_join_and_no_chunk_grows_too_long() {
        let mut later = chunk(5..8);
        assert!(later.join(chunk(1..3)).is_some());
        assert!(later.join(chunk(8..9 + Chunk::<u64>::UNITS_MAX as u64 - 3)).is_some_and(|rest| rest.len() > 1));
        assert_eq!(later.len(), 3);
    }
}
