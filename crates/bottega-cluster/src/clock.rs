//! The clock of this machine.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Time since 1970.
pub(crate) fn since_1970() -> Duration {
    // A clock that stands before 1970 has been set by nobody.
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}
