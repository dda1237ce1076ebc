//! Time of the processors.

/// Time that the processors have spent on this process so far, in seconds; `None` where the system does not tell (only Linux
/// does). Other work on the machine disturbs it by what it leaves in caches, not by its share of the processors.
pub(crate) fn processor_seconds() -> Option<f64> {
    #[cfg(target_os = "linux")]
    {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Some(now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9)
    }
    #[cfg(not(target_os = "linux"))]
    None
}
