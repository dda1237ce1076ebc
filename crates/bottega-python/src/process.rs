//! Forked processes, and the end of the interpreter.

use std::{
    collections::BTreeMap,
    process,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU32, AtomicU64, Ordering},
    },
};

use bottega::StopSwitch;
use pyo3::prelude::*;

use crate::errors;

/// Id of the process that has started threads of the library; 0: none has.
static USED_BY: AtomicU32 = AtomicU32::new(0);

/// The stop switches of all running work, by number.
static UNDER_WAY: Mutex<BTreeMap<u64, StopSwitch>> = Mutex::new(BTreeMap::new());

/// The number of the next work.
static NEXT: AtomicU64 = AtomicU64::new(0);

/// Returns an error in a process that was forked from one in which the library has started threads: they do not exist here, and
/// waiting for them never ends.
pub(crate) fn refuse_forked() -> PyResult<()> {
    let me = process::id();
    match USED_BY.compare_exchange(0, me, Ordering::Relaxed, Ordering::Relaxed) {
        Err(other) if other != me => Err(errors::forked()),
        _ => Ok(()),
    }
}

/// Registers work that must be stopped when the interpreter ends.
pub(crate) struct UnderWay(u64);

impl UnderWay {
    pub(crate) fn new(stop: &StopSwitch) -> Self {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        under_way().insert(number, stop.clone());
        Self(number)
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        under_way().remove(&self.0);
    }
}

/// Stops all rendering in this process. Called at the end of the interpreter.
#[pyfunction]
pub(crate) fn stop_all() {
    // Work that stops may remove itself from the list.
    let all: Vec<StopSwitch> = under_way().values().cloned().collect();
    all.iter().for_each(StopSwitch::request);
}

fn under_way() -> MutexGuard<'static, BTreeMap<u64, StopSwitch>> {
    UNDER_WAY.lock().unwrap_or_else(PoisonError::into_inner)
}
