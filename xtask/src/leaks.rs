//! The long test of watertightness, which is too slow for every change.

use std::process::Command;

use anyhow::{Context, Result, ensure};

/// Casts so many rays from inside closed meshes; fails when one hits nothing.
pub(crate) fn leaks(rays: f64) -> Result<()> {
    let example = ["run", "--release", "--quiet", "-p", "bottega-kernels", "--example", "leaks", "--"];
    let status =
        Command::new(env!("CARGO")).args(example).arg(rays.to_string()).status().context("cannot start cargo run")?;
    ensure!(status.success(), "a closed mesh leaks");
    Ok(())
}
