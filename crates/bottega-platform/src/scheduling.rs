//! Scheduling of this process: its priority, and the processors that it may use.

use std::io;

/// Has this process, from its next threads on, go behind others by so many steps of `nice`. Windows knows two levels: below
/// normal, from 10 steps on idle.
///
/// # Errors
/// The system does not do it.
#[cfg(unix)]
pub fn step_back(steps: u8) -> io::Result<()> {
    rustix::process::nice(steps.into()).map(|_| ()).map_err(Into::into)
}

/// Has this process go behind others: below normal, from 10 steps of `nice` on idle.
///
/// # Errors
/// The system does not do it.
#[cfg(windows)]
#[allow(unsafe_code, reason = "two calls of the system that no library wraps")]
pub fn step_back(steps: u8) -> io::Result<()> {
    use windows_sys::Win32::System::Threading::{
        BELOW_NORMAL_PRIORITY_CLASS, GetCurrentProcess, IDLE_PRIORITY_CLASS, SetPriorityClass,
    };
    let class = match steps {
        0 => return Ok(()),
        1..10 => BELOW_NORMAL_PRIORITY_CLASS,
        _ => IDLE_PRIORITY_CLASS,
    };
    // SAFETY: the handle of this process is always there and is not closed; the class is one of those that there are.
    let is_done = unsafe { SetPriorityClass(GetCurrentProcess(), class) } != 0;
    if is_done { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Keeps this thread, and all that it starts from now on, to so many processors. Whether the system does that: only Linux.
pub fn keep_to(count: u16) -> bool {
    #[cfg(target_os = "linux")]
    {
        use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
        let Ok(all) = sched_getaffinity(None) else { return false };
        let mut kept = CpuSet::new();
        // The last ones: the first is where most systems handle interrupts.
        let processors = (0..CpuSet::MAX_CPU).rev().filter(|&cpu| all.is_set(cpu));
        processors.take(usize::from(count)).for_each(|cpu| kept.set(cpu));
        kept.count() == u32::from(count) && sched_setaffinity(None, &kept).is_ok()
    }
    #[cfg(not(target_os = "linux"))]
    {
        _ = count;
        false
    }
}
