//! Keeps this program to some of the machine's processors.

/// Keeps this thread, and all that it starts from now on, to so many processors. Whether the system does that.
#[cfg(target_os = "linux")]
pub(super) fn keep_to(count: u16) -> bool {
    use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
    let Ok(all) = sched_getaffinity(None) else { return false };
    let mut kept = CpuSet::new();
    // The last ones: the first is where most systems handle interrupts.
    (0..CpuSet::MAX_CPU).rev().filter(|&cpu| all.is_set(cpu)).take(usize::from(count)).for_each(|cpu| kept.set(cpu));
    kept.count() == u32::from(count) && sched_setaffinity(None, &kept).is_ok()
}

/// The same, where no system call for it is known.
#[cfg(not(target_os = "linux"))]
pub(super) fn keep_to(_count: u16) -> bool {
    false
}
