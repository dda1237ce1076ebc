//! Text of files in messages.

use std::borrow::Cow;

/// The column of a part of a line, counted from 1 in characters. A part that is not of this line counts as its start.
pub(crate) fn column(line: &[u8], part: &[u8]) -> usize {
    let before = part.as_ptr().addr().checked_sub(line.as_ptr().addr()).and_then(|length| line.get(..length));
    1 + before.map_or(0, |before| String::from_utf8_lossy(before).chars().count())
}

/// Text of a file in a message: not too long, and no control characters.
pub(crate) fn shortened(text: &str) -> Cow<'_, str> {
    const LENGTH: usize = 80;
    if text.len() <= LENGTH && !text.contains(char::is_control) {
        return Cow::Borrowed(text);
    }
    let start: String = text.chars().take(LENGTH).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if start.len() < text.len() { Cow::Owned(start + "…") } else { Cow::Owned(start) }
}
