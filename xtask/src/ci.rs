//! The commands that continuous integration runs.

use std::{
    ffi::OsStr,
    process::Command,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};

use crate::needs;

/// Format, lints, documentation, tests.
pub(crate) fn ci() -> Result<()> {
    cargo(&["fmt", "--all", "--check"], &[])?;
    cargo(&["clippy", "--workspace", "--all-targets", "--quiet", "--", "-D", "warnings"], &[])?;
    cargo(&["doc", "--workspace", "--no-deps", "--quiet"], &[("RUSTDOCFLAGS", OsStr::new("-D warnings"))])?;
    test()
}

/// Every test, after what they need has been installed.
pub(crate) fn test() -> Result<()> {
    needs::software_vulkan();
    needs::xml_validator();
    needs::engines(false);
    let found: Vec<_> = [needs::nats_servers(), needs::denoiser()].into_iter().flatten().collect();
    let found: Vec<_> = found.iter().map(|(variable, places)| (*variable, places.as_os_str())).collect();
    cargo(&["test", "--workspace", "--quiet"], &found)
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
