//! Measurements and their reports.

use std::{fmt::Arguments, io::Write, sync::LazyLock};

use bottega_platform::run_head::RunHead;
use serde_json::Value;

use crate::error::Error;

/// A measurement, with its options from the command line.
pub(crate) trait Measurement {
    /// Runs the measurement, and returns its results.
    ///
    /// - `log`: gets a line per step, such as the image being rendered.
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error>;
}

/// The results of a measurement.
pub(crate) trait Report {
    /// Returns tables for people, as complete lines.
    fn as_text(&self) -> String;
    /// Returns the results as a JSON object.
    fn as_json(&self) -> Value;
}

/// Writes a line to a log.
pub(crate) fn say(log: &mut dyn Write, line: Arguments<'_>) {
    // An unwritable log does not affect the results.
    _ = log.write_all(format!("{line}\n").as_bytes());
}

/// Returns the header of this run, created on the first call: before processors and threads are selected.
pub(crate) fn head() -> &'static RunHead {
    static HEAD: LazyLock<RunHead> = LazyLock::new(|| {
        let (commit, is_changed, _, compiler) = bottega_build::provenance!();
        let commit = match (commit, is_changed) {
            ("", _) => "unknown".to_owned(),
            (commit, false) => commit.to_owned(),
            (commit, true) => format!("{commit}-dirty"),
        };
        let profile = if cfg!(debug_assertions) { "development" } else { "release" };
        RunHead::new(commit, format!("{profile}, {compiler}"), format_args!("{:.0}", jiff::Timestamp::now()))
    });
    &HEAD
}

/// Returns the results as JSON, with the header of this run.
pub(crate) fn headed(report: &dyn Report) -> Value {
    let mut figures = report.as_json();
    let head: serde_json::Map<_, _> =
        head().fields().iter().map(|(name, value)| ((*name).to_owned(), Value::from(*value))).collect();
    figures["head"] = Value::Object(head);
    figures
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    struct Figure;

    impl Report for Figure {
        fn as_text(&self) -> String {
            String::new()
        }

        fn as_json(&self) -> Value {
            json!({"figure": 1})
        }
    }

    #[test]
    fn figures_stand_beside_the_commit_and_the_machine_that_they_are_of() {
        let json = headed(&Figure);
        assert_eq!(json["figure"], json!(1));
        let field = |name: &str| json["head"][name].as_str().unwrap_or_default().to_owned();
        let commit = field("commit");
        let hash = commit.trim_end_matches("-dirty");
        assert!(commit == "unknown" || hash.len() == 12 && hash.bytes().all(|it| it.is_ascii_hexdigit()), "{commit}");
        assert!(field("command").contains("bottega_bench") && field("build").contains("rustc"), "{json}");
        assert!(field("date").starts_with("20") && field("date").ends_with('Z'), "{json}");
    }
}
