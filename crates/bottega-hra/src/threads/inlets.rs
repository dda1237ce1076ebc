//! The inlets of the bin: many small queues with a lock each, in which submitted units wait until the policy takes them
//! in.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use super::sync::lock;
use crate::policy::unit::{Chunk, Unit};

/// Number of inlets, at most 64. Clients are assigned to them in turn.
const COUNT: usize = 32;

/// A lock on its own cache line.
#[repr(align(128))]
struct Inlet<T>(Mutex<Vec<Chunk<T>>>);

/// All inlets of the bin.
pub(crate) struct Inlets<T> {
    inlets: Vec<Inlet<T>>,
    /// One bit per inlet: set if it may contain units.
    filled: AtomicU64,
    next: AtomicUsize,
}

impl<T> Inlets<T> {
    pub(crate) fn new() -> Self {
        let inlets = (0..COUNT).map(|_| Inlet(Mutex::new(Vec::new()))).collect();
        Self { inlets, filled: AtomicU64::new(0), next: AtomicUsize::new(0) }
    }

    /// Returns the index of an inlet for a new client.
    pub(crate) fn assign(&self) -> usize {
        self.next.fetch_add(1, Ordering::Relaxed) % COUNT
    }

    /// Adds a unit.
    pub(crate) fn push(&self, inlet: usize, unit: Unit<T>) {
        self.fill(inlet, |chunks| match chunks.last_mut() {
            Some(last) if last.accepts(&unit.meta, false) => last.push(unit),
            _ => chunks.push(Chunk::new(unit, false)),
        });
    }

    /// Adds units in order.
    pub(crate) fn push_all(&self, inlet: usize, new: Vec<Chunk<T>>) {
        self.fill(inlet, |chunks| {
            for chunk in new {
                let rest = match chunks.last_mut() {
                    Some(last) => last.join(chunk),
                    None => Some(chunk),
                };
                chunks.extend(rest);
            }
        });
    }

    fn fill(&self, inlet: usize, put: impl FnOnce(&mut Vec<Chunk<T>>)) {
        let bit = 1 << (inlet % COUNT);
        let mut chunks = lock(&self.inlets[inlet % COUNT].0);
        put(&mut chunks);
        if self.filled.load(Ordering::SeqCst) & bit == 0 {
            self.filled.fetch_or(bit, Ordering::SeqCst);
        }
    }

    /// Returns true if there are units to take.
    pub(crate) fn is_filled(&self) -> bool {
        self.filled.load(Ordering::SeqCst) != 0
    }

    /// Takes all units out.
    pub(crate) fn drain(&self, mut take: impl FnMut(Chunk<T>)) {
        let mut filled = self.filled.swap(0, Ordering::SeqCst);
        while filled != 0 {
            let inlet = filled.trailing_zeros() as usize;
            filled &= filled - 1;
            let chunks = std::mem::take(&mut *lock(&self.inlets[inlet].0));
            chunks.into_iter().for_each(&mut take);
        }
    }
}
