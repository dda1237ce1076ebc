//! The tests of the Python module, which are Python: `test_*.py` beside this file, run by pytest with the module of this build.
//!
//! Python is that of `target/python`, which `cargo xtask test` makes; or the `python3` at hand, if it has NumPy and pytest.
#![allow(clippy::print_stdout, reason = "what was skipped, and why, is read from what tests print")]

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    sync::OnceLock,
};

/// The folder of the module's sources.
fn crate_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of the programs and libraries of this build.
fn built() -> PathBuf {
    let test = env::current_exe().expect("a test knows its file");
    test.ancestors().nth(2).expect("a test lies in deps").to_owned()
}

/// The module as Python finds it: its sources with the library of this build.
fn module() -> &'static Path {
    static MODULE: OnceLock<PathBuf> = OnceLock::new();
    MODULE.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-module");
        let package = folder.join("bottega");
        fs::create_dir_all(&package).expect("a folder for the module");
        for entry in fs::read_dir(crate_folder().join("python/bottega")).expect("sources").flatten() {
            if entry.path().is_file() {
                fs::copy(entry.path(), package.join(entry.file_name())).expect("a source is copied");
            }
        }
        let name = format!("{}bottega_python{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX);
        let library = built().join("deps").join(name);
        // Replace the file as a whole: a concurrent test may be using the library.
        let target = package.join(if cfg!(windows) { "_native.pyd" } else { "_native.abi3.so" });
        _ = fs::remove_file(&target);
        fs::copy(library, &target).expect("cargo builds the library for its tests");
        folder
    })
}

/// A Python that has what the tests need.
fn python() -> Option<PathBuf> {
    let own = crate_folder().ancestors().nth(2)?.join("target/python/bin/python3");
    [own, "python3".into()].into_iter().find(|python| {
        let mut command = Command::new(python);
        command.args(["-c", "import numpy, pytest, mypy"]).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    })
}

fn run(file: &str) {
    let Some(python) = python() else {
        println!("skipped: no Python with numpy, pytest and mypy");
        return;
    };
    let mut command = Command::new(python);
    command.args(["-m", "pytest", "-q", "-rs", "-p", "no:cacheprovider", "--durations=3"]);
    command
        .arg(crate_folder().join("tests").join(file))
        .env("PYTHONPATH", module())
        .env("PYTHONDONTWRITEBYTECODE", "1");
    let program = built().join(format!("bottega{}", env::consts::EXE_SUFFIX));
    let Output { status, stdout, stderr } = command.env("BOTTEGA_PROGRAM", program).output().expect("pytest runs");
    let said = String::from_utf8_lossy(&stdout);
    for line in said.lines() {
        // `SKIPPED [1] FILE:LINE: REASON`, as the summary of all tests wants it.
        match line.strip_prefix("SKIPPED ").and_then(|line| line.split_once(": ")) {
            Some((place, reason)) => println!("skipped {place}: {reason}"),
            None => println!("{line}"),
        }
    }
    assert!(status.success(), "{said}\n{}", String::from_utf8_lossy(&stderr));
}

#[test]
fn pictures_of_python_are_those_of_the_command_line() {
    run("test_render.py");
}

#[test]
fn requests_of_python_are_typed_and_checked() {
    run("test_requests.py");
}

#[test]
fn scenes_in_memory_are_edited() {
    run("test_scenes.py");
}

#[test]
fn viewports_show_scenes_in_memory() {
    run("test_viewport.py");
}

#[test]
fn signals_threads_and_forks_do_no_harm() {
    run("test_processes.py");
}

#[test]
fn functions_of_python_are_those_of_the_command_line() {
    run("test_tools.py");
}

#[test]
fn a_farm_is_used_from_python() {
    run("test_farm.py");
}

#[test]
fn the_tutorial_in_python_makes_its_table() {
    run("test_tutorial.py");
}

#[test]
fn types_of_the_module_are_right() {
    run("test_types.py");
}
