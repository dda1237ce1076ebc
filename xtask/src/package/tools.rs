//! Tools that make packages.

use std::{
    path::Path,
    process::{Command, Stdio},
};

use anyhow::{Context, Result, ensure};

use crate::bars::root;

/// The version of the program.
pub(super) const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Runs a tool; fails if the tool fails.
pub(super) fn call(command: &mut Command) -> Result<()> {
    let name = command.get_program().to_string_lossy().into_owned();
    let status = command.stdin(Stdio::null()).status().with_context(|| format!("cannot start `{name}`"))?;
    ensure!(status.success(), "`{name}` failed: {status}");
    Ok(())
}

/// Runs a tool, and returns its output.
pub(super) fn output(command: &mut Command) -> Result<Vec<u8>> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.stdin(Stdio::null()).output().with_context(|| format!("cannot start `{name}`"))?;
    ensure!(output.status.success(), "`{name}` failed: {}", String::from_utf8_lossy(&output.stderr));
    Ok(output.stdout)
}

/// Returns the time of the last commit in seconds since 1970, so that packages are reproducible.
pub(super) fn commit_time() -> Result<String> {
    let text = output(Command::new("git").args(["log", "-1", "--format=%ct"]).current_dir(root()))?;
    Ok(String::from_utf8(text)?.trim().to_owned())
}

/// Compresses a file for Debian, without name and time; removes the original.
pub(super) fn compress(file: &Path) -> Result<()> {
    call(Command::new("gzip").args(["-9", "-n", "-f"]).arg(file))
}
