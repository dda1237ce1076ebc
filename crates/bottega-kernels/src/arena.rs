//! Memory for the tree: aligned to cache lines, and in huge pages where it is large and the system has them.
//!
//! A ray jumps through a tree far larger than what the processor's table of pages covers. With pages of 2 MiB in place of
//! 4 KiB it does, and a step costs one miss in place of two or three.
#![allow(unsafe_code)]

use bytemuck::Zeroable;
use std::alloc::{Layout, alloc, dealloc, handle_alloc_error};
use std::ops::{Deref, DerefMut};
use std::ptr::NonNull;

/// What a huge page is on x86-64, and one of the sizes on others.
const HUGE: usize = 2 << 20;
const LINE: usize = 64;

/// A growing array of plain values.
pub(crate) struct Arena<T> {
    memory: NonNull<T>,
    len: usize,
    capacity: usize,
}

// SAFETY: it owns its values as a `Vec` does.
unsafe impl<T: Send> Send for Arena<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Arena<T> {}

impl<T> Arena<T> {
    /// An empty arena without memory.
    pub(crate) const fn new() -> Self {
        Self { memory: NonNull::dangling(), len: 0, capacity: 0 }
    }

    /// Bytes held. What was never used is not counted: the system gives memory when it is touched.
    pub(crate) fn bytes(&self) -> usize {
        self.len * size_of::<T>()
    }

    fn layout(capacity: usize) -> Layout {
        let bytes = capacity.saturating_mul(size_of::<T>());
        let align = if bytes >= HUGE { HUGE } else { LINE.max(align_of::<T>()) };
        match Layout::from_size_align(bytes, align) {
            Ok(layout) => layout.pad_to_align(),
            Err(_) => handle_alloc_error(Layout::new::<T>()),
        }
    }
}

impl<T: Zeroable + Copy> Arena<T> {
    /// Appends `count` values of zeros and returns them.
    pub(crate) fn grow(&mut self, count: usize) -> &mut [T] {
        let first = self.len;
        let needed = first.checked_add(count).filter(|&n| n <= isize::MAX as usize / size_of::<T>());
        let Some(needed) = needed else { handle_alloc_error(Layout::new::<T>()) };
        if needed > self.capacity {
            // The first tree gets just what it needs: mostly it is the only one.
            self.move_to(if first == 0 { needed } else { needed.max(self.capacity + self.capacity / 2) });
        }
        // SAFETY: the range is within the capacity, and all-zero bytes are valid values.
        unsafe { self.memory.as_ptr().add(first).write_bytes(0, count) };
        self.len = needed;
        &mut self[first..]
    }

    fn move_to(&mut self, capacity: usize) {
        let layout = Self::layout(capacity);
        // SAFETY: the layout has a size, as `capacity` exceeds the present one and no type here is empty. The old values lie
        // apart from the new memory, which is larger.
        unsafe {
            let Some(memory) = NonNull::new(alloc(layout).cast::<T>()) else { handle_alloc_error(layout) };
            advise(memory.as_ptr().cast(), layout.size());
            std::ptr::copy_nonoverlapping(self.memory.as_ptr(), memory.as_ptr(), self.len);
            self.free();
            self.memory = memory;
        }
        self.capacity = capacity;
    }
}

impl<T> Arena<T> {
    fn free(&mut self) {
        if self.capacity != 0 {
            // SAFETY: allocated in `move_to` with the same layout; the values need no drop, being `Copy`.
            unsafe { dealloc(self.memory.as_ptr().cast(), Self::layout(self.capacity)) };
            self.capacity = 0;
        }
    }
}

/// Asks for huge pages.
#[cfg(target_os = "linux")]
fn advise(memory: *mut u8, bytes: usize) {
    if bytes >= HUGE {
        // SAFETY: the range is aligned to pages and was just allocated; the advice changes no content. A refusal costs speed only.
        let _ = unsafe { rustix::mm::madvise(memory.cast(), bytes, rustix::mm::Advice::LinuxHugepage) };
    }
}

#[cfg(not(target_os = "linux"))]
fn advise(_: *mut u8, _: usize) {}

impl<T> Drop for Arena<T> {
    fn drop(&mut self) {
        self.free();
    }
}

impl<T> Deref for Arena<T> {
    type Target = [T];
    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: the first `len` values are initialized, by `grow`.
        unsafe { std::slice::from_raw_parts(self.memory.as_ptr(), self.len) }
    }
}

impl<T> DerefMut for Arena<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        // SAFETY: as in `deref`.
        unsafe { std::slice::from_raw_parts_mut(self.memory.as_ptr(), self.len) }
    }
}

impl<T: std::fmt::Debug> std::fmt::Debug for Arena<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Arena").field("len", &self.len).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stay_while_the_arena_grows() {
        let mut arena = Arena::<[u64; 8]>::new();
        assert!(arena.is_empty() && arena.bytes() == 0);
        let mut total = 0;
        for round in 1..40usize {
            let count = round * 57;
            let new = arena.grow(count);
            assert!(new.len() == count && new.iter().all(|x| *x == [0; 8]));
            new.fill([round as u64; 8]);
            total += count;
        }
        assert_eq!((arena.len(), arena.bytes()), (total, total * 64));
        let mut rest = &arena[..];
        for round in 1..40usize {
            let (part, after) = rest.split_at(round * 57);
            assert!(part.iter().all(|x| *x == [round as u64; 8]));
            rest = after;
        }
        assert_eq!(arena.as_ptr() as usize % HUGE, 0, "as large as this, it lies on huge pages");
    }
}
