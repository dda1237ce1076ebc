//! A child and all that it has started: what they take, and their end.
//!
//! On Linux and macOS they are a process group; on Windows a job object, which ends with its last handle. Whoever leaves the group
//! is found by a mark in the environment (Linux, macOS).

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

/// A child and all that it has started.
#[derive(Debug)]
pub struct ProcessTree {
    root: u32,
    mark: String,
    #[cfg(windows)]
    job: std::sync::Mutex<Option<win32job::Job>>,
}

/// Has a program that is to be started begin a tree of its own.
///
/// - `mark`: stands in the environment of all of them; of no other tree.
pub fn prepare(command: &mut Command, mark: &str) {
    command.env(MARK, mark);
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
}

impl ProcessTree {
    /// The tree of a child that was [`prepare`]d with this mark.
    ///
    /// # Errors
    /// The system does not keep it together.
    pub fn of(child: &Child, mark: &str) -> io::Result<Self> {
        Ok(Self {
            root: child.id(),
            mark: mark.to_owned(),
            #[cfg(windows)]
            job: std::sync::Mutex::new(Some(job_of(child)?)),
        })
    }

    /// What they take now.
    pub fn usage(&self) -> TreeUsage {
        usage(self.root)
    }

    /// Ends all of them, at once.
    pub fn kill(&self) {
        let strays = marked(&self.mark);
        #[cfg(unix)]
        if let Some(group) = i32::try_from(self.root).ok().and_then(rustix::process::Pid::from_raw) {
            let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
        }
        // Its last handle ends it.
        #[cfg(windows)]
        drop(self.job.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take());
        strays.into_iter().for_each(|id| _ = kill(id));
        // Who forked meanwhile.
        marked(&self.mark).into_iter().for_each(|id| _ = kill(id));
    }
}

/// A job object of a child, in which is what the child starts.
#[cfg(windows)]
fn job_of(child: &Child) -> io::Result<win32job::Job> {
    use std::os::windows::io::AsRawHandle;
    let mut limits = win32job::ExtendedLimitInfo::new();
    limits.limit_kill_on_job_close();
    let job = win32job::Job::create_with_limit_info(&limits).map_err(io::Error::other)?;
    job.assign_process(child.as_raw_handle() as isize).map_err(io::Error::other)?;
    Ok(job)
}

/// Has a service read its settings again, by `SIGHUP`. Whether it was told so: Windows has no such word.
pub fn tell_to_reread(process: u32) -> bool {
    #[cfg(unix)]
    return signal(process, rustix::process::Signal::HUP);
    #[cfg(not(unix))]
    {
        _ = process;
        false
    }
}

/// Has a process end, in order where the system knows such a word. Whether it was told so.
pub fn end(process: u32) -> bool {
    #[cfg(unix)]
    return signal(process, rustix::process::Signal::TERM);
    #[cfg(not(unix))]
    kill(process)
}

/// How a process ended, in words.
pub fn told(status: ExitStatus) -> String {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt;
        // A shell tells of a signal by 128 and its number.
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
        // What Windows calls exceptions has numbers above all that programs choose.
        Some(code) if code < 0 => format!("exit code {:#010x}", code as u32),
        Some(code) => format!("exit code {code}"),
        None => "no exit code".to_owned(),
    }
}
