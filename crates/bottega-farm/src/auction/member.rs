//! A participant of the auction.

/// An agent's number on the list of its Master, which it keeps for good.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MemberId(pub u32);

impl MemberId {
    pub(super) const FIRST: Self = Self(0);

    /// As an index into the list.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}
