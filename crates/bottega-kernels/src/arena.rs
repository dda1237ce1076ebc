//! Memory for the tree: cache lines, on huge pages for large trees where the system has them.
//!
//! A ray jumps through a tree far larger than the TLB covers. With pages of 2 MiB instead of 4 KiB the TLB covers it,
//! and a step costs one miss instead of two or three.
#![allow(unsafe_code)]

use bytemuck::{Pod, Zeroable};
use std::alloc::{Layout, alloc_zeroed, dealloc, handle_alloc_error};
use std::ops::{Deref, DerefMut};
use std::ptr::NonNull;

/// A cache line.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct CacheLine([u32; 16]);

const LINE: usize = size_of::<CacheLine>();
/// The size of a huge page on x86-64, and one of the sizes on other processors.
#[cfg(target_os = "linux")]
const HUGE: usize = 2 << 20;
/// Size from which huge pages are worth up to half a page of waste.
#[cfg(target_os = "linux")]
const LARGE: usize = HUGE / 2;

/// Returns the number of lines that a value takes.
pub(crate) const fn lines_of<T>() -> usize {
    size_of::<T>().div_ceil(LINE)
}

/// A growing array of cache lines that holds values of several types.
pub(crate) struct Arena {
    memory: NonNull<CacheLine>,
    len: usize,
    capacity: usize,
}

// SAFETY: owns its values as a `Vec` does.
unsafe impl Send for Arena {}
// SAFETY: as above.
unsafe impl Sync for Arena {}

impl Arena {
    /// Returns an empty arena without memory.
    pub(crate) const fn new() -> Self {
        Self { memory: NonNull::dangling(), len: 0, capacity: 0 }
    }

    /// Returns the used memory in bytes. Unused capacity does not count: the system provides pages on first touch.
    pub(crate) fn bytes(&self) -> usize {
        self.len * LINE
    }

    /// Appends `count` zeroed lines and returns them.
    pub(crate) fn grow(&mut self, count: usize) -> &mut [CacheLine] {
        let first = self.len;
        let needed = first.checked_add(count).filter(|&n| n <= isize::MAX as usize / LINE);
        let Some(needed) = needed else { handle_alloc_error(Layout::new::<CacheLine>()) };
        if needed > self.capacity {
            // Allocate exactly what the first tree needs: usually it is the only one.
            self.move_to(if first == 0 { needed } else { needed.max(self.capacity + self.capacity / 2) });
        }
        self.len = needed;
        &mut self[first..]
    }

    fn move_to(&mut self, capacity: usize) {
        let new = Self { memory: memory::zeroed(capacity), len: 0, capacity };
        let old = std::mem::replace(self, new);
        self.len = old.len;
        self.copy_from_slice(&old);
    }

    /// Returns the value that begins at a line. Panics if it ends beyond the arena.
    #[inline(always)]
    pub(crate) fn at<T: Pod>(&self, line: usize) -> &T {
        const { assert!(align_of::<T>() == LINE) };
        assert!(line + lines_of::<T>() <= self.len);
        // SAFETY: the lines are initialized and within the arena, aligned as `T` is, and any bytes are a `T`.
        unsafe { &*self.memory.as_ptr().add(line).cast::<T>() }
    }

    /// Returns the value that begins at a line, mutably.
    pub(crate) fn at_mut<T: Pod>(&mut self, line: usize) -> &mut T {
        &mut bytemuck::cast_slice_mut(&mut self[line..line + lines_of::<T>()])[0]
    }
}

impl Drop for Arena {
    fn drop(&mut self) {
        memory::free(self.memory, self.capacity);
    }
}

impl Deref for Arena {
    type Target = [CacheLine];
    #[inline(always)]
    fn deref(&self) -> &[CacheLine] {
        // SAFETY: the first `len` lines are initialized: they were zeroed on allocation.
        unsafe { std::slice::from_raw_parts(self.memory.as_ptr(), self.len) }
    }
}

impl DerefMut for Arena {
    fn deref_mut(&mut self) -> &mut [CacheLine] {
        // SAFETY: as in `deref`.
        unsafe { std::slice::from_raw_parts_mut(self.memory.as_ptr(), self.len) }
    }
}

impl std::fmt::Debug for Arena {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Arena").field("lines", &self.len).finish_non_exhaustive()
    }
}

/// Allocation of cache lines.
mod memory {
    use super::*;

    /// Allocates zeroed lines. Large blocks are untouched, so the threads that write them share the page faults.
    pub(super) fn zeroed(lines: usize) -> NonNull<CacheLine> {
        if lines == 0 {
            return NonNull::dangling();
        }
        #[cfg(target_os = "linux")]
        if let Some(bytes) = mapped(lines) {
            return huge(bytes);
        }
        let layout = layout(lines);
        // SAFETY: the layout has a size.
        NonNull::new(unsafe { alloc_zeroed(layout) }.cast()).unwrap_or_else(|| handle_alloc_error(layout))
    }

    /// Frees lines allocated by [`zeroed`], with their number.
    pub(super) fn free(memory: NonNull<CacheLine>, lines: usize) {
        if lines == 0 {
            return;
        }
        #[cfg(target_os = "linux")]
        if let Some(bytes) = mapped(lines) {
            // SAFETY: mapped by `huge`, which kept exactly this range.
            let _ = unsafe { rustix::mm::munmap(memory.as_ptr().cast(), bytes) };
            return;
        }
        // SAFETY: allocated by `zeroed` with this layout.
        unsafe { dealloc(memory.as_ptr().cast(), layout(lines)) };
    }

    fn layout(lines: usize) -> Layout {
        Layout::array::<CacheLine>(lines).unwrap_or_else(|_| handle_alloc_error(Layout::new::<CacheLine>()))
    }

    /// Returns the number of bytes to map for that many lines; `None` if they are too few.
    #[cfg(target_os = "linux")]
    fn mapped(lines: usize) -> Option<usize> {
        let bytes = lines.saturating_mul(LINE);
        (bytes >= LARGE).then(|| bytes.checked_next_multiple_of(HUGE).unwrap_or(bytes))
    }

    /// Maps memory from the system, on huge pages if possible.
    #[cfg(target_os = "linux")]
    fn huge(bytes: usize) -> NonNull<CacheLine> {
        use rustix::mm::{Advice, MapFlags, ProtFlags, madvise, mmap_anonymous, munmap};
        let failed = || handle_alloc_error(Layout::from_size_align(bytes, LINE).unwrap_or(Layout::new::<CacheLine>()));
        let room = bytes.saturating_add(HUGE);
        // SAFETY: a new mapping overlaps nothing.
        let all = unsafe {
            mmap_anonymous(std::ptr::null_mut(), room, ProtFlags::READ | ProtFlags::WRITE, MapFlags::PRIVATE)
        };
        let Ok(all) = all else { failed() };
        let all = all.cast::<u8>();
        let before = all.align_offset(HUGE);
        // SAFETY: both ends are within the mapping, page-aligned and unused; the advice changes no content, and its
        // failure only costs speed.
        unsafe {
            if before != 0 {
                let _ = munmap(all.cast(), before);
            }
            let memory = all.add(before);
            let _ = munmap(memory.add(bytes).cast(), HUGE - before);
            let _ = madvise(memory.cast(), bytes, Advice::LinuxHugepage);
            NonNull::new(memory.cast()).unwrap_or_else(|| failed())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stay_while_the_arena_grows() {
        let mut arena = Arena::new();
        assert!(arena.is_empty() && arena.bytes() == 0);
        let mut total = 0;
        for round in 1..60u32 {
            let count = round as usize * 57;
            let new = arena.grow(count);
            assert!(new.len() == count && new.iter().all(|line| line.0 == [0; 16]));
            new.fill(CacheLine([round; 16]));
            total += count;
        }
        assert_eq!((arena.len(), arena.bytes()), (total, total * 64));
        let mut rest = &arena[..];
        for round in 1..60 {
            let (part, after) = rest.split_at(round as usize * 57);
            assert!(part.iter().all(|line| line.0 == [round; 16]));
            rest = after;
        }
        *arena.at_mut(total - 1) = CacheLine([7; 16]);
        assert_eq!((*arena.at::<CacheLine>(total - 1), arena.at::<CacheLine>(0).0), (CacheLine([7; 16]), [1; 16]));
        if cfg!(target_os = "linux") {
            assert_eq!(arena.as_ptr() as usize % HUGE, 0, "as large as this, it lies on huge pages");
        }
    }

    #[test]
    #[should_panic(expected = "line")]
    fn values_beyond_the_end_are_refused() {
        let mut arena = Arena::new();
        arena.grow(7);
        arena.at::<crate::tree::WideNode>(4);
    }
}
