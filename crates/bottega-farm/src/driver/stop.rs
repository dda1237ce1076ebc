//! The switch with which a user stops a job early.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A switch that stops a job early, from any thread. Rendered samples are kept. Clones share the switch.
#[derive(Clone, Default)]
pub struct StopSwitch(Arc<Mutex<SwitchState>>);

#[derive(Default)]
struct SwitchState {
    requested: bool,
    hook: Option<Box<dyn FnMut() + Send>>,
}

impl StopSwitch {
    /// Makes a switch on which no stop is requested yet.
    pub fn new() -> Self {
        Self::default()
    }

    fn lock(&self) -> MutexGuard<'_, SwitchState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Requests the job to stop, and keeps its samples. Repeated calls have no effect.
    pub fn request(&self) {
        let hook = {
            let mut state = self.lock();
            state.requested = true;
            state.hook.take()
        };
        if let Some(mut hook) = hook {
            hook();
        }
    }

    /// Returns true if a stop was requested.
    pub fn is_requested(&self) -> bool {
        self.lock().requested
    }

    /// Sets the function to call on a request; calls it at once if a stop was requested already.
    pub(super) fn when_requested(&self, mut hook: impl FnMut() + Send + 'static) {
        let mut state = self.lock();
        if state.requested {
            drop(state);
            hook();
        } else {
            state.hook = Some(Box::new(hook));
        }
    }

    /// Removes the function to call on a request.
    pub(super) fn forget(&self) {
        self.lock().hook = None;
    }
}

impl std::fmt::Debug for StopSwitch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StopSwitch").field("requested", &self.is_requested()).finish_non_exhaustive()
    }
}
