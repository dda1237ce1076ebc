//! Options of paths.

use std::path::PathBuf;
use std::time::Duration;

/// The options of a GPU that paints.
#[derive(Clone, Debug, PartialEq)]
pub struct PathOptions {
    /// Part of the name of the adapter that is wanted. `None`: the best GPU, never a software adapter.
    pub adapter: Option<String>,
    /// Paths under way at a time, at most; some 240 bytes each on the device. 0: as many as suit the kind of adapter.
    pub paths: u64,
    /// Work without an answer for so long counts as a lost device.
    pub timeout: Duration,
    /// Bytes that scenes may take on the device. `None`: nearly all that it has.
    pub memory: Option<u64>,
    /// A folder in which compiled kernels are kept for the next time. `None`: they are not.
    pub cache: Option<PathBuf>,
}

impl Default for PathOptions {
    fn default() -> Self {
        Self { adapter: None, paths: 0, timeout: Duration::from_secs(30), memory: None, cache: None }
    }
}
