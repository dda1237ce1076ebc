//! The start of this process, from which a time for a picture counts.

use std::{sync::OnceLock, time::Instant};

/// Returns when the process began: the first call, which `main` makes before anything else.
pub(crate) fn process_start() -> Instant {
    static START: OnceLock<Instant> = OnceLock::new();
    *START.get_or_init(Instant::now)
}
