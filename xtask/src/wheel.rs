//! The wheel: the Python module and the program `bottega` in one file, for any Linux of glibc 2.28 or newer.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use anyhow::{Context, Result, ensure};

use crate::{
    bars::root,
    python::{WHEEL, interpreter, program},
};

/// For which processors and systems it is made.
const TARGET: &str = "x86_64-unknown-linux-gnu";
/// The oldest C library that will do.
const GLIBC: &str = "2.28";
/// The wheel is at most so large, in megabytes.
const MEGABYTES_MAX: f64 = 40.0;

/// What `cargo xtask wheel` takes.
#[derive(clap::Args)]
pub(crate) struct WheelArgs {
    /// Make the source distribution as well.
    #[arg(long)]
    sdist: bool,
}

/// Makes the wheel in `target/wheels`.
///
/// # Errors
/// A tool cannot be installed or fails, or the wheel is too large.
pub(crate) fn wheel(args: &WheelArgs) -> Result<()> {
    ensure!(WHEEL.are_installed() || WHEEL.install(), "cannot install {}", WHEEL.packages().join(", "));
    let begun = Instant::now();
    let wheels = root().join("target/wheels");
    let glibc = format!("{TARGET}.{GLIBC}");
    run("cargo-zigbuild", &["zigbuild", "--release", "--package", "bottega-cli", "--target", &glibc])?;
    let out = wheels.join("module");
    if out.is_dir() {
        fs::remove_dir_all(&out)?;
    }
    let policy = format!("manylinux_{}", GLIBC.replace('.', "_"));
    let out_text = out.display().to_string();
    let module = ["build", "--release", "--zig", "--target", TARGET, "--compatibility", &policy];
    run("maturin", &[&module[..], &["--out", &out_text]].concat())?;
    let made = with_program(&only_file(&out)?, &wheels)?;
    if args.sdist {
        run("maturin", &["sdist", "--out", &wheels.display().to_string()])?;
    }
    let megabytes = fs::metadata(&made)?.len() as f64 / 1e6;
    println!("{}: {megabytes:.1} MB, {:.0} s", made.display(), begun.elapsed().as_secs_f64());
    ensure!(megabytes <= MEGABYTES_MAX, "the wheel is larger than {MEGABYTES_MAX} MB");
    Ok(())
}

/// Puts the program into a wheel, where `pip` takes programs from.
fn with_program(module: &Path, wheels: &Path) -> Result<PathBuf> {
    let unpacked = wheels.join("unpacked");
    if unpacked.is_dir() {
        fs::remove_dir_all(&unpacked)?;
    }
    let [module, unpacked_text, wheels_text] = [module, &unpacked, wheels].map(|path| path.display().to_string());
    run("wheel", &["unpack", &module, "--dest", &unpacked_text])?;
    let folder = only_file(&unpacked)?;
    let name = folder.file_name().context("a wheel unpacks to a folder")?.to_string_lossy().into_owned();
    let scripts = folder.join(format!("{name}.data/scripts"));
    fs::create_dir_all(&scripts)?;
    fs::copy(root().join("target").join(TARGET).join("release/bottega"), scripts.join("bottega"))?;
    run("wheel", &["pack", &folder.display().to_string(), "--dest-dir", &wheels_text])?;
    let file = Path::new(&module).file_name().context("a wheel has a name")?;
    Ok(wheels.join(file))
}

/// What a folder holds, where that is one thing.
fn only_file(folder: &Path) -> Result<PathBuf> {
    let mut all = fs::read_dir(folder)?.filter_map(Result::ok).map(|entry| entry.path());
    let first = all.next().with_context(|| format!("{} is empty", folder.display()))?;
    ensure!(all.next().is_none(), "{} holds more than one thing", folder.display());
    Ok(first)
}

/// Runs a tool of the Python environment, which finds the others there.
fn run(tool: &str, arguments: &[&str]) -> Result<()> {
    eprintln!("+ {tool} {}", arguments.join(" "));
    let tools = program(tool).parent().map(Path::to_owned).unwrap_or_default();
    let path = env::join_paths([tools].into_iter().chain(env::split_paths(&env::var_os("PATH").unwrap_or_default())))?;
    let mut command = Command::new(program(tool));
    command.args(arguments).current_dir(root()).env("PATH", path).env("CARGO", env!("CARGO"));
    ensure!(command.status().with_context(|| format!("cannot start {tool}"))?.success(), "{tool} failed");
    Ok(())
}

/// Makes the classes of requests anew from their schema.
///
/// # Errors
/// The module does not compile, or there is no Python.
pub(crate) fn python_stubs() -> Result<()> {
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--package", "bottega-python"]).current_dir(root());
    ensure!(build.status()?.success(), "the module does not compile");
    let name = format!("target/debug/{}bottega_python{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX);
    let mut generate = Command::new(interpreter());
    generate.args(["crates/bottega-python/generate.py", &name]).current_dir(root());
    ensure!(generate.status().context("cannot start Python")?.success(), "generate.py failed");
    Ok(())
}
