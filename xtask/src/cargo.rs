//! Calls of cargo.

use std::{
    ffi::OsStr,
    process::Command,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};

/// Runs cargo, and says how long it took.
pub(crate) fn cargo(arguments: &[&str], environment: &[(&str, &OsStr)]) -> Result<()> {
    eprintln!("+ cargo {}", arguments.join(" "));
    let start = Instant::now();
    let status = Command::new(env!("CARGO"))
        .args(arguments)
        .envs(environment.iter().copied())
        .status()
        .with_context(|| format!("cannot start cargo {}", arguments[0]))?;
    ensure!(status.success(), "cargo {} failed", arguments.join(" "));
    eprintln!("  {:.0} s", Duration::as_secs_f64(&start.elapsed()));
    Ok(())
}
