//! The wheel: the Python module and the program `bottega` in one file, for any Linux with glibc 2.28 or newer.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use anyhow::{Context, Result, ensure};

use crate::{
    bars::root,
    cargo,
    python::{WHEEL, interpreter, program},
};

/// The target of the wheel.
const TARGET: &str = "x86_64-unknown-linux-gnu";
/// The oldest supported C library.
const GLIBC: &str = "2.28";
/// The supported Python versions: 3.10 and newer.
const PYTHON: &str = "cp310-abi3";
/// The profile of releases.
const PROFILE: &str = "dist";
/// The maximum size of the wheel, in megabytes.
const MEGABYTES_MAX: f64 = 40.0;

/// Options of `cargo xtask wheel`.
#[derive(clap::Args, Default)]
pub(crate) struct WheelArgs {
    /// Make the source distribution as well.
    #[arg(long)]
    sdist: bool,
    /// And install the wheel in a bare Debian, which paints with it, as root.
    #[arg(long = "try")]
    try_it: bool,
}

/// Builds the wheel in `target/wheels`.
///
/// One run of cargo compiles program and module, which share nearly all code; maturin writes the metadata of the wheel.
///
/// # Errors
/// A tool cannot be installed or fails, or the wheel is too large.
pub(crate) fn wheel(args: &WheelArgs) -> Result<()> {
    ensure!(WHEEL.are_installed() || WHEEL.install(), "cannot install {}", WHEEL.packages().join(", "));
    let begun = Instant::now();
    let glibc = format!("{TARGET}.{GLIBC}");
    let packages = ["--package", "bottega-cli", "--package", "bottega-python"];
    run("cargo-zigbuild", &[&["zigbuild", "--profile", PROFILE, "--target", &glibc][..], &packages].concat())?;
    let wheels = root().join("target/wheels");
    let made = pack(&wheels)?;
    if args.sdist {
        run("maturin", &["sdist", "--out", &wheels.display().to_string()])?;
    }
    let megabytes = fs::metadata(&made)?.len() as f64 / 1e6;
    println!("{}: {megabytes:.1} MB, {:.0} s", made.display(), begun.elapsed().as_secs_f64());
    ensure!(megabytes <= MEGABYTES_MAX, "the wheel is larger than {MEGABYTES_MAX} MB");
    if args.try_it {
        let mut attempt = Command::new("packaging/python/try.sh");
        attempt.arg(&made).arg("scenes/cornell-box.glb").current_dir(root());
        ensure!(attempt.status()?.success(), "the wheel does not work in a bare Debian");
    }
    Ok(())
}

/// Lays out the compiled files as `pip` unpacks them, and packs them. Returns the wheel.
fn pack(wheels: &Path) -> Result<PathBuf> {
    let folder = wheels.join("unpacked");
    if folder.is_dir() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    let [folder_text, wheels_text] = [&folder, wheels].map(|path| path.display().to_string());
    run("maturin", &["pep517", "write-dist-info", "--metadata-directory", &folder_text])?;
    let about = only_file(&folder)?;
    let name = about.file_stem().context("maturin names the version")?.to_string_lossy().into_owned();
    let (package, scripts) = (folder.join("bottega"), folder.join(format!("{name}.data/scripts")));
    fs::create_dir_all(&package)?;
    fs::create_dir_all(&scripts)?;
    let built = root().join("target").join(TARGET).join(PROFILE);
    fs::copy(built.join("bottega"), scripts.join("bottega"))?;
    fs::copy(built.join("libbottega_python.so"), package.join("_native.abi3.so"))?;
    for entry in fs::read_dir(root().join("crates/bottega-python/python/bottega"))? {
        let path = entry?.path();
        if path.is_file() {
            fs::copy(&path, package.join(path.file_name().context("a source has a name")?))?;
        }
    }
    run("wheel", &["pack", &folder_text, "--dest-dir", &wheels_text])?;
    // maturin does not know the C library that the files were compiled for.
    let platform = format!("manylinux_{}_x86_64", GLIBC.replace('.', "_"));
    let packed = wheels.join(format!("{name}-{PYTHON}-linux_x86_64.whl"));
    run("wheel", &["tags", "--remove", "--platform-tag", &platform, &packed.display().to_string()])?;
    Ok(wheels.join(format!("{name}-{PYTHON}-{platform}.whl")))
}

/// Returns the only entry of a folder.
fn only_file(folder: &Path) -> Result<PathBuf> {
    let mut all = fs::read_dir(folder)?.filter_map(Result::ok).map(|entry| entry.path());
    let first = all.next().with_context(|| format!("{} is empty", folder.display()))?;
    ensure!(all.next().is_none(), "{} holds more than one thing", folder.display());
    Ok(first)
}

/// Runs a tool of the Python environment, which finds the others there.
pub(crate) fn run(tool: &str, arguments: &[&str]) -> Result<()> {
    eprintln!("+ {tool} {}", arguments.join(" "));
    let folder = program(tool).parent().map(Path::to_owned).unwrap_or_default();
    let path = env::join_paths([folder].into_iter().chain(env::split_paths(&env::var_os("PATH").unwrap_or_default())))?;
    let mut command = Command::new(program(tool));
    command.args(arguments).current_dir(root()).env("PATH", path).env("CARGO", env!("CARGO"));
    cargo::forget_package(&mut command);
    ensure!(command.status().with_context(|| format!("cannot start {tool}"))?.success(), "{tool} failed");
    Ok(())
}

/// Regenerates the Python classes of requests from their schema.
///
/// # Errors
/// The module does not compile, or Python is missing.
pub(crate) fn python_stubs() -> Result<()> {
    let mut build = cargo::command();
    build.args(["build", "--package", "bottega-python"]).current_dir(root());
    ensure!(build.status()?.success(), "the module does not compile");
    let name = format!("target/debug/{}bottega_python{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX);
    let mut generate = Command::new(interpreter());
    generate.args(["crates/bottega-python/generate.py", &name]).current_dir(root());
    ensure!(generate.status().context("cannot start Python")?.success(), "generate.py failed");
    Ok(())
}
