//! Checks for the other systems: compilation for Windows and macOS, and the crates that may contain system-specific code.

use std::process::Command;

use anyhow::{Result, ensure};

use crate::python::WHEEL;
use crate::wheel::run;

/// One target per family; the tests run on Linux.
const TARGETS: [&str; 2] = ["x86_64-pc-windows-gnu", "aarch64-apple-darwin"];

/// Checks that everything compiles for Windows and macOS, as far as a standard library for them is available. zig compiles the C
/// code.
///
/// # Errors
/// The code does not compile for a target.
pub(crate) fn systems() -> Result<()> {
    let has_zig = bring_zig();
    for target in TARGETS {
        let has_library = Command::new("rustup").args(["target", "add", target]).status().is_ok_and(|it| it.success());
        if !(has_zig && has_library) {
            println!("skipped {target}: its standard library, or zig, cannot be had here");
            continue;
        }
        // xtask is for Linux only.
        let arguments = ["check", "--workspace", "--exclude", "xtask", "--target", target];
        ensure!(run("cargo-zigbuild", &arguments).is_ok(), "the workspace does not compile for {target}");
    }
    Ok(())
}

/// Installs zig below `target/python`, if needed. Returns `true` if it is available.
pub(crate) fn bring_zig() -> bool {
    WHEEL.are_installed() || WHEEL.install()
}

#[cfg(test)]
mod tests {
    use std::{
        fs,
        path::{Path, PathBuf},
    };

    use crate::bars::root;

    /// Signs of system-specific code.
    const SIGNS: [&str; 9] = [
        "cfg(unix",
        "cfg(windows",
        "cfg(not(unix",
        "cfg(not(windows",
        "target_os",
        "target_vendor",
        "os::unix",
        "os::windows",
        "rustix::",
    ];

    /// Files other than `bottega-platform` that may contain system-specific code.
    const EXCEPTIONS: [(&str, &str); 6] = [
        ("bottega-kernels/src/arena.rs", "huge pages, in the lowest of all crates; elsewhere the allocator's memory"),
        (
            "bottega-engines/src/external/child/fence.rs",
            "Landlock; elsewhere engines run without a fence and report so",
        ),
        ("bottega-engines/src/external/child/guard.rs", "util-linux; elsewhere engines have the network and report so"),
        ("bottega-gpu/src/memory.rs", "Vulkan's loader, which Apple's systems do not have"),
        ("bottega-denoise/src/find.rs", "the names under which a library is loaded"),
        ("bottega/src/devices/choice.rs", "drivers are queried if there is a device node of a GPU; elsewhere always"),
    ];

    #[test]
    fn only_the_platform_asks_on_which_system_it_is() {
        let crates = root().join("crates");
        let mut files = Vec::new();
        for entry in fs::read_dir(&crates).expect("a folder").map(|entry| entry.expect("an entry").path()) {
            if !entry.ends_with("bottega-platform") {
                collect(&entry.join("src"), &mut files);
            }
        }
        assert!(files.len() > 300, "{} sources", files.len());
        for (file, reason) in EXCEPTIONS {
            assert!(asks(&crates.join(file)).is_some(), "{file} asks no more ({reason}): take it off the list");
        }
        for file in files.iter().filter(|file| !EXCEPTIONS.iter().any(|(known, _)| file.ends_with(known))) {
            if let Some(line) = asks(file) {
                panic!("{}: `{line}`: ask bottega-platform instead", file.display());
            }
        }
    }

    /// Returns the first system-specific line before the tests.
    fn asks(file: &Path) -> Option<String> {
        let text = fs::read_to_string(file).expect("a source");
        let program =
            text.split("#[cfg(test)]").next().and_then(|text| text.split("#[cfg(all(test").next()).unwrap_or_default();
        let line = program.lines().find(|line| SIGNS.iter().any(|sign| line.contains(sign)) && !is_comment(line));
        line.map(|line| line.trim().to_owned())
    }

    fn is_comment(line: &str) -> bool {
        line.trim_start().starts_with("//")
    }

    fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
        for path in fs::read_dir(folder).into_iter().flatten().map(|entry| entry.expect("an entry").path()) {
            if path.is_dir() {
                collect(&path, files);
            } else if path.extension().is_some_and(|it| it == "rs") && !path.ends_with("tests.rs") {
                files.push(path);
            }
        }
    }
}
