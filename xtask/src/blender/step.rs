//! The commands that a check consists of.

use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

/// Runs a command that must succeed.
///
/// # Errors
/// It cannot start, or fails.
pub(super) fn run(command: &mut Command) -> Result<()> {
    let status = command.stdin(Stdio::null()).status().with_context(|| format!("cannot start {command:?}"))?;
    ensure!(status.success(), "{command:?} failed");
    Ok(())
}
