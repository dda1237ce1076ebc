//! The stack of subtrees still to be visited.
#![allow(unsafe_code)]

use crate::tree::{Child, MAX_DEPTH, WIDTH};
use std::mem::MaybeUninit;

/// Each level leaves at most seven siblings behind, and a vector store writes eight entries from the top on.
pub(crate) const CAPACITY: usize = (WIDTH - 1) * MAX_DEPTH + WIDTH;

/// Subtrees with the parameter where the ray enters them. Not initialized on creation: a ray uses a few entries only.
pub(crate) struct Stack {
    near: [MaybeUninit<f32>; CAPACITY],
    child: [MaybeUninit<Child>; CAPACITY],
    /// Entries below are initialized.
    len: usize,
}

impl Stack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { near: [MaybeUninit::uninit(); CAPACITY], child: [MaybeUninit::uninit(); CAPACITY], len: 0 }
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, child: Child, near: f32) {
        self.near[self.len].write(near);
        self.child[self.len].write(child);
        self.len += 1;
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<(Child, f32)> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: `len` grows only in `push`, which writes both entries, and in `grow`, whose caller vouches for them.
        unsafe { Some((self.child[self.len].assume_init(), self.near[self.len].assume_init())) }
    }

    /// The next eight entries, for a vector store. Panics when there is no room, which the bound on depth excludes.
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
    #[inline(always)]
    pub(crate) unsafe fn grow(&mut self, count: usize) {
        self.len += count;
    }
}
