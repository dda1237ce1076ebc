//! Serialization of records in the layout of `postcard`, with integers of variable length.

use serde::{Deserialize, Serialize};

use super::error::WireError;

/// Appends a record.
pub(super) fn put(record: &impl Serialize, bytes: &mut Vec<u8>) {
    let before = std::mem::take(bytes);
    *bytes = postcard::to_extend(record, before).expect("memory takes all, and each list knows its length");
}

/// Reads a record from the front of `bytes`. Returns it and the remaining bytes.
///
/// Allocation is bounded by the input: texts are borrowed, and a list that claims more elements than there are bytes
/// grows element by element until these end.
pub(super) fn take<'a, R: Deserialize<'a>>(what: &'static str, bytes: &'a [u8]) -> Result<(R, &'a [u8]), WireError> {
    postcard::take_from_bytes(bytes).map_err(|source| WireError::Layout { what, source })
}

/// Reads a record that fills `bytes` completely.
pub(super) fn read<'a, R: Deserialize<'a>>(what: &'static str, bytes: &'a [u8]) -> Result<R, WireError> {
    let (record, rest) = take(what, bytes)?;
    if rest.is_empty() { Ok(record) } else { Err(WireError::Trailing { what, count: rest.len() }) }
}
