//! The commands that continuous integration runs.

use std::{ffi::OsStr, thread};

use anyhow::Result;

use crate::{beside::CheckBeside, cargo::cargo, deny, needs, soak, suite, systems};

/// Format, lints, documentation, dependencies, other systems, tests, a short soak.
pub(crate) fn ci() -> Result<()> {
    // What is installed comes over the network while processors read sources.
    thread::scope(|scope| {
        let install = scope.spawn(|| {
            needs::install(false);
            // Before the tests, which have the same Python.
            systems::bring_zig();
        });
        let read = lints();
        install.join().expect("an installer that ends");
        read
    })?;
    deny::deny()?;
    let mut systems = None;
    let tested = suite::run(&needs::variables(), || systems = Some(CheckBeside::start("systems")));
    let soaked = soak::soak_shortly(needs::nats_server());
    systems.map_or(Ok(()), |check| check?.finish()).and(tested).and(soaked)
}

fn lints() -> Result<()> {
    cargo(&["fmt", "--all", "--check"], &[])?;
    // With the bindings of Embree, which no other build has.
    cargo(&["clippy", "--workspace", "--all-targets", "--all-features", "--quiet", "--", "-D", "warnings"], &[])?;
    cargo(&["doc", "--workspace", "--no-deps", "--quiet"], &[("RUSTDOCFLAGS", OsStr::new("-D warnings"))])
}

/// Every test, after what they need has been installed.
pub(crate) fn test() -> Result<()> {
    needs::install(false);
    suite::run(&needs::variables(), || {})
}
