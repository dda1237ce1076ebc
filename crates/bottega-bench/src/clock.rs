//! Time that the processors spend.

/// Time that the processors have spent on this process so far, in seconds; `None` where the system does not tell (only Linux
/// does). Other work on the machine disturbs it by what it leaves in caches, not by its share of the processors.
pub fn processor_seconds() -> Option<f64> {
    #[cfg(target_os = "linux")]
    {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Some(now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9)
    }
    #[cfg(not(target_os = "linux"))]
    None
}

/// Time that the processors have spent on all children that have ended and been waited for, and on theirs, in seconds; `None`
/// where the system does not tell.
pub(crate) fn children_seconds() -> Option<f64> {
    #[cfg(target_os = "linux")]
    {
        let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
        // What follows the name in brackets: cutime and cstime are fields 16 and 17 of the line, the state is the third.
        let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
        let ticks = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
        Some((ticks(16)? + ticks(17)?) / rustix::param::clock_ticks_per_second() as f64)
    }
    #[cfg(not(target_os = "linux"))]
    None
}
