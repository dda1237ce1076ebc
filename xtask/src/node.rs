//! The packages that control a browser in the tests of the page: below `target/node`, pinned by
//! `crates/bottega-web/package.json`.

use std::{
    fs,
    path::PathBuf,
    process::{Command, Stdio},
};

use crate::bars::root;

/// The packages, as announced.
pub(crate) const PACKAGES: &str = "playwright-core axe-core";
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

fn folder() -> PathBuf {
    root().join("target/node")
}

/// Returns the path of a copy of the pinned versions, written after installation.
fn stamp() -> PathBuf {
    folder().join("installed.json")
}
