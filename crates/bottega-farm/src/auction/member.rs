//! The id of an agent in the auction.

/// An agent's index in its Master's list; never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MemberId(pub u32);

impl MemberId {
    /// The lowest id.
    pub(super) const FIRST: Self = Self(0);

    /// Returns the id as an index into the list.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}
