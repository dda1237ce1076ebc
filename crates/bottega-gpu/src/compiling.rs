//! A list of the devices of this process that are compiling kernels. A driver takes seconds, a software adapter a minute or more.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

static DEVICES: Mutex<Vec<(u64, String, Instant)>> = Mutex::new(Vec::new());

/// A guard that lists a device as compiling until it is dropped.
pub(crate) struct CompilingGuard(u64);

impl CompilingGuard {
    /// Lists the device with this name as compiling from now on.
    pub(crate) fn begin(name: &str) -> Self {
        let mut devices = devices();
        let number = devices.iter().map(|(number, ..)| number + 1).max().unwrap_or(0);
        devices.push((number, name.to_owned(), Instant::now()));
        Self(number)
    }
}

impl Drop for CompilingGuard {
    fn drop(&mut self) {
        devices().retain(|(number, ..)| *number != self.0);
    }
}

fn devices() -> MutexGuard<'static, Vec<(u64, String, Instant)>> {
    DEVICES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the names of the devices that are compiling kernels, and how long each has been compiling.
pub fn compiling() -> Vec<(String, Duration)> {
    devices().iter().map(|(_, name, since)| (name.clone(), since.elapsed())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_named_while_it_compiles() {
        let is_named = |name: &str| compiling().iter().any(|(known, _)| known == name);
        let (one, other) = (CompilingGuard::begin("one"), CompilingGuard::begin("other"));
        assert!(is_named("one") && is_named("other"));
        drop(one);
        assert!(!is_named("one") && is_named("other"));
        drop(other);
        assert!(!is_named("other"));
    }
}
