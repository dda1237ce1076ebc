//! Bounds of the allocator.

use std::time::Duration;

/// Bounds of the allocator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HraConfig {
    /// Most units that the work bin holds; submitters wait beyond it. At least 1.
    pub bin_capacity: usize,
    /// Least units that it takes, at most `bin_capacity`.
    pub bin_min: usize,
    /// How long a unit should wait in the bin. Between its bounds the bin takes as many units as are done in that time
    /// (Little's law): more gives the allocator more to choose from, less makes a change of mind take effect sooner.
    pub bin_delay: Duration,
    /// How often a unit is tried before it is answered as failed; at least 1.
    pub max_attempts: u32,
    /// Upper bound of every unit's maximum delay.
    pub max_delay_bound: Duration,
    /// Pause of a resource after its first failure in a row; doubles with each further one.
    pub pause_min: Duration,
    /// Longest pause of a resource.
    pub pause_max: Duration,
    /// A resource with so many failures in a row is given up.
    pub max_failures: u32,
    /// A resource hangs when it takes so many times what its cost model expects, its uncertainty on top; at least 1.
    pub hang_factor: f64,
    /// No resource hangs before so much time has passed.
    pub hang_min: Duration,
    /// A resource that is called directly hangs after so much time, whatever is expected. For far ones see
    /// [`Window::patience`](crate::Window::patience).
    pub hang_max: Duration,
    /// Spans of activity that are kept for each resource, for [`timeline_svg`](crate::timeline_svg); 0: none.
    pub spans_kept: usize,
}

impl Default for HraConfig {
    fn default() -> Self {
        Self {
            bin_capacity: 1 << 16,
            bin_min: 64,
            bin_delay: Duration::from_millis(50),
            max_attempts: 3,
            max_delay_bound: Duration::from_secs(60),
            pause_min: Duration::from_millis(10),
            pause_max: Duration::from_secs(5),
            max_failures: 12,
            hang_factor: 10.0,
            hang_min: Duration::from_secs(2),
            hang_max: Duration::from_secs(120),
            spans_kept: 0,
        }
    }
}
