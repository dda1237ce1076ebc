//! The work bin: waiting units, and the selection of the next one.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use super::cable::CableBytes;
use super::time::Time;
use super::unit::{Chunk, Data, Meta, Unit, UnitNeeds};
use crate::{DataId, Primitive, PrimitiveSet};

/// Maximum number of data sets of one priority that are searched for a resident one.
const DATA_LOOKED_AT: usize = 16;

/// Sort key of a chunk: highest priority, then data, then first come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ChunkOrder {
    priority: Reverse<i32>,
    data: Option<DataId>,
    sequence: u64,
}

/// A chunk from which a resource may be served.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinHead {
    pub(crate) order: ChunkOrder,
    /// The needs of the bin's first unit.
    pub(crate) needs: UnitNeeds,
    pub(crate) late: Time,
}

impl BinHead {
    pub(crate) fn priority(&self) -> i32 {
        self.order.priority.0
    }

    pub(crate) fn sequence(&self) -> u64 {
        self.order.sequence
    }
}

/// Limit on the units of one packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PacketBound {
    pub(crate) units: usize,
    /// Limit in bytes, for a resource behind a slow cable.
    pub(crate) bytes: Option<CableBytes>,
}

/// The waiting units of one primitive.
struct Shelf<T> {
    chunks: BTreeMap<ChunkOrder, Chunk<T>>,
    /// The chunks, by the time at which their first unit becomes late.
    late: BTreeSet<(Time, ChunkOrder)>,
    /// The chunks whose first unit expires, by that time.
    expiring: BTreeSet<(Time, ChunkOrder)>,
    items: u64,
}

impl<T> Shelf<T> {
    fn new() -> Self {
        let (chunks, late, expiring) = (BTreeMap::new(), BTreeSet::new(), BTreeSet::new());
        Self { chunks, late, expiring, items: 0 }
    }

    fn put(&mut self, order: ChunkOrder, chunk: Chunk<T>) {
        let Some(front) = chunk.front() else { return };
        self.late.insert((front.late, order));
        if front.expires < Time::NEVER {
            self.expiring.insert((front.expires, order));
        }
        self.items = self.items.saturating_add(chunk.items());
        self.chunks.insert(order, chunk);
    }

    fn remove(&mut self, order: ChunkOrder) -> Option<Chunk<T>> {
        let chunk = self.chunks.remove(&order)?;
        if let Some(front) = chunk.front() {
            self.late.remove(&(front.late, order));
            self.expiring.remove(&(front.expires, order));
        }
        self.items = self.items.saturating_sub(chunk.items());
        Some(chunk)
    }

    fn head(&self, order: ChunkOrder) -> Option<BinHead> {
        let front = self.chunks.get(&order)?.front()?;
        Some(BinHead { order, needs: front.needs(), late: front.late })
    }

    /// Returns the first chunk after `order` with other data or lower priority.
    fn beyond(&self, order: ChunkOrder) -> Option<ChunkOrder> {
        let last = ChunkOrder { sequence: u64::MAX, ..order };
        self.chunks.range(last..).next().map(|(&order, _)| order)
    }
}

/// All waiting units.
pub(crate) struct Bin<T> {
    shelves: [Shelf<T>; Primitive::COUNT],
    /// Units that came back from a failed resource: few, because failed resources are suspended.
    retries: Vec<Unit<T>>,
    len: usize,
    sequence: u64,
}

impl<T> Bin<T> {
    pub(crate) fn new() -> Self {
        Self { shelves: std::array::from_fn(|_| Shelf::new()), retries: Vec::new(), len: 0, sequence: 0 }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Returns the number of waiting items of a primitive, without units to retry.
    pub(crate) fn items_of(&self, primitive: Primitive) -> u64 {
        self.shelves[primitive.index()].items
    }

    pub(crate) fn push(&mut self, chunk: Chunk<T>) {
        let Some(front) = chunk.front() else { return };
        let data = front.data.map(|data| data.id);
        let order = ChunkOrder { priority: Reverse(front.priority), data, sequence: self.sequence };
        let shelf = front.primitive.index();
        self.sequence += 1;
        self.len += chunk.len();
        self.shelves[shelf].put(order, chunk);
    }

    /// Puts back a failed unit; it goes before all others.
    pub(crate) fn push_retry(&mut self, unit: Unit<T>) {
        self.retries.push(unit);
        self.len += 1;
    }

    /// Takes a unit that failed elsewhere and `may` be tried here.
    pub(crate) fn take_retry(&mut self, may: impl Fn(&Meta) -> bool) -> Option<Unit<T>> {
        let index = self.retries.iter().position(|unit| may(&unit.meta))?;
        self.len -= 1;
        Some(self.retries.remove(index))
    }

    /// Returns the unit that became late first, among those late at `until`.
    pub(crate) fn latest(
        &self,
        able: PrimitiveSet,
        until: Time,
        holds: impl Fn(Option<Data>) -> bool,
    ) -> Option<BinHead> {
        let first = |primitive: Primitive| {
            let shelf = &self.shelves[primitive.index()];
            let late = shelf.late.iter().take_while(|(late, _)| *late <= until);
            late.filter_map(|&(_, order)| shelf.head(order)).find(|head| holds(head.needs.data))
        };
        able.iter().filter_map(first).min_by_key(|head| (head.late, head.needs.primitive, head.order))
    }

    /// Returns the position to draw from for `primitive`: among the data of the highest priority that the resource
    /// `holds`, a resident one, else the first come.
    pub(crate) fn head(
        &self,
        primitive: Primitive,
        holds: impl Fn(Option<Data>) -> bool,
        resident: impl Fn(DataId) -> bool,
    ) -> Option<BinHead> {
        let shelf = &self.shelves[primitive.index()];
        let mut best: Option<BinHead> = None;
        let mut next = shelf.chunks.first_key_value().map(|(&order, _)| order);
        let mut looked_at = 0;
        while let Some(order) = next {
            let head = shelf.head(order)?;
            if best.is_some_and(|best| best.priority() > head.priority() || looked_at >= DATA_LOOKED_AT) {
                break;
            }
            if holds(head.needs.data) {
                looked_at += 1;
                if head.needs.data.is_some_and(|data| resident(data.id)) {
                    return Some(head);
                }
                if best.is_none_or(|best| head.sequence() < best.sequence()) {
                    best = Some(head);
                }
            }
            next = shelf.beyond(order);
        }
        best
    }

    /// Takes units from `head` on, of the same priority and data: as many as the limit allows, and at least one.
    pub(crate) fn draw(&mut self, head: &BinHead, bound: PacketBound) -> Vec<Unit<T>> {
        let shelf = &mut self.shelves[head.needs.primitive.index()];
        let (mut drawn, mut bytes) = (Vec::new(), CableBytes::default());
        let mut next = Some(head.order);
        while let Some(order) = next
            && drawn.len() < bound.units
        {
            let Some(mut chunk) = shelf.remove(order) else { break };
            let is_full = match bound.bytes {
                None => {
                    chunk.draw(bound.units - drawn.len(), &mut drawn);
                    false
                }
                Some(most) => !chunk.draw_bytes((bound.units, most), &mut drawn, &mut bytes),
            };
            shelf.put(order, chunk);
            if is_full {
                break;
            }
            let following = shelf.chunks.range(order..).next().map(|(&order, _)| order);
            next = following.filter(|next| (next.priority, next.data) == (order.priority, order.data));
        }
        self.len -= drawn.len();
        drawn
    }

    /// Moves expired units from the bin to `out`.
    pub(crate) fn take_expired(&mut self, now: Time, out: &mut Vec<Unit<T>>) {
        let before = out.len();
        for shelf in &mut self.shelves {
            while let Some(&(expires, order)) = shelf.expiring.first()
                && expires <= now
            {
                let Some(mut chunk) = shelf.remove(order) else { break };
                while chunk.front().is_some_and(|front| front.expires <= now) {
                    out.extend(chunk.pop());
                }
                shelf.put(order, chunk);
            }
        }
        out.extend(self.retries.extract_if(.., |unit| unit.meta.expires <= now));
        self.len -= out.len() - before;
    }

    /// Returns the time at which the next unit expires.
    pub(crate) fn next_expiry(&self) -> Option<Time> {
        let shelves = self.shelves.iter().filter_map(|shelf| shelf.expiring.first().map(|&(expires, _)| expires));
        let retries = self.retries.iter().map(|unit| unit.meta.expires).filter(|&expires| expires < Time::NEVER);
        shelves.chain(retries).min()
    }

    /// Removes all units for which `wanted` holds, in order of submission within a primitive, priority and data.
    pub(crate) fn extract(&mut self, wanted: impl Fn(&Unit<T>) -> bool) -> Vec<Unit<T>> {
        let mut out: Vec<_> = self.retries.extract_if(.., |unit| wanted(unit)).collect();
        for shelf in &mut self.shelves {
            let orders: Vec<ChunkOrder> = shelf.chunks.keys().copied().collect();
            for order in orders {
                let Some(mut chunk) = shelf.remove(order) else { continue };
                chunk.extract(&wanted, &mut out);
                shelf.put(order, chunk);
            }
        }
        self.len -= out.len();
        out
    }
}
