//! Functions that the tests of rendering share.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// The processors and devices of this process, for one test at a time: pictures of one process share them, which some tests count and
/// others time.
pub(crate) fn processors() -> MutexGuard<'static, ()> {
    static PROCESSORS: Mutex<()> = Mutex::new(());
    PROCESSORS.lock().unwrap_or_else(PoisonError::into_inner)
}
