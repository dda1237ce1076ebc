//! The clock of this machine.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Returns the time since 1970.
pub(crate) fn since_1970() -> Duration {
    // A clock before 1970 was never set: count it as 1970.
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}
