//! The commands that continuous integration runs.

use std::ffi::OsStr;

use anyhow::Result;

use crate::{beside::CheckBeside, cargo::cargo, deny, needs, suite, systems};

/// Format, lints, documentation, dependencies, other systems, tests.
pub(crate) fn ci() -> Result<()> {
    cargo(&["fmt", "--all", "--check"], &[])?;
    // With the bindings of Embree, which no other build has.
    cargo(&["clippy", "--workspace", "--all-targets", "--all-features", "--quiet", "--", "-D", "warnings"], &[])?;
    cargo(&["doc", "--workspace", "--no-deps", "--quiet"], &[("RUSTDOCFLAGS", OsStr::new("-D warnings"))])?;
    needs::install(false);
    deny::deny()?;
    // Before the tests, which have the same Python.
    systems::bring_zig();
    let systems = CheckBeside::start("systems")?;
    let tested = suite::run(&needs::variables());
    systems.finish().and(tested)
}

/// Every test, after what they need has been installed.
pub(crate) fn test() -> Result<()> {
    needs::install(false);
    suite::run(&needs::variables())
}
