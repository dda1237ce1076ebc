//! Records in an append-only log.
//!
//! A record consists of the length of its payload (u64, little endian), the first 16 bytes of the BLAKE3 hash of length
//! and payload, and the payload. A record that a crash left incomplete is ignored with all that follows it.

use std::io::{self, Read};

const HASH_BYTES: usize = 16;

/// Length of the header of a record, in bytes.
pub const RECORD_HEAD_BYTES: usize = 8 + HASH_BYTES;

/// Returns the header of a record with this payload.
pub fn record_head(payload: &[u8]) -> [u8; RECORD_HEAD_BYTES] {
    let length = (payload.len() as u64).to_le_bytes();
    let mut head = [0; RECORD_HEAD_BYTES];
    head[..8].copy_from_slice(&length);
    let hash = blake3::Hasher::new().update(&length).update(payload).finalize();
    head[8..].copy_from_slice(&hash.as_bytes()[..HASH_BYTES]);
    head
}

/// Reads the payload of one record; `None` at the end, or if it is incomplete, damaged, or longer than `bytes_max`.
///
/// # Errors
/// Reading failed.
pub fn read_record(from: &mut impl Read, bytes_max: u64) -> io::Result<Option<Vec<u8>>> {
    let mut head = [0; RECORD_HEAD_BYTES];
    match from.read_exact(&mut head) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        read => read?,
    }
    let length = u64::from_le_bytes(std::array::from_fn(|at| head[at]));
    if length > bytes_max {
        return Ok(None);
    }
    // Allocate as data arrives, not as the header claims
    let mut payload = Vec::new();
    from.take(length).read_to_end(&mut payload)?;
    let is_whole = payload.len() as u64 == length && record_head(&payload) == head;
    Ok(is_whole.then_some(payload))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(payload: &[u8]) -> Vec<u8> {
        [&record_head(payload)[..], payload].concat()
    }

    #[test]
    fn records_are_read_one_after_the_other() {
        let log = [written(b"one"), written(b""), written(b"three")].concat();
        let mut rest = &log[..];
        for expected in [&b"one"[..], b"", b"three"] {
            assert_eq!(read_record(&mut rest, 5).unwrap().as_deref(), Some(expected));
        }
        assert_eq!(read_record(&mut rest, 5).unwrap(), None);
    }

    #[test]
    fn what_is_torn_damaged_or_too_long_is_no_record() {
        let log = written(b"payload");
        for length in 0..log.len() {
            assert_eq!(read_record(&mut &log[..length], 7).unwrap(), None, "{length}");
        }
        for at in 0..log.len() {
            let mut damaged = log.clone();
            damaged[at] ^= 1;
            assert_eq!(read_record(&mut &damaged[..], 7).unwrap(), None, "{at}");
        }
        assert_eq!(read_record(&mut &log[..], 6).unwrap(), None);
        assert!(read_record(&mut &log[..], 7).unwrap().is_some());
    }
}
