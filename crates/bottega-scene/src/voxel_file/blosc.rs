//! Unpacking of Blosc chunks, by which OpenVDB and NanoVDB pack values.
//!
//! A chunk has a header of 16 bytes and blocks. A block has one part, or a part for each byte of a value, each packed
//! alone; values are shuffled: first the first byte of each, then the second. Source: the description of chunks in the
//! documentation of c-blosc 1, *Blosc Chunk Format*.

use std::io::Read;

use super::cursor::ByteCursor;
use super::error::VoxelError;

/// Name of a chunk in error messages.
const WHAT: &str = "a block of values";
/// Blosc splits a block into one part per byte of a value up to this size of values.
const SPLITS_MAX: usize = 16;
/// Least number of values of a block that is split.
const SPLIT_VALUES_MIN: usize = 128;

/// Unpacks a chunk, whose values take `size` bytes. `place`: its place in the file, for messages.
pub(super) fn unpack(chunk: &[u8], size: usize, place: usize) -> Result<Vec<u8>, VoxelError> {
    let damaged = || VoxelError::Packed { place, what: WHAT };
    let mut cursor = ByteCursor::new(chunk, 2);
    let (flags, value_size) = (cursor.u8(WHAT)?, usize::from(cursor.u8(WHAT)?));
    let [unpacked, block_size, _] = [cursor.u32(WHAT)?, cursor.u32(WHAT)?, cursor.u32(WHAT)?].map(|it| it as usize);
    if unpacked != size {
        return Err(damaged());
    }
    if flags & 2 != 0 {
        return cursor.take(size, WHAT).map(<[u8]>::to_vec);
    }
    if block_size == 0 || value_size == 0 {
        return Err(damaged());
    }
    let (is_shuffled, is_bit_shuffled, is_whole) = (flags & 1 != 0, flags & 4 != 0, flags & 16 != 0);
    let codec = flags >> 5;
    if is_bit_shuffled {
        return Err(VoxelError::Codec { codec: "Blosc with shuffled bits".into() });
    }
    let mut values = Vec::with_capacity(size);
    for block in 0..size.div_ceil(block_size) {
        let start = ByteCursor::new(chunk, 16 + 4 * block).u32(WHAT)? as usize;
        let length = block_size.min(size - block * block_size);
        let is_split = !is_whole
            && length == block_size
            && value_size <= SPLITS_MAX
            && block_size / value_size >= SPLIT_VALUES_MIN;
        let parts = if is_split { value_size } else { 1 };
        let mut cursor = ByteCursor::new(chunk, start);
        let mut bytes = Vec::with_capacity(length);
        for _ in 0..parts {
            let packed = cursor.u32(WHAT)? as usize;
            let packed = cursor.take(packed, WHAT)?;
            let part = if packed.len() == length / parts {
                packed.to_vec()
            } else {
                part(codec, packed, length / parts)?.ok_or_else(damaged)?
            };
            bytes.extend(part);
        }
        if bytes.len() != length {
            return Err(damaged());
        }
        if is_shuffled { unshuffle(&bytes, value_size, &mut values) } else { values.extend(bytes) }
    }
    Ok(values)
}

/// Unpacks a part to `size` bytes; `None`: it is damaged.
fn part(codec: u8, packed: &[u8], size: usize) -> Result<Option<Vec<u8>>, VoxelError> {
    let bytes = match codec {
        1 => lz4_flex::block::decompress(packed, size).ok(),
        3 => read_exactly(flate2::read::ZlibDecoder::new(packed), size),
        4 => ruzstd::decoding::StreamingDecoder::new(packed).ok().and_then(|decoder| read_exactly(decoder, size)),
        0 => return Err(VoxelError::Codec { codec: "BloscLZ".into() }),
        _ => return Err(VoxelError::Codec { codec: format!("Blosc's codec {codec}") }),
    };
    Ok(bytes.filter(|bytes| bytes.len() == size))
}

/// Unpacks a zlib stream to `size` bytes. `place`: its place in the file, for messages.
pub(super) fn inflate(packed: &[u8], size: usize, place: usize) -> Result<Vec<u8>, VoxelError> {
    read_exactly(flate2::read::ZlibDecoder::new(packed), size).ok_or(VoxelError::Packed { place, what: WHAT })
}

/// Reads `size` bytes; `None`: there are fewer, or the stream is damaged.
fn read_exactly(stream: impl Read, size: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    stream.take(size as u64).read_to_end(&mut bytes).ok()?;
    (bytes.len() == size).then_some(bytes)
}

/// Puts the bytes of each value side by side. Bytes after the last whole value stay in place.
fn unshuffle(bytes: &[u8], value_size: usize, values: &mut Vec<u8>) {
    let count = bytes.len() / value_size;
    for value in 0..count {
        values.extend((0..value_size).map(|byte| bytes[byte * count + value]));
    }
    values.extend(&bytes[count * value_size..]);
}
