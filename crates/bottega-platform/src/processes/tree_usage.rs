//! The usage of a process tree, and the mark of its processes.

/// The environment variable that marks all descendants of a child, to find them even if they leave the group.
pub(super) const MARK: &str = "BOTTEGA_ENGINE_CHILD";

/// The usage of a child process and its descendants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TreeUsage {
    /// Number of processes; 0: all have ended.
    pub processes: usize,
    /// Resident memory, in bytes.
    pub resident_bytes: u64,
}
