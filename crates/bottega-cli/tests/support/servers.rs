//! The NATS servers of this machine.

use std::{env, path::PathBuf};

/// NATS servers: those that `BOTTEGA_NATS_SERVERS` names, or the system's. Without one the test says that it is skipped.
pub(crate) fn servers() -> Vec<PathBuf> {
    let named = env::var_os("BOTTEGA_NATS_SERVERS");
    let named: Vec<PathBuf> = named.iter().flat_map(env::split_paths).filter(|path| path.is_file()).collect();
    let places = env::var_os("PATH").unwrap_or_default();
    let places = env::split_paths(&places).chain(["/usr/sbin".into(), "/usr/local/bin".into()]);
    let system = places.map(|folder| folder.join("nats-server")).find(|path| path.is_file());
    let found = if named.is_empty() { system.into_iter().collect() } else { named };
    if found.is_empty() {
        eprintln!("SKIPPED: there is no nats-server; `cargo xtask test` installs one");
    }
    found
}
