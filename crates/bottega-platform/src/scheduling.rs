//! The priority of this process, and the processors that it may use.

use std::io;

/// Lowers the priority of this process by this many steps of `nice`; affects threads started later. Windows has two levels:
/// below normal, and idle from 10 steps on.
///
/// # Errors
/// The system refuses the change.
#[cfg(unix)]
pub fn step_back(steps: u8) -> io::Result<()> {
    rustix::process::nice(steps.into()).map(|_| ()).map_err(Into::into)
}

/// Lowers the priority of this process: to below normal, or to idle from 10 steps of `nice` on.
///
/// # Errors
/// The system refuses the change.
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
    // SAFETY: the pseudo-handle of this process is always valid and need not be closed; the class is one of the defined ones.
    let is_done = unsafe { SetPriorityClass(GetCurrentProcess(), class) } != 0;
    if is_done { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Restricts this thread, and all that it starts later, to this many processors. Returns `true` if that succeeded: only on
/// Linux, and only if this thread may use that many.
pub fn keep_to(count: u16) -> bool {
    #[cfg(target_os = "linux")]
    {
        use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
        let Ok(all) = sched_getaffinity(None) else { return false };
        let mut kept = CpuSet::new();
        // Take the last ones, because most systems handle interrupts on the first.
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
