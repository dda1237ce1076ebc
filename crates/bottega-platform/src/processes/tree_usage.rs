//! The usage of a tree of processes, and the mark by which they are known.

/// The variable that marks whatever a child has started, so that it is found even when it left the group.
pub(super) const MARK: &str = "BOTTEGA_ENGINE_CHILD";

/// What a child and all that it has started take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TreeUsage {
    /// How many processes they are; 0: none is left.
    pub processes: usize,
    /// Memory that they keep, bytes.
    pub resident_bytes: u64,
}
