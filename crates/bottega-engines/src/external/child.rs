//! Child processes for external programs: with limits, where the system supports it without network or access to the user's
//! files, and fully cleaned up.

mod fence;
mod guard;
mod program;

use std::{
    collections::VecDeque,
    ffi::OsStr,
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Child, ChildStdin, Command, Stdio},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{self, Receiver, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

use bottega_platform::processes::{self, ProcessTree};

pub use self::guard::is_shut_in;
pub(super) use self::program::Program;
use self::{
    fence::Fence,
    program::{PASSED_ON, USER_BASE},
};
use super::{error::EngineFault, manifest::Limits};

/// The most bytes kept of a child's log, from its end.
const LOG_KEPT: usize = 64 << 10;
/// The longest line of an answer, in bytes.
const LINE_MAX: u64 = 1 << 20;
/// Interval between checks of the limits.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Interval between checks of the memory use.
const WEIGH_EVERY: Duration = Duration::from_millis(500);
/// The most processes of one child.
const PROCESSES_MAX: usize = 1024;
/// The time in which a child must exit by itself.
const GRACE: Duration = Duration::from_millis(500);
/// Returns `true` if the kernel of this machine (Linux with Landlock) keeps engines from opening other files than the
/// system's, their own and those of their scene.
pub fn is_fenced_in() -> bool {
    fence::is_enforced()
}

/// The end of a child's log, and its total size.
#[derive(Debug, Default)]
pub(super) struct Log {
    kept: Mutex<VecDeque<u8>>,
    bytes: AtomicU64,
    /// True once the log is complete.
    is_whole: AtomicBool,
}

impl Log {
    fn take_in(&self, bytes: &[u8]) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.extend(bytes);
        let excess = kept.len().saturating_sub(LOG_KEPT);
        kept.drain(..excess);
        self.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
    }

    /// Returns the bytes written so far.
    pub(super) fn written(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Returns the kept text without control characters.
    pub(super) fn text(&self) -> String {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes: Vec<u8> = kept.iter().copied().collect();
        let text = String::from_utf8_lossy(&bytes).replace('\r', "\n");
        text.chars().filter(|c| *c == '\n' || !c.is_control()).collect()
    }
}

/// A running child. Dropping it ends it, and all processes that it has started.
#[derive(Debug)]
pub(super) struct GuardedChild {
    child: Child,
    // Dropped after the child has ended.
    _keeper: fence::ChildGuard,
    stdin: Option<ChildStdin>,
    lines: Receiver<Option<String>>,
    log: Arc<Log>,
    limits: Limits,
    tree: ProcessTree,
    weighed: Instant,
}

/// The result of listening to a child.
#[derive(Debug)]
pub(super) enum ChildOutput {
    /// A line on its standard output.
    Line(String),
    /// No output for a moment.
    Silence,
    /// The child has closed its standard output.
    End,
}

impl GuardedChild {
    /// Starts a program in its scratch folder, in a process group of its own.
    pub(super) fn spawn(program: &Program<'_>) -> Result<Self, EngineFault> {
        let mark = mark();
        let mut line = guard::wrapper(&program.limits);
        line.extend(program.line.iter().cloned());
        let start = |source| EngineFault::Start { program: program.line[0].clone(), source };
        let mut command = Command::new(&line[0]);
        command
            .args(&line[1..])
            .current_dir(program.scratch)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        set_environment(&mut command, program);
        processes::prepare(&mut command, &mark);
        let (mut child, keeper) = fence::spawn(command, Fence::of(program)).map_err(start)?;
        let tree = ProcessTree::of(&child, &mark).map_err(start)?;
        let log = Arc::new(Log::default());
        let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        if let Some(stderr) = stderr {
            let log = Arc::clone(&log);
            thread::Builder::new()
                .name("engine log".to_owned())
                .spawn(move || read_log(stderr, &log))
                .map_err(start)?;
        }
        let (sender, lines) = mpsc::sync_channel(64);
        if let Some(stdout) = stdout {
            let log = Arc::clone(&log);
            let read = move || read_lines(stdout, &sender, &log);
            thread::Builder::new().name("engine answers".to_owned()).spawn(read).map_err(start)?;
        }
        Ok(Self { child, _keeper: keeper, stdin, lines, log, limits: program.limits, tree, weighed: Instant::now() })
    }

    /// Returns the child's standard input, for requests.
    pub(super) fn stdin(&mut self) -> Option<&mut ChildStdin> {
        self.stdin.as_mut()
    }

    /// Closes the child's standard input.
    pub(super) fn close_stdin(&mut self) {
        self.stdin = None;
    }

    /// Returns the child's log.
    pub(super) fn log(&self) -> &Log {
        &self.log
    }

    /// Waits a moment for the child's next output, and checks its limits.
    pub(super) fn listen(&mut self) -> Result<ChildOutput, EngineFault> {
        let word = match self.lines.recv_timeout(LOOK_EVERY) {
            Ok(Some(line)) => ChildOutput::Line(line),
            Ok(None) => return Err(EngineFault::Flood { kib: LINE_MAX >> 10, what: "one line" }),
            Err(RecvTimeoutError::Timeout) => ChildOutput::Silence,
            Err(RecvTimeoutError::Disconnected) => ChildOutput::End,
        };
        self.check_limits()?;
        Ok(word)
    }

    fn check_limits(&mut self) -> Result<(), EngineFault> {
        let Limits { log_kib, memory_mib, .. } = self.limits;
        if log_kib > 0 && self.log.written() > log_kib << 10 {
            return Err(EngineFault::Flood { kib: log_kib, what: "its log" });
        }
        if self.weighed.elapsed() < WEIGH_EVERY {
            return Ok(());
        }
        self.weighed = Instant::now();
        let usage = self.tree.usage();
        if memory_mib > 0 && usage.resident_bytes > memory_mib << 20 {
            return Err(EngineFault::Memory { mib: memory_mib });
        }
        if usage.processes > PROCESSES_MAX {
            return Err(EngineFault::Processes { most: PROCESSES_MAX });
        }
        Ok(())
    }

    /// Returns the child's exit status, if it has ended; waits a moment for a child that is about to.
    pub(super) fn ended(&mut self) -> Option<String> {
        let until = Instant::now() + GRACE;
        loop {
            match self.child.try_wait() {
                // Its last output may still be in the pipe.
                Ok(Some(_)) if Instant::now() < until && !self.log.is_whole.load(Ordering::Acquire) => {
                    thread::sleep(Duration::from_millis(5));
                }
                Ok(Some(status)) => return Some(processes::describe_exit(status)),
                Ok(None) if Instant::now() < until => thread::sleep(Duration::from_millis(5)),
                _ => return None,
            }
        }
    }

    /// Returns `true` if the child has ended successfully; `None`: it is running.
    pub(super) fn outcome(&mut self) -> Option<bool> {
        self.child.try_wait().ok().flatten().map(|status| status.success())
    }

    fn end(&mut self) {
        self.stdin = None;
        if self.child.try_wait().is_ok_and(|status| status.is_none()) {
            // A worker exits when its input is closed. Kill it if it does not.
            let until = Instant::now() + GRACE;
            while Instant::now() < until && self.child.try_wait().is_ok_and(|status| status.is_none()) {
                thread::sleep(Duration::from_millis(5));
            }
        }
        self.kill();
    }

    /// Kills the child and all that it has started.
    pub(super) fn kill(&mut self) {
        self.stdin = None;
        self.tree.kill();
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for GuardedChild {
    fn drop(&mut self) {
        self.end();
    }
}

fn mark() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    format!("{}-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed), since.as_nanos())
}

fn set_environment(command: &mut Command, program: &Program<'_>) {
    command.env_clear();
    let passed = PASSED_ON.iter().copied().chain(program.inherit.iter().map(String::as_str));
    for name in passed {
        if let Some(value) = std::env::var_os(name) {
            command.env(name, value);
        }
    }
    // Packages installed for the user are found, but not the user's settings: an engine must render the same everywhere.
    if let Some(home) = std::env::var_os("HOME") {
        command.env("PYTHONUSERBASE", Path::new(&home).join(USER_BASE));
    }
    let scratch: &OsStr = program.scratch.as_os_str();
    for name in ["HOME", "TMPDIR", "TMP", "TEMP", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_RUNTIME_DIR"] {
        command.env(name, scratch);
    }
    command.env("LANG", "C.UTF-8").env("LC_ALL", "C.UTF-8").env("PYTHONDONTWRITEBYTECODE", "1");
    command.envs(program.environment);
}

fn read_log(mut from: impl Read, log: &Log) {
    let mut buffer = [0; 8192];
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        log.take_in(&buffer[..count]);
    }
    log.is_whole.store(true, Ordering::Release);
}

/// Reads lines of standard output. Sends `None` and stops if a line is too long.
fn read_lines(from: impl Read, to: &mpsc::SyncSender<Option<String>>, log: &Log) {
    let mut from = BufReader::new(from);
    loop {
        let mut line = Vec::new();
        match from.by_ref().take(LINE_MAX).read_until(b'\n', &mut line) {
            Err(_) | Ok(0) => return,
            Ok(count) if count as u64 == LINE_MAX && line.last() != Some(&b'\n') => {
                let _ = to.send(None);
                return;
            }
            Ok(_) => {}
        }
        let line = String::from_utf8_lossy(&line).trim_end().to_owned();
        if !line.starts_with('{') {
            // Output other than answers belongs to the log.
            log.take_in(format!("{line}\n").as_bytes());
        }
        if to.send(Some(line)).is_err() {
            return;
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests;
