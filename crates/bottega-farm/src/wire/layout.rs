//! Records as bytes: the layout of `postcard`, whose numbers take as many bytes as they need.

use serde::{Deserialize, Serialize};

use super::error::WireError;

/// Appends a record.
pub(super) fn put(record: &impl Serialize, bytes: &mut Vec<u8>) {
    let before = std::mem::take(bytes);
    *bytes = postcard::to_extend(record, before).expect("memory takes all, and each list knows its length");
}

/// Takes a record from the front of some bytes, and returns what follows it.
///
/// No more is allocated than the bytes can hold: texts stay where they are, and a list that announces more elements than
/// bytes are left grows element by element until these end.
pub(super) fn take<'a, R: Deserialize<'a>>(what: &'static str, bytes: &'a [u8]) -> Result<(R, &'a [u8]), WireError> {
    postcard::take_from_bytes(bytes).map_err(|source| WireError::Layout { what, source })
}

/// Reads bytes that are a record and nothing else.
pub(super) fn read<'a, R: Deserialize<'a>>(what: &'static str, bytes: &'a [u8]) -> Result<R, WireError> {
    let (record, rest) = take(what, bytes)?;
    if rest.is_empty() { Ok(record) } else { Err(WireError::Trailing { what, count: rest.len() }) }
}
