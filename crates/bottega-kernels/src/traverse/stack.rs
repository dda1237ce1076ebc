//! The stack of subtrees still to be visited.
#![allow(unsafe_code)]

use crate::tree::{Child, MAX_DEPTH, WIDTH};
use std::mem::MaybeUninit;

/// The mark of the end, at most seven siblings left behind by each level, and room for a vector store of eight.
const CAPACITY: usize = 1 + (WIDTH - 1) * MAX_DEPTH + WIDTH;

/// Room for the entries of a [`Stack`]. Apart from the stack itself, since compilers that see the length beside the
/// uninitialized entries fill all with zeros.
pub(crate) struct Storage {
    near: [MaybeUninit<f32>; CAPACITY],
    child: [MaybeUninit<Child>; CAPACITY],
}

impl Storage {
    /// Not initialized: a ray uses a few entries only.
    #[inline(always)]
    pub(crate) fn new() -> MaybeUninit<Self> {
        MaybeUninit::uninit()
    }
}

/// Subtrees with the parameter where the ray enters them.
pub(crate) struct Stack<'a> {
    near: &'a mut [MaybeUninit<f32>; CAPACITY],
    child: &'a mut [MaybeUninit<Child>; CAPACITY],
    /// Entries below are initialized; never 0, as the last entry popped is the mark of the end.
    len: usize,
}

impl<'a> Stack<'a> {
    /// A stack with nothing but the mark of the end.
    #[inline(always)]
    pub(crate) fn new(storage: &'a mut MaybeUninit<Storage>) -> Self {
        // SAFETY: every part of `Storage` is itself a `MaybeUninit`, for which any bytes will do.
        let Storage { near, child } = unsafe { storage.assume_init_mut() };
        near[0].write(f32::NEG_INFINITY);
        child[0].write(Child::EMPTY);
        Self { near, child, len: 1 }
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, child: Child, near: f32) {
        self.near[self.len].write(near);
        self.child[self.len].write(child);
        self.len += 1;
    }

    /// The entry on top, [`Child::EMPTY`] from the end on.
    #[inline(always)]
    pub(crate) fn pop(&mut self) -> (Child, f32) {
        self.len = self.len.saturating_sub(1);
        // SAFETY: `len` grows only in `push`, which writes both entries, and in `grow`, whose caller vouches for them; the
        // first entry was written at the beginning.
        unsafe { (self.child[self.len].assume_init(), self.near[self.len].assume_init()) }
    }

    /// The subtree on top.
    #[inline(always)]
    pub(crate) fn top(&self) -> Child {
        // SAFETY: as in `pop`.
        self.child.get(self.len.wrapping_sub(1)).map_or(Child::EMPTY, |child| unsafe { child.assume_init() })
    }

    /// The next eight entries, for a vector store. Panics when there is no room, which the bound on depth excludes.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) fn room(&mut self) -> (&mut [MaybeUninit<f32>; WIDTH], &mut [MaybeUninit<Child>; WIDTH]) {
        let range = self.len..self.len + WIDTH;
        let near = (&mut self.near[range.clone()]).try_into();
        let child = (&mut self.child[range]).try_into();
        match (near, child) {
            (Ok(near), Ok(child)) => (near, child),
            _ => unreachable!(),
        }
    }

    /// Counts `count` more entries in.
    ///
    /// # Safety
    /// The first `count` of the entries of [`Self::room`] have been written.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) unsafe fn grow(&mut self, count: usize) {
        self.len += count;
    }
}
