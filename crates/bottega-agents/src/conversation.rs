//! Numbers of conversations: those of foreign agents, which name them by text, have bits of their own.

/// Bit set in numbers of foreign conversations, and in no others.
pub(crate) const STRANGE: u64 = 1 << 63;
/// Bit set in those without a conversation name.
pub(crate) const NAMELESS: u64 = 1 << 62;

/// Returns true if a conversation has a name; without one, equal messages may be different.
pub(crate) fn has_name(conversation: u64) -> bool {
    conversation != 0 && conversation & (STRANGE | NAMELESS) != (STRANGE | NAMELESS)
}
