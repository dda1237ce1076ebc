//! A parser of the output of test programs: counts passed, failed and skipped tests, with the reasons for skips.

use std::collections::BTreeMap;

/// The results of all programs that have ended.
#[derive(Default)]
pub(crate) struct Summary {
    pub(crate) passed: u64,
    pub(crate) failed: u64,
    failures: Vec<String>,
    /// Skipped tests by reason.
    skipped: BTreeMap<String, Vec<String>>,
}

/// The section of a program's output that a line belongs to.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    /// One line per test.
    Tests,
    /// The output of passing tests.
    Successes,
    /// The output of failing tests.
    Failures,
}

impl Summary {
    /// Adds the output of a test program, as libtest prints it with `--show-output`. Returns the lines to show: the output of
    /// failing tests, and lines that belong to no test.
    ///
    /// - `program`: the name under which failures are listed.
    pub(crate) fn add<'a>(&mut self, program: &str, output: &'a str) -> Vec<&'a str> {
        let (mut section, mut test) = (Section::Tests, "");
        let mut shown = Vec::new();
        for line in output.lines() {
            if let Some(result) = line.strip_prefix("test result: ") {
                section = Section::Tests;
                self.passed += count(result, " passed");
                self.failed += count(result, " failed");
                continue;
            }
            if let Some(name) = line.strip_prefix("---- ") {
                test = name.split(' ').next().unwrap_or(name);
            }
            match line {
                "successes:" => section = Section::Successes,
                "failures:" => section = Section::Failures,
                _ => {}
            }
            match section {
                Section::Successes => self.note_skip(test, line),
                Section::Failures => shown.push(line),
                Section::Tests => {
                    if let Some(name) = line.strip_prefix("test ").and_then(|rest| rest.strip_suffix(" ... FAILED")) {
                        self.failures.push(format!("{program}: {name}"));
                    }
                    let ends_well = line.starts_with("test ") && line.ends_with("... ok");
                    if !ends_well && !line.is_empty() && !line.starts_with("running ") {
                        shown.push(line);
                    }
                }
            }
        }
        shown
    }

    /// Adds a program that ended without a test result.
    pub(crate) fn add_failure(&mut self, problem: String) {
        self.failed += 1;
        self.failures.push(problem);
    }

    /// Notes `skipped: REASON`, or for a part of a test, `skipped PART: REASON`.
    fn note_skip(&mut self, test: &str, line: &str) {
        let reason = line.strip_prefix("SKIPPED").or_else(|| line.strip_prefix("skipped"));
        if let Some(reason) = reason.filter(|reason| reason.starts_with([':', ' '])) {
            let reason = reason.trim_start_matches(':').trim_start().to_owned();
            self.skipped.entry(reason).or_default().push(test.to_owned());
        }
    }

    pub(crate) fn print(&self) {
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

/// Returns the number before a word of `ok. 12 passed; 0 failed; …`.
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
";

    #[test]
    fn failures_and_reasons_of_skips_are_summed_up() {
        let mut summary = Summary::default();
        let shown = summary.add("bottega-scene", OUTPUT);
        assert!(
            summary.add("bottega-farm", "test a ... ok\n\ntest result: ok. 1 passed; 0 failed; 0 ignored").is_empty()
        );
        assert_eq!((summary.passed, summary.failed), (3, 1));
        assert_eq!(summary.failures, ["bottega-scene: scene::reads"]);
        let reasons: Vec<(&str, &str)> =
            summary.skipped.iter().map(|(reason, tests)| (reason.as_str(), tests[0].as_str())).collect();
        assert_eq!(reasons, [("9 files: there is no folder", "farm::joins"), ("no Vulkan adapter", "gpu::paints")]);
        assert!(shown.contains(&"assertion failed"), "{shown:?}");
        assert!(!shown.contains(&"something else"), "{shown:?}");
    }
}
