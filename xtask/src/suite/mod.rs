//! The whole test suite: every test runs, also after one failed, and a summary tells at the end what failed and what was skipped for
//! which reason. Several test programs run at a time, by how busy they keep the processors.

mod groups;
mod job;
mod programs;
mod schedule;
mod summary;

use std::{ffi::OsString, path::Path};

use anyhow::{Result, ensure};

pub(crate) use self::groups::Group;
use self::summary::Summary;
use crate::bars::root;

/// Runs the tests of a group, or of the whole workspace.
///
/// - `environment`: the variables by which tests find what is installed for them.
/// - `compiled`: called when everything has been compiled and the first test begins.
///
/// # Errors
/// A test failed, after all tests have run; or something does not compile.
pub(crate) fn run(
    group: Option<Group>,
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

/// The folder of what test programs print.
fn logs_folder() -> std::path::PathBuf {
    root().join(Path::new("target/test-logs"))
}
