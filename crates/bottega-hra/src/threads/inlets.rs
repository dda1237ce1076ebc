//! Inlets of the bin, where units wait until somebody looks into it: many small queues, each with a lock of its own.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use super::sync::lock;
use crate::policy::unit::{Chunk, Unit};

/// How many inlets there are, at most 64. Each client has one, by turns.
const COUNT: usize = 32;

/// A lock on a cache line of its own.
#[repr(align(128))]
struct Inlet<T>(Mutex<Vec<Chunk<T>>>);

/// The way in.
pub(crate) struct Inlets<T> {
    inlets: Vec<Inlet<T>>,
    /// A bit an inlet that something was put into since it was last emptied.
    filled: AtomicU64,
    next: AtomicUsize,
}

impl<T> Inlets<T> {
    pub(crate) fn new() -> Self {
        let inlets = (0..COUNT).map(|_| Inlet(Mutex::new(Vec::new()))).collect();
        Self { inlets, filled: AtomicU64::new(0), next: AtomicUsize::new(0) }
    }

    /// The number of an inlet for a new client.
    pub(crate) fn assign(&self) -> usize {
        self.next.fetch_add(1, Ordering::Relaxed) % COUNT
    }

    /// Puts a unit in.
    pub(crate) fn push(&self, inlet: usize, unit: Unit<T>) {
        self.fill(inlet, |chunks| match chunks.last_mut() {
            Some(last) if last.accepts(&unit.meta, false) => last.push(unit),
            _ => chunks.push(Chunk::new(unit, false)),
        });
    }

    /// Puts units in, in their order.
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

    /// Whether there is anything to take.
    pub(crate) fn is_filled(&self) -> bool {
        self.filled.load(Ordering::SeqCst) != 0
    }

    /// Takes everything out.
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
