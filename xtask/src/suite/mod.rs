//! The test suite: runs every test, also after a failure, and prints a summary of what failed and what was skipped for which
//! reason. Several test programs run concurrently, depending on their load.

mod groups;
mod job;
mod programs;
mod schedule;
mod summary;

use std::{ffi::OsString, path::Path};

use anyhow::{Result, ensure};

pub(crate) use self::groups::TestGroup;
use self::summary::Summary;
use crate::bars::root;

/// Runs the tests of a group, or of the whole workspace.
///
/// - `environment`: the variables by which tests find what is installed for them.
/// - `compiled`: called when everything has been compiled and the first test starts.
///
/// # Errors
/// A test failed, after all tests have run; or something does not compile.
pub(crate) fn run(
    group: Option<TestGroup>,
    environment: &[(&'static str, OsString)],
    compiled: impl FnOnce(),
) -> Result<()> {
    let programs = programs::compile(group)?;
    compiled();
    let jobs = job::jobs(&programs, group, environment)?;
    let mut summary = Summary::default();
    let logs = logs_folder();
    std::fs::create_dir_all(&logs)?;
    schedule::run(jobs, &logs, &mut summary)?;
    summary.print();
    ensure!(summary.failed == 0, "{} tests failed", summary.failed);
    Ok(())
}

/// Returns the folder for the output of test programs.
fn logs_folder() -> std::path::PathBuf {
    root().join(Path::new("target/test-logs"))
}
