//! Options of [`GpuPaths`](crate::GpuPaths).

use std::path::PathBuf;
use std::time::Duration;

/// Options of a GPU that renders.
#[derive(Clone, Debug, PartialEq)]
pub struct PathOptions {
    /// Part of the name of the adapter to use. `None`: the best GPU, never a software adapter.
    pub adapter: Option<String>,
    /// The maximum number of paths under way, about 240 bytes each on the device. 0: a default for the kind of adapter.
    pub paths: u64,
    /// The timeout of work; after it the device counts as lost.
    pub timeout: Duration,
    /// The maximum size of scenes on the device, in bytes. `None`: nearly all of its memory.
    pub memory: Option<u64>,
    /// The folder that keeps compiled kernels for the next run. `None`: they are not kept.
    pub cache: Option<PathBuf>,
}

impl Default for PathOptions {
    fn default() -> Self {
        Self { adapter: None, paths: 0, timeout: Duration::from_secs(30), memory: None, cache: None }
    }
}
