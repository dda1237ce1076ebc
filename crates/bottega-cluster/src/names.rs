//! Names and numbers that nobody else has.

use std::process;

use crate::clock::since_1970;

/// Characters that the name of a machine has at most; of a host's longer name the first ones are used.
pub const MACHINE_NAME_MAX: usize = 24;

/// The name of this machine, of letters, digits and hyphens.
pub fn host_name() -> String {
    plain(&gethostname::gethostname().to_string_lossy())
}

/// The part of a name before its first full stop, as far as it is of letters, digits and hyphens.
pub(crate) fn plain(host: &str) -> String {
    let first = host.split('.').next().unwrap_or_default();
    let plain: String =
        first.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').take(MACHINE_NAME_MAX).collect();
    if plain.is_empty() { "machine".to_owned() } else { plain }
}

/// A number of this moment, in this process, on this machine.
pub(crate) fn fresh_number() -> u64 {
    let machine = std::fs::read("/etc/machine-id").unwrap_or_default();
    let mut hasher = blake3::Hasher::new();
    hasher.update(&machine).update(&since_1970().as_nanos().to_le_bytes()).update(&process::id().to_le_bytes());
    let bytes = hasher.finalize();
    u64::from_le_bytes(bytes.as_bytes()[..8].try_into().unwrap_or_default()) >> 1
}
