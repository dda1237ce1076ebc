//! Engines that this process does not use any more, because they failed again and again.

use std::{
    collections::BTreeMap,
    sync::{Mutex, MutexGuard, PoisonError},
};

use super::{error::EngineFault, locate::Located};

/// By name and version: how often, and how the last time.
type Failed = BTreeMap<(String, String), (u32, String)>;

fn failed() -> MutexGuard<'static, Failed> {
    static FAILED: Mutex<Failed> = Mutex::new(BTreeMap::new());
    FAILED.lock().unwrap_or_else(PoisonError::into_inner)
}

fn key(engine: &Located) -> (String, String) {
    (engine.manifest().name.clone(), engine.version.to_string())
}

/// From now on this version of the engine is not used here.
pub(super) fn put(engine: &Located, failures: u32, last: String) {
    failed().insert(key(engine), (failures, last));
}

/// Refuses an engine that is not used here any more.
pub(super) fn check(engine: &Located) -> Result<(), EngineFault> {
    match failed().get(&key(engine)) {
        Some((failures, last)) => Err(EngineFault::Quarantined { failures: *failures, last: last.clone() }),
        None => Ok(()),
    }
}
