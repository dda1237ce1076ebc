//! The runs of test programs: each program once for its tests that need only Rust, and once for each group that it has tests of.

use std::{env, ffi::OsString, path::PathBuf, process::Command, thread};

use anyhow::{Context, Result};

use super::{
    groups::{PARTS, Part, TestGroup},
    programs::TestProgram,
};
use crate::{bars::root, cargo};

/// A run of a test program, or of the examples in documentation.
pub(crate) struct TestJob {
    /// The name in lists, such as `bottega-cli farm`.
    pub(crate) name: String,
    pub(crate) command: Command,
    /// The number of processors that it keeps busy.
    pub(crate) load: f64,
}

/// The programs that take longest without waiting: they start first, so that none of them runs alone at the end.
const LONG: [&str; 4] = ["bottega-render", "bottega-scene", "bottega-farm", "bottega-cli"];

/// The number of events of the short soak test.
const SOAK_STEPS: &str = "36";
const SOAK_SEED: &str = "3";

/// Returns the runs of these programs, in the order of their start.
pub(crate) fn jobs(
    programs: &[TestProgram],
    group: Option<TestGroup>,
    environment: &[(&'static str, OsString)],
) -> Result<Vec<TestJob>> {
    let libraries = library_path()?;
    let make = |name: String, program: &TestProgram, filters: &[String], load: f64| {
        let mut command = Command::new(&program.file);
        command.args(filters).args(["--show-output", "--test-threads", &threads(load).to_string()]);
        // Set the environment as cargo does.
        command.current_dir(&program.folder).env("CARGO_MANIFEST_DIR", &program.folder);
        command.env("LD_LIBRARY_PATH", &libraries).envs(environment.iter().map(|(name, value)| (name, value)));
        cargo::forget_package(&mut command);
        command.env("CARGO_MANIFEST_DIR", &program.folder);
        TestJob { name, command, load }
    };
    let parts = PARTS.iter().filter(|part| group.is_none_or(|group| part.group == group));
    let mut jobs: Vec<TestJob> = Vec::new();
    for part in parts {
        for program in programs.iter().filter(|program| program.package == part.package && holds(program, part)) {
            let filters: Vec<String> = part.modules.iter().map(|module| format!("{module}::")).collect();
            let kind = if program.is_unit { " (unit)" } else { "" };
            let name = format!("{} {}{kind}", part.package, format!("{:?}", part.group).to_lowercase());
            jobs.push(make(name, program, &filters, part.load));
        }
    }
    if group.is_none_or(|group| group == TestGroup::Farm) {
        jobs.push(short_soak(environment)?);
    }
    if group.is_none_or(|group| group == TestGroup::Python) {
        jobs.push(blender()?);
    }
    if group.is_some() {
        return Ok(jobs);
    }
    let mut others: Vec<(usize, TestJob)> = Vec::new();
    for program in programs {
        let parts: Vec<&Part> =
            PARTS.iter().filter(|part| part.package == program.package && holds(program, part)).collect();
        if parts.iter().any(|part| part.modules.is_empty()) {
            continue;
        }
        let modules = parts.iter().flat_map(|part| part.modules);
        let skips: Vec<String> = modules.flat_map(|module| ["--skip".to_owned(), format!("{module}::")]).collect();
        let name = format!("{}{}", program.package, if program.is_unit { " (unit)" } else { "" });
        let rank = LONG.iter().position(|long| *long == program.package).unwrap_or(LONG.len());
        others.push((rank, make(name, program, &skips, 1.0)));
    }
    others.sort_by_key(|(rank, _)| *rank);
    jobs.extend(others.into_iter().map(|(_, job)| job));
    jobs.push(documentation(environment));
    Ok(jobs)
}

/// True if a program has tests of this part; the modules of a part are in the folder `tests`.
fn holds(program: &TestProgram, part: &Part) -> bool {
    part.modules.is_empty() || !program.is_unit
}

/// Returns the short soak test: a few random events on a farm of real processes, always the same ones.
fn short_soak(environment: &[(&'static str, OsString)]) -> Result<TestJob> {
    let built = cargo::target().join("debug");
    let mut command = Command::new(env::current_exe()?);
    command.args(["soak", "--steps", SOAK_STEPS, "--seed", SOAK_SEED, "--program"]).arg(built.join("bottega"));
    command.current_dir(root()).envs(environment.iter().map(|(name, value)| (name, value)));
    Ok(TestJob { name: "soak farm".to_owned(), command, load: 1.0 })
}

/// Returns the check of the Blender add-on: an F12 and exports in the newest Blender that can be had.
fn blender() -> Result<TestJob> {
    let mut command = Command::new(env::current_exe()?);
    command.args(["blender", "--quick"]).current_dir(root());
    Ok(TestJob { name: "blender python".to_owned(), command, load: 1.0 })
}

/// Returns the run of the examples in documentation, which cargo compiles and runs.
fn documentation(environment: &[(&'static str, OsString)]) -> TestJob {
    let mut command = cargo::command();
    command.args(["test", "--quiet", "--workspace", "--doc", "--no-fail-fast"]).current_dir(root());
    command.envs(environment.iter().map(|(name, value)| (name, value)));
    TestJob { name: "examples in documentation".to_owned(), command, load: 1.0 }
}

/// Returns the number of concurrent tests of a program; it leaves processors to other programs.
fn threads(load: f64) -> usize {
    let all = thread::available_parallelism().map_or(1, usize::from);
    // Programs that mostly wait can run many tests at once.
    if load < 1.0 { all.max(2) } else { all.div_ceil(2) }
}

/// Returns the library path for test programs: those of macros load the standard library at run time.
fn library_path() -> Result<OsString> {
    let rustc = PathBuf::from(env!("CARGO")).with_file_name("rustc");
    let shown = Command::new(rustc).args(["--print", "target-libdir"]).output().context("cannot start rustc")?;
    let folder = PathBuf::from(String::from_utf8(shown.stdout)?.trim());
    let rest = env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let all = std::iter::once(folder).chain(env::split_paths(&rest).collect::<Vec<_>>());
    Ok(env::join_paths(all)?)
}
