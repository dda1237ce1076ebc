//! The header of measurements of a program that was built before.

use std::{path::Path, process::Command};

use anyhow::{Context, Result};
use bottega_platform::run_head::RunHead;

/// Returns the header for measurements of a program.
pub(crate) fn head(program: &Path) -> Result<RunHead> {
    let said = Command::new(program).arg("--version").output();
    let said = said.with_context(|| format!("cannot start {}", program.display()))?.stdout;
    let version = String::from_utf8_lossy(&said).trim().to_owned();
    let build = format!("{version}: {}", program.display());
    Ok(RunHead::new(commit(&version), build, format_args!("{:.0}", jiff::Timestamp::now())))
}

/// Parses the commit of a version `NUMBER+DIGEST (commit HASH)`, or `(commit HASH with changes)`.
fn commit(version: &str) -> String {
    let commit = version.split_once("(commit ").and_then(|(_, rest)| rest.strip_suffix(')'));
    commit.map_or_else(|| "unknown".to_owned(), |commit| commit.replace(" with changes", "-dirty"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commit_of_a_program_is_read_off_its_version() {
        for (version, known) in [
            ("bottega 0.1.0+1a2b.3c4d (commit 0123456789ab)", "0123456789ab"),
            ("bottega 0.1.0+1a2b.3c4d (commit 0123456789ab with changes)", "0123456789ab-dirty"),
            ("bottega 0.1.0+1a2b.3c4d", "unknown"),
        ] {
            assert_eq!(commit(version), known);
        }
    }
}
