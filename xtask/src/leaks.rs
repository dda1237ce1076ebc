//! The long test of watertightness, which is too slow to run for every change.

use anyhow::{Context, Result, ensure};

use crate::cargo;

/// Casts rays from inside closed meshes; fails if one hits nothing.
pub(crate) fn leaks(rays: f64) -> Result<()> {
    let example = ["run", "--release", "--quiet", "-p", "bottega-kernels", "--example", "leaks", "--"];
    let status = cargo::command().args(example).arg(rays.to_string()).status().context("cannot start cargo run")?;
    ensure!(status.success(), "a closed mesh leaks");
    Ok(())
}
