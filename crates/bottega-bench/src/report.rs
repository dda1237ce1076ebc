//! Measurements and their figures, each run with its head.

use std::{fmt::Arguments, io::Write, sync::LazyLock};

use bottega_platform::run_head::RunHead;
use serde_json::Value;

use crate::error::Error;

/// A measurement, as the options on the command line ask for it.
pub(crate) trait Measurement {
    /// Runs the measurement, and returns its figures.
    ///
    /// - `log`: gets a line for each step, such as which picture is being painted.
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error>;
}

/// The figures of a measurement.
pub(crate) trait Report {
    /// Tables for people, in whole lines.
    fn as_text(&self) -> String;
    /// The same for programs: an object.
    fn as_json(&self) -> Value;
}

/// Writes a line to a log.
pub(crate) fn say(log: &mut dyn Write, line: Arguments<'_>) {
    // A log that cannot be written changes no figure.
    _ = log.write_all(format!("{line}\n").as_bytes());
}

/// The head of this run, made when it is first asked for: before processors and threads are chosen.
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

/// The figures as JSON, and the head of this run among them.
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
