//! Cutting of ranges into parts.

use std::ops::Range;

/// Cuts `0..count` into ranges of `size`; the last one may be shorter.
pub(crate) fn parts(count: u32, size: u32) -> impl Iterator<Item = Range<u32>> {
    (0..count.div_ceil(size)).map(move |part| part * size..count.min((part + 1).saturating_mul(size)))
}
