//! Ranges cut into pieces.

use std::ops::Range;

/// Cuts a range that begins with 0.
pub(crate) fn parts(count: u32, size: u32) -> impl Iterator<Item = Range<u32>> {
    (0..count.div_ceil(size)).map(move |part| part * size..count.min((part + 1).saturating_mul(size)))
}
