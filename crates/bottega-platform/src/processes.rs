//! A child process and its descendants: their usage, and their termination.
//!
//! On Linux and macOS they form a process group; on Windows a job object, which ends with its last handle. Processes that leave
//! the group are found by a mark in their environment (Linux, macOS).

#[cfg(target_os = "linux")]
mod linux;
#[cfg(not(target_os = "linux"))]
mod listed;
#[cfg(unix)]
mod signals;
mod tree_usage;

use std::{
    io,
    process::{Child, Command, ExitStatus},
};

#[cfg(target_os = "linux")]
pub use linux::{kill, marked, usage};
#[cfg(not(target_os = "linux"))]
pub use listed::{kill, marked, usage};
#[cfg(unix)]
use signals::signal;
use tree_usage::MARK;
pub use tree_usage::TreeUsage;

/// A child process and its descendants.
#[derive(Debug)]
pub struct ProcessTree {
    root: u32,
    mark: String,
    #[cfg(windows)]
    job: std::sync::Mutex<Option<win32job::Job>>,
}

/// Prepares a command so that its process starts a tree of its own.
///
/// - `mark`: a unique value, stored in the environment of all processes of the tree.
pub fn prepare(command: &mut Command, mark: &str) {
    command.env(MARK, mark);
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
}

impl ProcessTree {
    /// Returns the tree of a child that was [`prepare`]d with this mark.
    ///
    /// # Errors
    /// The system cannot group the processes.
    pub fn of(child: &Child, mark: &str) -> io::Result<Self> {
        Ok(Self {
            root: child.id(),
            mark: mark.to_owned(),
            #[cfg(windows)]
            job: std::sync::Mutex::new(Some(job_of(child)?)),
        })
    }

    /// Returns the current usage of the tree.
    pub fn usage(&self) -> TreeUsage {
        usage(self.root)
    }

    /// Kills all processes of the tree.
    pub fn kill(&self) {
        let strays = marked(&self.mark);
        #[cfg(unix)]
        if let Some(group) = i32::try_from(self.root).ok().and_then(rustix::process::Pid::from_raw) {
            let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
        }
        // Closing the last handle ends the job.
        #[cfg(windows)]
        drop(self.job.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take());
        strays.into_iter().for_each(|id| _ = kill(id));
        // Processes that were forked meanwhile.
        marked(&self.mark).into_iter().for_each(|id| _ = kill(id));
    }
}

/// Creates a job object with the child; processes that the child starts belong to it.
#[cfg(windows)]
fn job_of(child: &Child) -> io::Result<win32job::Job> {
    use std::os::windows::io::AsRawHandle;
    let mut limits = win32job::ExtendedLimitInfo::new();
    limits.limit_kill_on_job_close();
    let job = win32job::Job::create_with_limit_info(&limits).map_err(io::Error::other)?;
    job.assign_process(child.as_raw_handle() as isize).map_err(io::Error::other)?;
    Ok(job)
}

/// Makes a service reload its settings, by `SIGHUP`. Returns `true` if the signal was sent; always `false` on Windows, which has
/// no such signal.
///
/// - `process`: the process id of the service.
pub fn tell_to_reread(process: u32) -> bool {
    #[cfg(unix)]
    return signal(process, rustix::process::Signal::HUP);
    #[cfg(not(unix))]
    {
        _ = process;
        false
    }
}

/// Ends the process with this id: requests it to end by `SIGTERM`, or kills it on Windows, which has no signals. Returns `true`
/// if the process existed and this was allowed.
pub fn end(process: u32) -> bool {
    #[cfg(unix)]
    return signal(process, rustix::process::Signal::TERM);
    #[cfg(not(unix))]
    kill(process)
}

/// Returns the end of a process as text: `signal 11 (segmentation fault)`, also for a shell that reports the signal of its
/// program, or `exit code 1`.
pub fn describe_exit(status: ExitStatus) -> String {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt;
        // A shell reports a signal as 128 plus its number.
        let signal = status.signal().or(status.code().filter(|code| (129..=159).contains(code)).map(|code| code - 128));
        if let Some(signal) = signal {
            let name = match signal {
                4 => " (illegal instruction)",
                6 => " (aborted)",
                7 => " (bus error)",
                8 => " (arithmetic)",
                9 => " (killed; out of memory?)",
                11 => " (segmentation fault)",
                15 => " (terminated)",
                24 => " (processor time)",
                25 => " (file too large)",
                _ => "",
            };
            return format!("signal {signal}{name}");
        }
    }
    match status.code() {
        // Windows exceptions have negative codes.
        Some(code) if code < 0 => format!("exit code {:#010x}", code as u32),
        Some(code) => format!("exit code {code}"),
        None => "no exit code".to_owned(),
    }
}
