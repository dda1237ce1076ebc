//! Text of files in messages.

use std::borrow::Cow;

/// Text of a file in a message: not too long, and no control characters.
pub(crate) fn shortened(text: &str) -> Cow<'_, str> {
    const LENGTH: usize = 80;
    if text.len() <= LENGTH && !text.contains(char::is_control) {
        return Cow::Borrowed(text);
    }
    let start: String = text.chars().take(LENGTH).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if start.len() < text.len() { Cow::Owned(start + "…") } else { Cow::Owned(start) }
}
