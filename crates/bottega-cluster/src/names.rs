//! Unique names and numbers.

use std::process;

use crate::clock::since_1970;

/// The most characters of a machine's name; a longer host name is truncated.
pub const MACHINE_NAME_MAX: usize = 24;

/// Returns the host name of this machine as the name of a machine: its ASCII letters, digits and hyphens before the first
/// period, at most [`MACHINE_NAME_MAX`]; `machine` if it has none.
pub fn host_name() -> String {
    plain(&gethostname::gethostname().to_string_lossy())
}

/// Returns the ASCII letters, digits and hyphens of a name before its first period, at most [`MACHINE_NAME_MAX`]; `machine` if
/// it has none.
pub(crate) fn plain(host: &str) -> String {
    let first = host.split('.').next().unwrap_or_default();
    let plain: String =
        first.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').take(MACHINE_NAME_MAX).collect();
    if plain.is_empty() { "machine".to_owned() } else { plain }
}

/// Returns a number that is unique to this moment, process and machine.
pub(crate) fn fresh_number() -> u64 {
    let machine = std::fs::read("/etc/machine-id").unwrap_or_default();
    let mut hasher = blake3::Hasher::new();
    hasher.update(&machine).update(&since_1970().as_nanos().to_le_bytes()).update(&process::id().to_le_bytes());
    let bytes = hasher.finalize();
    u64::from_le_bytes(bytes.as_bytes()[..8].try_into().unwrap_or_default()) >> 1
}
