//! Child processes that run other people's programs: with limits, without network and without sight of the user's files
//! where the system allows it, and so that nothing of them is left.

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

/// Of a child's log so many bytes are kept: the last ones.
const LOG_KEPT: usize = 64 << 10;
/// The longest line of an answer.
const LINE_MAX: u64 = 1 << 20;
/// How often limits are looked at.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// How often memory is looked at.
const WEIGH_EVERY: Duration = Duration::from_millis(500);
/// The most processes of one child.
const PROCESSES_MAX: usize = 1024;
/// So long a child has to leave by itself.
const GRACE: Duration = Duration::from_millis(500);
/// Whether engines open no files here but their own and those of their scene.
pub fn is_fenced_in() -> bool {
    fence::is_enforced()
}

/// The last part of what a child wrote to its log, and how much it was.
#[derive(Debug, Default)]
pub(super) struct Log {
    kept: Mutex<VecDeque<u8>>,
    bytes: AtomicU64,
    /// Nothing more will be written to it.
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

    /// Bytes written so far.
    pub(super) fn written(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// What is kept, without the signs that move a terminal's cursor.
    pub(super) fn text(&self) -> String {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes: Vec<u8> = kept.iter().copied().collect();
        let text = String::from_utf8_lossy(&bytes).replace('\r', "\n");
        text.chars().filter(|c| *c == '\n' || !c.is_control()).collect()
    }
}

/// A child at work. Dropping it ends it, and everything that it has started.
#[derive(Debug)]
pub(super) struct GuardedChild {
    child: Child,
    // Let go after the child has ended.
    _keeper: fence::ChildGuard,
    stdin: Option<ChildStdin>,
    lines: Receiver<Option<String>>,
    log: Arc<Log>,
    limits: Limits,
    tree: ProcessTree,
    weighed: Instant,
}

/// What came of looking at a child.
#[derive(Debug)]
pub(super) enum ChildOutput {
    /// A line on its standard output.
    Line(String),
    /// It said nothing for a moment.
    Silence,
    /// It has closed its standard output.
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

    /// Where requests are written.
    pub(super) fn stdin(&mut self) -> Option<&mut ChildStdin> {
        self.stdin.as_mut()
    }

    /// Nothing more will be written to it.
    pub(super) fn close_stdin(&mut self) {
        self.stdin = None;
    }

    pub(super) fn log(&self) -> &Log {
        &self.log
    }

    /// What it says next, or that it says nothing; looks at its limits meanwhile.
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

    /// How it ended, if it has; waits a moment for one that is about to.
    pub(super) fn ended(&mut self) -> Option<String> {
        let until = Instant::now() + GRACE;
        loop {
            match self.child.try_wait() {
                // What it said last may still be on its way.
                Ok(Some(_)) if Instant::now() < until && !self.log.is_whole.load(Ordering::Acquire) => {
                    thread::sleep(Duration::from_millis(5));
                }
                Ok(Some(status)) => return Some(processes::told(status)),
                Ok(None) if Instant::now() < until => thread::sleep(Duration::from_millis(5)),
                _ => return None,
            }
        }
    }

    /// Whether it has ended well, if it has ended.
    pub(super) fn outcome(&mut self) -> Option<bool> {
        self.child.try_wait().ok().flatten().map(|status| status.success())
    }

    fn end(&mut self) {
        self.stdin = None;
        if self.child.try_wait().is_ok_and(|status| status.is_none()) {
            // A worker leaves when nobody has anything to say to it any more. Whoever ignores that is ended.
            let until = Instant::now() + GRACE;
            while Instant::now() < until && self.child.try_wait().is_ok_and(|status| status.is_none()) {
                thread::sleep(Duration::from_millis(5));
            }
        }
        self.kill();
    }

    /// Ends it and all that it has started, at once.
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
    // What is installed for the user alone is found, while its settings are not: an engine paints the same everywhere.
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

/// Lines of standard output. `None`: one is too long, and no more is read.
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
            // What is no answer belongs to the log.
            log.take_in(format!("{line}\n").as_bytes());
        }
        if to.send(Some(line)).is_err() {
            return;
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests;
