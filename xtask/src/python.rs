//! The Python environment of the tests: one virtual environment below `target`, with pinned packages.

use std::{
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use crate::bars::root;

/// A list of pinned packages, in the format of `pip install --requirement`.
#[derive(Clone, Copy)]
pub(crate) struct Requirements {
    /// The file, relative to the repository.
    file: &'static str,
    text: &'static str,
}

/// The packages that the tests use.
pub(crate) const TESTS: Requirements =
    Requirements { file: "xtask/requirements.txt", text: include_str!("../requirements.txt") };
/// The packages Cycles and LuxCore.
pub(crate) const LARGE_ENGINES: Requirements =
    Requirements { file: "xtask/requirements-engines.txt", text: include_str!("../requirements-engines.txt") };
/// The packages that build the wheel.
pub(crate) const WHEEL: Requirements =
    Requirements { file: "xtask/requirements-wheel.txt", text: include_str!("../requirements-wheel.txt") };

impl Requirements {
    /// Returns the packages with their versions, for announcements.
    pub(crate) fn packages(&self) -> Vec<&'static str> {
        let lines = self.text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
        lines.map(|line| line.split(';').next().unwrap_or(line)).collect()
    }

    /// Returns the path of a copy of the list, written after installation.
    fn stamp(&self) -> PathBuf {
        folder().join(Path::new(self.file).file_name().unwrap_or_default())
    }

    /// True if the pinned versions are installed.
    pub(crate) fn are_installed(&self) -> bool {
        fs::read_to_string(self.stamp()).is_ok_and(|text| text == self.text) && works(&program("python3"))
    }

    /// Creates the environment if needed, and installs the packages. Returns `true` on success.
    pub(crate) fn install(&self) -> bool {
        if !works(&program("python3")) && !run(Path::new("python3"), &["-m", "venv", "--clear", "target/python"]) {
            return false;
        }
        let arguments = ["-m", "pip", "install", "--quiet", "--no-deps", "--requirement", self.file];
        run(&program("python3"), &arguments) && fs::write(self.stamp(), self.text).is_ok()
    }
}

/// Returns the path of a program in the environment.
pub(crate) fn program(name: &str) -> PathBuf {
    folder().join("bin").join(name)
}

/// Returns the Python that runs workers and scripts: the environment's, or else the system's.
pub(crate) fn interpreter() -> OsString {
    let own = program("python3");
    if own.is_file() { own.into_os_string() } else { "python3".into() }
}

/// Returns the folder of a package in the environment.
pub(crate) fn package(package: &str) -> Option<PathBuf> {
    let versions = fs::read_dir(folder().join("lib")).ok()?.filter_map(Result::ok);
    versions.map(|version| version.path().join("site-packages").join(package)).find(|path| path.is_dir())
}

/// Returns the variable by which the workers of engines find the environment. A value set by the caller wins.
pub(crate) fn engine_variable() -> Option<(&'static str, OsString)> {
    const VARIABLE: &str = "BOTTEGA_ENGINE_PYTHON";
    let is_needed = program("python3").is_file() && std::env::var_os(VARIABLE).is_none();
    is_needed.then(|| (VARIABLE, folder().into_os_string()))
}

fn folder() -> PathBuf {
    root().join("target/python")
}

/// True if a program prints its version.
pub(crate) fn works(program: &Path) -> bool {
    let mut command = Command::new(program);
    command.arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

fn run(program: &Path, arguments: &[&str]) -> bool {
    let mut command = Command::new(program);
    // Packages of the user must not hide that one is missing here.
    command.args(arguments).current_dir(root()).env("PYTHONNOUSERSITE", "1").env_remove("PYTHONPATH");
    command.stdin(Stdio::null()).stdout(Stdio::null()).status().is_ok_and(|status| status.success())
}
