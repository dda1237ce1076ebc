//! The program as a user runs it.

mod servers;

use std::{
    env,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Command, ExitStatus, Output, Stdio},
};

pub(crate) use self::servers::servers;

/// The program, in the folder of the scenes.
pub(crate) fn bottega(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bottega"));
    // Experience learnt here does not mix with that of this machine.
    let state = Path::new(env!("CARGO_TARGET_TMPDIR")).join("state");
    command.args(arguments).current_dir(scenes()).env("XDG_STATE_HOME", state);
    command
}

/// Runs the program to its end.
pub(crate) fn run(arguments: &[&str]) -> Output {
    bottega(arguments).output().expect("the program starts")
}

/// Runs the program, which must succeed.
pub(crate) fn succeed(arguments: &[&str]) -> String {
    let output = run(arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?} failed: {stderr}");
    String::from_utf8(output.stdout).expect("text")
}

/// Starts a long picture, stops it when some of it is painted, and returns its exit status.
#[cfg(unix)]
pub(crate) fn interrupt(arguments: &[&str]) -> ExitStatus {
    let mut child = bottega(arguments).arg("--json").stdout(Stdio::piped()).spawn().expect("the program starts");
    let lines = BufReader::new(child.stdout.take().expect("piped")).lines();
    let mut stopped = false;
    for line in lines.map_while(Result::ok) {
        if !stopped && line.contains(r#""state":"done""#) {
            assert!(signal("-INT", child.id()));
            stopped = true;
        }
    }
    child.wait().expect("the program ends")
}

/// Sends a signal to a process, by the shell's own `kill`: not every system has a program of that name. Returns true if it arrived.
///
/// - `what`: such as `-INT`.
#[cfg(unix)]
pub(crate) fn signal(what: &str, process: u32) -> bool {
    let line = format!("kill {what} {process}");
    Command::new("sh").args(["-c", &line]).stderr(Stdio::null()).status().expect("a shell").success()
}

/// The scenes of the repository.
pub(crate) fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes")
}

/// A path as an argument.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("a path in Unicode")
}

/// An example of the workspace, which is built where all of the workspace is tested.
pub(crate) fn example(name: &str) -> Command {
    let program = Path::new(env!("CARGO_BIN_EXE_bottega")).with_file_name("examples").join(name);
    let program = program.with_extension(env::consts::EXE_EXTENSION);
    assert!(program.is_file(), "{} is not built: run the tests with --workspace", program.display());
    let mut command = Command::new(program);
    command.current_dir(scenes());
    command
}
