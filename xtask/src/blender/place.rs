//! The Blenders that can be had: modules from PyPI for a Python that is here, and the program of the system.

use std::{
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
    time::Duration,
};

use anyhow::Result;

use super::step::run;
use crate::{bars::root, python};

/// The modules `bpy` with the Python that each needs, the newest first.
const MODULES: [(&str, &str); 3] = [("5.3.0", "python3.13"), ("5.0.1", "python3.11"), ("4.2.23", "python3.11")];
/// The number of the display that windows are shown on.
const DISPLAY: &str = ":77";

/// A Blender.
pub(super) enum Blender {
    /// The module `bpy` of a version, in an environment with this Python.
    Module { version: &'static str, python: PathBuf },
    /// The program `blender`.
    Program { version: String },
}

/// Returns the Blenders that can be had, and says which are missing. The first suffices unless `all` are wanted.
pub(super) fn found(folder: &Path, all: bool) -> Result<Vec<Blender>> {
    let mut blenders = Vec::new();
    for (version, interpreter) in MODULES {
        if !all && !blenders.is_empty() {
            break;
        }
        match environment(folder, version, interpreter) {
            Some(python) => blenders.push(Blender::Module { version, python }),
            None => println!("missing: bpy {version}, which needs {interpreter} and PyPI"),
        }
    }
    if all {
        match program_version() {
            Some(version) => blenders.push(Blender::Program { version }),
            None => println!("missing: the program blender (Debian: apt-get install blender python3-numpy)"),
        }
    }
    Ok(blenders)
}

/// Returns the Python of an environment with a version of `bpy`; makes the environment if needed.
fn environment(folder: &Path, version: &str, interpreter: &str) -> Option<PathBuf> {
    let place = folder.join(format!("bpy-{version}"));
    let (python, stamp) = (place.join("bin/python"), place.join("installed"));
    if stamp.is_file() {
        return Some(python);
    }
    if !python::works(Path::new(interpreter)) {
        return None;
    }
    println!("installs bpy {version} into {} (a gigabyte)", place.display());
    run(Command::new(interpreter).args(["-m", "venv", "--clear"]).arg(&place)).ok()?;
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--only-binary", ":all:", &format!("bpy=={version}"), "numpy"]);
    run(&mut install).ok()?;
    fs::write(stamp, version).ok()?;
    Some(python)
}

/// Returns the version of the program `blender`, such as `3.4.1`.
fn program_version() -> Option<String> {
    let output = Command::new("blender").arg("--version").stderr(Stdio::null()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines().find_map(|line| line.strip_prefix("Blender ")).map(|version| version.trim().to_owned())
}

impl Blender {
    pub(super) fn version(&self) -> &str {
        match self {
            Self::Module { version, .. } => version,
            Self::Program { version } => version,
        }
    }

    /// True if it installs extensions: since 4.2.
    pub(super) fn is_extended(&self) -> bool {
        let mut parts = self.version().split('.').map(|part| part.parse::<u32>().unwrap_or(0));
        (parts.next().unwrap_or(0), parts.next().unwrap_or(0)) >= (4, 2)
    }

    /// Returns the command that runs a script of `blender/tests`.
    pub(super) fn script<S: AsRef<OsStr>>(&self, name: &str, arguments: &[S]) -> Command {
        let script = root().join("blender/tests").join(name);
        let mut command = match self {
            Self::Module { python, .. } => {
                let mut command = Command::new(python);
                command.arg(script);
                command
            }
            Self::Program { .. } => {
                let mut command = Command::new("blender");
                command.args(["--background", "--factory-startup", "--python"]).arg(script).arg("--");
                command
            }
        };
        command.args(arguments).env_remove("PYTHONPATH").env("PYTHONDONTWRITEBYTECODE", "1");
        command
    }

    /// Returns Blender's own check of an extension's archive; `None`: this Blender has none.
    pub(super) fn validator(&self, archive: &Path) -> Option<Command> {
        let Self::Module { python, .. } = self else { return None };
        let library = python.parent()?.parent()?.join("lib");
        let mut tool = fs::read_dir(library).ok()?.filter_map(Result::ok).flat_map(|entry| {
            let modules = entry.path().join("site-packages/bpy");
            fs::read_dir(modules).into_iter().flatten().filter_map(Result::ok)
        });
        let tool = tool.find_map(|entry| {
            let path = entry.path().join("scripts/addons_core/bl_pkg/cli/blender_ext.py");
            path.is_file().then_some(path)
        })?;
        let mut command = Command::new(python);
        command.arg(tool).arg("validate").arg(archive);
        Some(command)
    }

    /// True if it is a program, which has windows and renders for a farm.
    pub(super) fn is_program(&self) -> bool {
        matches!(self, Self::Program { .. })
    }

    /// Shows the viewport of a program in a window without a screen.
    pub(super) fn window(&self, module: &Path, folder: &Path) -> Result<()> {
        let server = Command::new("Xvfb").args([DISPLAY, "-screen", "0", "1280x900x24"]).stderr(Stdio::null()).spawn();
        let Ok(mut server) = server else {
            println!("SKIPPED: windows need Xvfb (Debian: apt-get install xvfb)");
            return Ok(());
        };
        // The socket shows that the display can be used.
        let socket = Path::new("/tmp/.X11-unix").join(DISPLAY.replace(':', "X"));
        while !socket.exists() && server.try_wait()?.is_none() {
            thread::sleep(Duration::from_millis(50));
        }
        let script = root().join("blender/tests/window.py");
        let mut command = Command::new("blender");
        command
            .args(["--factory-startup", "--window-geometry", "0", "0", "1280", "900", "--python"])
            .arg(script)
            .arg("--");
        command.arg(folder.join("pictures")).env("DISPLAY", DISPLAY).env("LIBGL_ALWAYS_SOFTWARE", "1");
        let shown = run(command.env("PYTHONPATH", module));
        server.kill()?;
        server.wait()?;
        shown
    }
}
