//! Signals to a process.

/// Sends a signal to the process with this id. Returns `true` if it existed and this was allowed.
pub(super) fn signal(process: u32, signal: rustix::process::Signal) -> bool {
    let id = i32::try_from(process).ok().and_then(rustix::process::Pid::from_raw);
    id.is_some_and(|id| rustix::process::kill_process(id, signal).is_ok())
}
