//! The commit and state of the sources, by git.

use std::{fs, path::Path, process::Command};

/// The number of digits of a commit's hash, enough to be unique.
const DIGITS: &str = "--short=12";

/// Returns the commit of the sources, and `true` if they differ from it. `None`: git is missing or fails, or its repository is
/// not that of the sources.
///
/// - `root`: the root of the workspace.
/// - `places`: the files and folders that are compared with the commit, relative to `root`.
pub(crate) fn commit(root: &Path, places: &[&str]) -> Option<(String, bool)> {
    let top = ask(root, &["rev-parse", "--show-toplevel"])?;
    if fs::canonicalize(top).ok()? != fs::canonicalize(root).ok()? {
        return None;
    }
    let commit = ask(root, &["rev-parse", DIGITS, "HEAD"])?;
    let status = [&["--no-optional-locks", "status", "--porcelain", "--"], places].concat();
    let is_changed = !ask(root, &status)?.is_empty();
    Some((commit, is_changed))
}

fn ask(root: &Path, words: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("-C").arg(root).args(words).output().ok()?;
    let said = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| said.trim().to_owned())
}
