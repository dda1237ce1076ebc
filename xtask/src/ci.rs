//! The commands that continuous integration runs.

use std::{
    ffi::OsStr,
    process::Command,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};

use crate::{deny, needs, suite};

/// Format, lints, documentation, dependencies, tests.
pub(crate) fn ci() -> Result<()> {
    cargo(&["fmt", "--all", "--check"], &[])?;
    // With the bindings of Embree, which no other build has.
    cargo(&["clippy", "--workspace", "--all-targets", "--all-features", "--quiet", "--", "-D", "warnings"], &[])?;
    cargo(&["doc", "--workspace", "--no-deps", "--quiet"], &[("RUSTDOCFLAGS", OsStr::new("-D warnings"))])?;
    needs::install(false);
    deny::deny()?;
    suite::run(&needs::variables())
}

/// Every test, after what they need has been installed.
pub(crate) fn test() -> Result<()> {
    needs::install(false);
    suite::run(&needs::variables())
}

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
