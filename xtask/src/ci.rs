//! The commands of continuous integration.

use std::{ffi::OsStr, thread, time::Instant};

use anyhow::Result;

use crate::{
    beside::CheckBeside,
    cargo::cargo,
    cost, deny, needs,
    suite::{self, TestGroup},
    systems,
};

/// Runs format, lints, documentation, dependencies, other systems, tests.
pub(crate) fn ci() -> Result<()> {
    let begun = Instant::now();
    // Install packages over the network while the processors compile.
    thread::scope(|scope| {
        let install = scope.spawn(|| {
            needs::install(false);
            // Before the tests, which use the same Python environment.
            systems::bring_zig();
        });
        let read = lints();
        install.join().expect("an installer that ends");
        read
    })?;
    deny::deny()?;
    let mut systems = None;
    let tested = suite::run(None, &needs::variables(), || systems = Some(CheckBeside::start("systems")));
    let checked = systems.map_or(Ok(()), |check| check?.finish());
    cost::print_longest(begun);
    checked.and(tested)
}

fn lints() -> Result<()> {
    cargo(&["fmt", "--all", "--check"], &[])?;
    cargo(&["clippy", "--workspace", "--all-targets", "--quiet", "--", "-D", "warnings"], &[])?;
    cargo(&["doc", "--workspace", "--no-deps", "--quiet"], &[("RUSTDOCFLAGS", OsStr::new("-D warnings"))])
}

/// Installs what the tests need, then runs the tests of a group, or all tests.
pub(crate) fn test(group: Option<TestGroup>) -> Result<()> {
    let begun = Instant::now();
    needs::install(false);
    let tested = suite::run(group, &needs::variables(), || {});
    cost::print_longest(begun);
    tested
}
