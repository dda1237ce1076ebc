//! Decompression within the scene's memory limit.

use std::io::Read;

use super::source::MeshSource;
use crate::budget::HeldBytes;
use crate::error::SceneError;

/// The first bytes of a gzip file (RFC 1952).
pub(super) const GZIP_MAGIC: &[u8] = &[0x1f, 0x8b];

/// The greatest compression ratio of deflate.
pub(super) const RATIO_MAX: usize = 1032;

/// Decompresses a gzip file. Its memory stays booked until the second result is dropped.
pub(super) fn gunzip<'a>(source: MeshSource<'a>, bytes: &[u8]) -> Result<(Vec<u8>, HeldBytes<'a>), SceneError> {
    let limit = source.budget.limit();
    // The last four bytes are the length modulo 2³²: only a hint.
    let length = bytes.last_chunk().map_or(0, |length| u32::from_le_bytes(*length) as usize);
    let mut unfolded = Vec::new();
    let likely = length.min(bytes.len().saturating_mul(RATIO_MAX)).min(limit);
    let no_memory = |_| SceneError::Read {
        path: source.path.into(),
        by: String::new(),
        source: std::io::ErrorKind::OutOfMemory.into(),
    };
    unfolded.try_reserve_exact(likely).map_err(no_memory)?;
    let decoder = flate2::bufread::MultiGzDecoder::new(bytes);
    let read = decoder.take((limit as u64).saturating_add(1)).read_to_end(&mut unfolded);
    read.map_err(|error| source.damaged(format!("its gzip data cannot be unfolded ({error})")))?;
    let held = source.budget.hold(source.path, unfolded.len())?;
    Ok((unfolded, held))
}
