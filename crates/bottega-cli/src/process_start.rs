//! The start time of this process, from which a time limit counts.

use std::{sync::OnceLock, time::Instant};

/// Returns the start of the process: the time of the first call, which `main` makes before anything else.
pub(crate) fn process_start() -> Instant {
    static START: OnceLock<Instant> = OnceLock::new();
    *START.get_or_init(Instant::now)
}
