//! The manual's commands, run as they stand: every block of shell in the tutorials, and those of other pages that show what is printed.
//!
//! A block ` ```sh ` must succeed, ` ```sh fails ` must fail. A block ` ```text ` behind it holds what it prints: in each line the parts
//! between `…` stand in the output, in this order. A line that begins with `bottega up` or `bottega join` stays in the background, and
//! goes on once it is ready. A block that begins with `# on the second machine` has a state of its own.

use std::{
    env, fs,
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::support::{scenes, servers, signal};

const WAIT: Duration = Duration::from_secs(180);
/// Beginnings of lines whose program stays in the background.
const BACKGROUND: [&str; 2] = ["bottega up", "bottega join"];
const SECOND: &str = "# on the second machine";

/// A block of commands.
struct Block {
    commands: String,
    must_fail: bool,
    /// Lines of what it prints.
    printed: Vec<String>,
}

/// The blocks of a page in their order.
fn blocks(page: &str) -> Vec<Block> {
    let mut all: Vec<Block> = Vec::new();
    let mut is_followed = false;
    // Outside of fences stand the even parts.
    for (number, part) in page.split("```").enumerate() {
        let (kind, inner) = part.split_once('\n').unwrap_or((part, ""));
        match (number % 2, kind) {
            (0, _) => is_followed &= part.trim().is_empty(),
            (_, "sh" | "sh fails") => {
                all.push(Block { commands: inner.to_owned(), must_fail: kind == "sh fails", printed: Vec::new() });
                is_followed = true;
            }
            (_, "text") if is_followed => {
                let last = all.last_mut().expect("a block before");
                last.printed = inner.lines().map(str::to_owned).collect();
                is_followed = false;
            }
            _ => is_followed = false,
        }
    }
    all
}

/// A folder with the scenes, and the processes that run in it.
struct Reader {
    folder: tempfile::TempDir,
    server: PathBuf,
    port: u16,
    /// The processes in the background.
    processes: Vec<Child>,
}

impl Reader {
    fn new(server: PathBuf) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        fs::create_dir(folder.path().join("scenes")).expect("a folder");
        for scene in fs::read_dir(scenes()).expect("scenes").flatten().filter(|entry| entry.path().is_file()) {
            fs::copy(scene.path(), folder.path().join("scenes").join(scene.file_name())).expect("a copy");
        }
        let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address").port();
        Self { folder, server, port, processes: Vec::new() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn said(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_default()
    }

    /// Makes a shell whose `bottega` is the tested program.
    fn shell(&self, commands: &str, is_second: bool) -> Command {
        let program = Path::new(env!("CARGO_BIN_EXE_bottega")).parent().expect("a folder").to_owned();
        let places = env::var_os("PATH").unwrap_or_default();
        let path = env::join_paths([program].into_iter().chain(env::split_paths(&places))).expect("a search path");
        let mut shell = Command::new("bash");
        shell.args(["-euo", "pipefail", "-c", commands]).current_dir(self.folder.path()).stdin(Stdio::null());
        shell.env("PATH", path).env("NO_COLOR", "1").env_remove("BOTTEGA_FARM");
        shell.env("XDG_STATE_HOME", self.path(if is_second { "second" } else { "first" }));
        // The reader has a network; this test has one machine.
        shell.env("BOTTEGA_UP_LISTEN", format!("127.0.0.1:{}", self.port)).env("BOTTEGA_UP_SERVER", &self.server);
        shell.env("BOTTEGA_UP_HIDDEN", "1").env("BOTTEGA_UP_STORE_SIZE", "1").env("BOTTEGA_JOIN_THREADS", "1");
        shell
    }

    /// Runs a block to its end, or until its background program is ready. Returns its output, and whether it succeeded.
    fn run(&mut self, block: &Block) -> (String, bool) {
        let is_second = block.commands.starts_with(SECOND);
        let stays =
            !block.must_fail && block.commands.lines().any(|line| BACKGROUND.iter().any(|it| line.starts_with(it)));
        let commands = match self.line() {
            Some(line) => block.commands.replace("bottega join bottega://WORD@10.0.0.7:4222", &line),
            None => block.commands.clone(),
        };
        // The shell becomes the program, so that a signal reaches it.
        let commands = if stays { commands.replace("bottega ", "exec bottega ") } else { commands };
        let name = format!("block-{}.log", self.processes.len());
        let log = fs::File::create(self.path(&name)).expect("a log");
        let mut shell = self.shell(&commands, is_second);
        shell.stdout(log.try_clone().expect("a log")).stderr(log);
        let mut child = shell.spawn().expect("a shell");
        let begun = Instant::now();
        loop {
            let said = self.said(&name);
            if let Some(status) = child.try_wait().expect("a child") {
                return (self.said(&name), status.success());
            }
            if stays && ["to look on only:\n\n  http", "waiting for work"].iter().any(|words| said.contains(words)) {
                self.processes.push(child);
                return (self.said(&name), true);
            }
            assert!(begun.elapsed() < WAIT, "it does not end: {commands}\n{said}");
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// The command by which a machine joins, once `bottega up` has printed it.
    fn line(&self) -> Option<String> {
        let said = self.said("block-0.log");
        said.lines().map(str::trim).find(|line| line.starts_with("bottega join bottega://")).map(str::to_owned)
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        // `up` ends its server.
        for child in self.processes.iter_mut().rev() {
            signal("-INT", child.id());
            _ = child.wait();
        }
    }
}

/// Returns the text without borders and line breaks.
fn flat(text: &str) -> String {
    text.replace(['│', '├', '╰', '─', '▶', '×'], " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Returns true if the parts of a line between `…` are in the output in this order.
fn is_printed(line: &str, output: &str) -> bool {
    let mut rest = output;
    line.split('…').map(flat).all(|part| match rest.find(&part) {
        Some(at) => {
            rest = &rest[at + part.len()..];
            true
        }
        None => false,
    })
}

/// Runs the blocks of a page.
fn follow(page: &str, needs_server: bool) {
    let server = if needs_server { servers().pop() } else { Some(PathBuf::from("nats-server")) };
    let Some(server) = server else { return };
    let path = scenes().join("../docs").join(page);
    let all = blocks(&fs::read_to_string(&path).expect("a page"));
    assert!(all.len() > 1, "{page}");
    let mut reader = Reader::new(server);
    for block in all {
        let (said, succeeded) = reader.run(&block);
        assert!(succeeded != block.must_fail, "{page}:\n{}\n{said}", block.commands);
        let flat_said = flat(&said);
        for line in &block.printed {
            assert!(is_printed(line, &flat_said), "{page}:\n{}\ndoes not print {line:?}:\n{said}", block.commands);
        }
    }
}

#[test]
fn the_first_picture_is_painted() {
    follow("tutorials/first-picture.md", false);
}

#[test]
fn two_machines_paint_one_picture() {
    follow("tutorials/two-machines.md", true);
}

#[test]
fn what_blender_exports_is_painted() {
    // Debian's Blender takes the first Python of the search path for its own.
    let exports = ["--background", "--python-exit-code", "1", "--python-expr", "import numpy"];
    if !Command::new("blender").args(exports).output().is_ok_and(|done| done.status.success()) {
        eprintln!(
            "SKIPPED: no `blender` that has NumPy; to test the tutorial: apt install --no-install-recommends blender python3-numpy"
        );
        return;
    }
    follow("tutorials/from-blender.md", false);
}

#[test]
fn rules_of_ones_own_are_written_checked_and_used() {
    follow("tutorials/own-rules.md", false);
}

#[test]
fn errors_are_printed_as_the_manual_shows_them() {
    follow("guides/trouble.md", false);
}

#[test]
fn events_are_printed_as_the_manual_shows_them() {
    follow("reference/events.md", false);
}

#[test]
fn blocks_know_whether_they_fail_and_what_they_print() {
    let all =
        blocks("a\n```sh\none\n```\n\n```text\nx … y\n```\nb\n```sh fails\ntwo\n```\nwords\n```text\nnot it\n```\n");
    let seen: Vec<_> =
        all.iter().map(|block| (block.commands.as_str(), block.must_fail, block.printed.len())).collect();
    assert_eq!(seen, [("one\n", false, 1), ("two\n", true, 0)]);
    assert!(is_printed("x … y", "a x 1 y b") && !is_printed("y … x", "a x 1 y b"));
    assert_eq!(flat("  ╰─▶ a\n   │ b"), "a b");
}
