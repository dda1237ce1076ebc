//! Configuration of the allocator.

use std::time::Duration;

/// Configuration of the allocator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HraConfig {
    /// Maximum number of units in the work bin; submitters wait beyond it. At least 1.
    pub bin_capacity: usize,
    /// Minimum capacity of the bin, at most `bin_capacity`.
    pub bin_min: usize,
    /// Target waiting time of a unit in the bin. Between its bounds, the bin's capacity is the number of units done in
    /// that time (Little's law): more gives the allocator more choice, less makes cancellation and changes take effect
    /// sooner.
    pub bin_delay: Duration,
    /// Maximum number of attempts at a unit before it is answered as failed; at least 1.
    pub max_attempts: u32,
    /// Upper bound of every unit's maximum delay.
    pub max_delay_bound: Duration,
    /// Suspension of a resource after a first failure; doubles with each further consecutive one.
    pub pause_min: Duration,
    /// Maximum suspension of a resource.
    pub pause_max: Duration,
    /// Number of consecutive failures after which a resource is given up.
    pub max_failures: u32,
    /// A resource hangs when it takes this many times the expected time plus its uncertainty; at least 1.
    pub hang_factor: f64,
    /// Minimum time before a resource counts as hanging.
    pub hang_min: Duration,
    /// Time after which a directly called resource counts as hanging, whatever its expected time. For far ones see
    /// [`Window::patience`](crate::Window::patience).
    pub hang_max: Duration,
    /// Maximum number of activity spans kept per resource, for [`timeline_svg`](crate::timeline_svg); 0: none.
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
