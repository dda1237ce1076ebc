//! Calls of cargo.

use std::{
    env,
    ffi::OsStr,
    path::PathBuf,
    process::Command,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};

use crate::bars::root;

/// Cargo, as who calls it by hand has it.
pub(crate) fn command() -> Command {
    let mut command = Command::new(env!("CARGO"));
    forget_package(&mut command);
    command
}

/// Takes away the variables that tell of the package `xtask`. Build scripts run anew when these change (that of `ring` does), and then
/// all that is above them is compiled again.
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

/// Where cargo puts what it builds.
pub(crate) fn target() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

/// Runs cargo, and says how long it took.
pub(crate) fn cargo(arguments: &[&str], environment: &[(&str, &OsStr)]) -> Result<()> {
    eprintln!("+ cargo {}", arguments.join(" "));
    let start = Instant::now();
    let status = command()
        .args(arguments)
        .envs(environment.iter().copied())
        .status()
        .with_context(|| format!("cannot start cargo {}", arguments[0]))?;
    ensure!(status.success(), "cargo {} failed", arguments.join(" "));
    eprintln!("  {:.0} s", Duration::as_secs_f64(&start.elapsed()));
    Ok(())
}
