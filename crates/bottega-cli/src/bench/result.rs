//! The result of a bench, as all benches print it.

use std::process::ExitCode;

use bottega_bench::Report;

use crate::error::CliError;

/// Prints the figures, for people or for programs.
pub(super) fn print(report: &dyn Report, json: bool) -> ExitCode {
    if json {
        println!("{}", report.as_json());
    } else {
        print!("{}", report.as_text());
    }
    ExitCode::SUCCESS
}

/// The scene of a paper was not found.
pub(super) fn no_scene() -> CliError {
    CliError::usage("no scene is named", "name one, or the folder of scenes by --scenes or BOTTEGA_SCENES")
}
