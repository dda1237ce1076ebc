//! The scripts of the page, without a browser: runs the tests of `tests/scripts`, which Node.js runs.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

#[test]
fn scripts_of_the_page_do_what_they_say() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scripts");
    let entries = folder.read_dir().expect("a folder").map(|entry| entry.expect("an entry").path());
    let files: Vec<PathBuf> = entries.filter(|path| path.to_string_lossy().ends_with(".test.js")).collect();
    assert!(!files.is_empty(), "there are no tests in {}", folder.display());
    let Ok(run) = Command::new("node").arg("--test").args(&files).output() else {
        return eprintln!("SKIPPED: there is no Node.js; `cargo xtask test` installs it");
    };
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success(), "{said}\n{}", String::from_utf8_lossy(&run.stderr));
}
