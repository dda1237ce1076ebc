//! Values in rows and messages, with the checks that `postcard` does not make.

use std::time::Duration;

use bottega_agents::AgentId;
use bottega_image::{Rect, Sides};

use super::error::WireError;

/// Maximum length of an agent's name, in bytes.
const NAME_BYTES_MAX: usize = 1 << 10;
/// Maximum length of a reason, in bytes. Longer ones are cut when written.
const REASON_BYTES_MAX: usize = 1 << 10;
/// Maximum number of offers, bids, orders or votes in a list.
pub(super) const LIST_MAX: usize = 1 << 16;

/// A rectangle: x0, y0, x1, y1.
pub(super) type RectRecord = [u32; 4];

pub(super) fn rect_record(rect: &Rect) -> RectRecord {
    [rect.x0, rect.y0, rect.x1, rect.y1]
}

pub(super) fn rect(record: RectRecord) -> Result<Rect, WireError> {
    let [x0, y0, x1, y1] = record;
    if x0 <= x1 && y0 <= y1 { Ok(Rect { x0, y0, x1, y1 }) } else { Err(WireError::Rectangle(record)) }
}

/// Values by side: left, top, right, bottom.
pub(super) fn sides<T>([left, top, right, bottom]: [T; 4]) -> Sides<T> {
    Sides { left, top, right, bottom }
}

/// Returns a duration in nanoseconds; about five centuries at most.
pub(super) fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// Checks that a number is finite.
pub(super) fn finite(what: &'static str, value: f64) -> Result<f64, WireError> {
    if value.is_finite() { Ok(value) } else { Err(WireError::NotFinite { what, value }) }
}

/// Returns an agent's name, cut to its maximum length.
pub(super) fn name(agent: &AgentId) -> &str {
    beginning(&agent.name, NAME_BYTES_MAX)
}

pub(super) fn agent(name: &str) -> Result<AgentId, WireError> {
    bounded("the name of an agent", name.len(), NAME_BYTES_MAX).map(|()| AgentId::new(name))
}

/// Returns a reason, cut to its maximum length.
pub(super) fn short_reason(reason: &str) -> &str {
    beginning(reason, REASON_BYTES_MAX)
}

pub(super) fn reason(reason: &str) -> Result<String, WireError> {
    bounded("a reason", reason.len(), REASON_BYTES_MAX).map(|()| reason.to_owned())
}

/// Converts a list of records; fails if one of them is invalid.
pub(super) fn list<R, T, C: FromIterator<T>>(
    what: &'static str,
    records: Vec<R>,
    read: impl FnMut(R) -> Result<T, WireError>,
) -> Result<C, WireError> {
    bounded(what, records.len(), LIST_MAX)?;
    records.into_iter().map(read).collect()
}

/// Checks that a length is at most `max`.
pub(super) fn bounded(what: &'static str, length: usize, max: usize) -> Result<(), WireError> {
    if length <= max { Ok(()) } else { Err(WireError::TooLong { what, length, max }) }
}

fn beginning(text: &str, bytes_max: usize) -> &str {
    &text[..text.floor_char_boundary(bytes_max)]
}
