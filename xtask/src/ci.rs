//! The commands that continuous integration runs.

use std::{ffi::OsStr, thread, time::Instant};

use anyhow::Result;

use crate::{
    beside::CheckBeside,
    cargo::cargo,
    cost, deny, needs,
    suite::{self, Group},
    systems,
};

/// Format, lints, documentation, dependencies, other systems, tests.
pub(crate) fn ci() -> Result<()> {
    let begun = Instant::now();
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
    let tested = suite::run(None, &needs::variables(), || systems = Some(CheckBeside::start("systems")));
    let checked = systems.map_or(Ok(()), |check| check?.finish());
    cost::print_longest(begun);
    checked.and(tested)
}

fn lints() -> Result<()> {
    cargo(&["fmt", "--all", "--check"], &[])?;
    // With the bindings of Embree, which no other build has.
    cargo(&["clippy", "--workspace", "--all-targets", "--all-features", "--quiet", "--", "-D", "warnings"], &[])?;
    cargo(&["doc", "--workspace", "--no-deps", "--quiet"], &[("RUSTDOCFLAGS", OsStr::new("-D warnings"))])
}

/// The tests of a group, or every test, after what they need has been installed.
pub(crate) fn test(group: Option<Group>) -> Result<()> {
    let begun = Instant::now();
    needs::install(false);
    let tested = suite::run(group, &needs::variables(), || {});
    cost::print_longest(begun);
    tested
}
