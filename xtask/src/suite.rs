//! The whole test suite: every test runs, also after one failed, and a summary tells at the end what failed and what was
//! skipped for which reason.

use std::{
    collections::BTreeMap,
    ffi::OsString,
    io::{BufRead, BufReader},
    process::Stdio,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};

use crate::{bars::root, cargo};

/// Runs `cargo test` over the workspace.
///
/// - `compiled`: called when everything has been compiled and the first test begins.
///
/// # Errors
/// A test failed, or something did not compile: after all tests have run.
pub(crate) fn run(environment: &[(&'static str, OsString)], compiled: impl FnOnce()) -> Result<()> {
    // What passing tests print is read for the reasons why they were skipped.
    let arguments = ["test", "--workspace", "--no-fail-fast", "--", "--show-output"];
    eprintln!("+ cargo {}", arguments.join(" "));
    let start = Instant::now();
    let mut command = cargo::command();
    command.args(arguments).current_dir(root()).envs(environment.iter().map(|(name, value)| (name, value)));
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().context("cannot start cargo test")?;
    let mut summary = Summary::default();
    let output = BufReader::new(child.stdout.take().context("cargo test has no output")?);
    let mut compiled = Some(compiled);
    for line in output.split(b'\n') {
        let line = line.context("cannot read what cargo test prints")?;
        // Cargo says what it compiles elsewhere.
        if let Some(tell) = compiled.take() {
            tell();
        }
        if let Some(shown) = summary.read(&String::from_utf8_lossy(&line)) {
            println!("{shown}");
        }
    }
    let status = child.wait()?;
    summary.print();
    eprintln!("  {:.0} s", Duration::as_secs_f64(&start.elapsed()));
    ensure!(status.success() && summary.failed == 0, "{} tests failed", summary.failed);
    Ok(())
}

/// What the lines of libtest say, added up over all test programs.
#[derive(Default)]
struct Summary {
    passed: u64,
    failed: u64,
    failures: Vec<String>,
    /// Tests by the reason why they were skipped.
    skipped: BTreeMap<String, Vec<String>>,
    section: Section,
    /// The test whose output is read.
    test: String,
}

/// Where in the output of a test program a line stands.
#[derive(Clone, Copy, Default, PartialEq)]
enum Section {
    #[default]
    Tests,
    /// What passing tests printed.
    Successes,
    Failures,
}

impl Summary {
    /// Takes a line; returns it where people should see it.
    fn read<'a>(&mut self, line: &'a str) -> Option<&'a str> {
        let line = line.trim_end_matches('\r');
        if let Some(result) = line.strip_prefix("test result: ") {
            self.section = Section::Tests;
            self.passed += count(result, " passed");
            self.failed += count(result, " failed");
            return Some(line);
        }
        if let Some(name) = line.strip_prefix("---- ") {
            self.test = name.split(' ').next().unwrap_or(name).to_owned();
        }
        match (line, self.section) {
            ("successes:", _) => self.section = Section::Successes,
            ("failures:", _) => self.section = Section::Failures,
            _ => {}
        }
        match self.section {
            Section::Successes => self.note_skip(line),
            Section::Failures => return Some(line),
            Section::Tests => {
                // One line a test is too much to read; those that do not pass are shown.
                let ends_well = line.starts_with("test ") && line.ends_with("... ok");
                if let Some(name) = line.strip_prefix("test ").and_then(|rest| rest.strip_suffix(" ... FAILED")) {
                    self.failures.push(name.to_owned());
                }
                return (!ends_well && !line.is_empty()).then_some(line);
            }
        }
        None
    }

    fn note_skip(&mut self, line: &str) {
        // `skipped: REASON`, or of a part of a test, `skipped PART: REASON`.
        let said = line.strip_prefix("SKIPPED").or_else(|| line.strip_prefix("skipped"));
        if let Some(said) = said.filter(|said| said.starts_with([':', ' '])) {
            let reason = said.trim_start_matches(':').trim_start().to_owned();
            self.skipped.entry(reason).or_default().push(self.test.clone());
        }
    }

    fn print(&self) {
        println!();
        for (reason, tests) in &self.skipped {
            println!("skipped {}: {reason}", tests.join(", "));
        }
        for failure in &self.failures {
            println!("FAILED {failure}");
        }
        let skipped: usize = self.skipped.values().map(Vec::len).sum();
        println!("{} passed, {} failed, {skipped} skipped", self.passed, self.failed);
    }
}

/// The number before a word of `ok. 12 passed; 0 failed; …`.
fn count(result: &str, word: &str) -> u64 {
    let before = result.split(word).next().filter(|before| before.len() < result.len());
    let number = before.and_then(|before| before.rsplit(' ').next());
    number.and_then(|number| number.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTPUT: &str = "
running 3 tests
test farm::joins ... ok
test gpu::paints ... ok
test scene::reads ... FAILED

successes:

---- gpu::paints stdout ----
skipped: no Vulkan adapter

---- farm::joins stdout ----
something else
skipped 9 files: there is no folder
skippedness is no reason

successes:
    gpu::paints
    farm::joins

failures:

---- scene::reads stdout ----
assertion failed

failures:
    scene::reads

test result: FAILED. 2 passed; 1 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s

running 1 test
test a ... ok

test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s
";

    #[test]
    fn failures_and_reasons_of_skips_are_summed_up() {
        let mut summary = Summary::default();
        let shown: Vec<&str> = OUTPUT.lines().filter_map(|line| summary.read(line)).collect();
        assert_eq!((summary.passed, summary.failed), (3, 1));
        assert_eq!(summary.failures, ["scene::reads"]);
        let reasons: Vec<(&str, &str)> =
            summary.skipped.iter().map(|(reason, tests)| (reason.as_str(), tests[0].as_str())).collect();
        assert_eq!(reasons, [("9 files: there is no folder", "farm::joins"), ("no Vulkan adapter", "gpu::paints")]);
        assert!(shown.contains(&"assertion failed"), "{shown:?}");
        assert!(!shown.contains(&"something else"), "{shown:?}");
    }
}
