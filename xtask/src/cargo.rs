//! Calls of cargo.

use std::{env, ffi::OsStr, path::PathBuf, process::Command, time::Instant};

use anyhow::{Context, Result, ensure};

use crate::{bars::root, cost};

/// Returns a command for cargo with the environment of an interactive call.
pub(crate) fn command() -> Command {
    let mut command = Command::new(env!("CARGO"));
    forget_package(&mut command);
    command
}

/// Removes the variables that describe the package `xtask`. Some build scripts (that of `ring`) run again when these change, and
/// everything that depends on them is recompiled.
pub(crate) fn forget_package(command: &mut Command) {
    let tells = |name: &str| {
        name.starts_with("CARGO_PKG_")
            || name.starts_with("CARGO_MANIFEST_")
            || ["CARGO_BIN_NAME", "CARGO_CRATE_NAME", "CARGO_PRIMARY_PACKAGE"].contains(&name)
    };
    for (name, _) in env::vars_os() {
        if name.to_str().is_some_and(tells) {
            command.env_remove(name);
        }
    }
}

/// Returns cargo's target folder.
pub(crate) fn target() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

/// Runs cargo, and prints the cost.
pub(crate) fn cargo(arguments: &[&str], environment: &[(&str, &OsStr)]) -> Result<()> {
    eprintln!("+ cargo {}", arguments.join(" "));
    let begun = Instant::now();
    let mut command = command();
    command.args(arguments).envs(environment.iter().copied());
    let mut child = command.spawn().with_context(|| format!("cannot start cargo {}", arguments[0]))?;
    let (status, cost) = cost::wait(&format!("cargo {}", arguments[0]), &mut child, begun)?;
    ensure!(status.success(), "cargo {} failed", arguments.join(" "));
    eprintln!("  {cost}");
    Ok(())
}
