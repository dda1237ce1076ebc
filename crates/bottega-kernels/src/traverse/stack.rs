//! The stack of subtrees to visit.
#![allow(unsafe_code)]

use crate::tree::{Child, MAX_DEPTH, WIDTH};
use std::mem::MaybeUninit;

/// The end marker, at most seven siblings per level, and room for a vector store of eight.
const CAPACITY: usize = 1 + (WIDTH - 1) * MAX_DEPTH + WIDTH;

/// Storage of a [`Stack`]'s entries. Separate from the stack, because compilers that see the length beside
/// uninitialized entries zero all of them.
pub(crate) struct Storage {
    near: [MaybeUninit<f32>; CAPACITY],
    child: [MaybeUninit<Child>; CAPACITY],
}

impl Storage {
    /// Returns uninitialized storage: a ray uses few entries.
    #[inline(always)]
    pub(crate) fn new() -> MaybeUninit<Self> {
        MaybeUninit::uninit()
    }
}

/// A stack of subtrees, with the parameters where the ray enters them.
pub(crate) struct Stack<'a> {
    near: &'a mut [MaybeUninit<f32>; CAPACITY],
    child: &'a mut [MaybeUninit<Child>; CAPACITY],
    /// Number of initialized entries; at least 1 until the end marker is popped.
    len: usize,
}

impl<'a> Stack<'a> {
    /// Makes a stack with only the end marker.
    #[inline(always)]
    pub(crate) fn new(storage: &'a mut MaybeUninit<Storage>) -> Self {
        // SAFETY: every part of `Storage` is a `MaybeUninit`, for which any bytes are valid.
        let Storage { near, child } = unsafe { storage.assume_init_mut() };
        near[0].write(f32::NEG_INFINITY);
        child[0].write(Child::EMPTY);
        Self { near, child, len: 1 }
    }

    /// Pushes a subtree that the ray enters at parameter `near`.
    #[inline(always)]
    pub(crate) fn push(&mut self, child: Child, near: f32) {
        self.near[self.len].write(near);
        self.child[self.len].write(child);
        self.len += 1;
    }

    /// Pops the top entry; [`Child::EMPTY`] at the end.
    #[inline(always)]
    pub(crate) fn pop(&mut self) -> (Child, f32) {
        self.len = self.len.saturating_sub(1);
        // SAFETY: `len` grows only in `push`, which writes both entries, and in `grow`, whose caller guarantees them;
        // the first entry was written on creation.
        unsafe { (self.child[self.len].assume_init(), self.near[self.len].assume_init()) }
    }

    /// Returns the subtree on top.
    #[inline(always)]
    pub(crate) fn top(&self) -> Child {
        // SAFETY: as in `pop`.
        self.child.get(self.len.wrapping_sub(1)).map_or(Child::EMPTY, |child| unsafe { child.assume_init() })
    }

    /// Returns the next eight entries, for a vector store. Panics if there is no room, which the bound on depth
    /// excludes.
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

    /// Adds `count` entries.
    ///
    /// # Safety
    ///
    /// The first `count` entries of [`Self::room`] are initialized.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) unsafe fn grow(&mut self, count: usize) {
        self.len += count;
    }
}
