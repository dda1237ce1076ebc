//! The switch by which a user ends a job early.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Ends a job early, from any thread: a signal handler's, say. What is painted is kept.
#[derive(Clone, Default)]
pub struct StopSwitch(Arc<Mutex<SwitchState>>);

#[derive(Default)]
struct SwitchState {
    requested: bool,
    hook: Option<Box<dyn FnMut() + Send>>,
}

impl StopSwitch {
    /// A switch that nobody has pressed.
    pub fn new() -> Self {
        Self::default()
    }

    fn lock(&self) -> MutexGuard<'_, SwitchState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks the job to stop. Again does no harm.
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

    /// Whether it was asked to.
    pub fn is_requested(&self) -> bool {
        self.lock().requested
    }

    /// What to do when it is asked; at once when it already was.
    pub(super) fn when_requested(&self, mut hook: impl FnMut() + Send + 'static) {
        let mut state = self.lock();
        if state.requested {
            drop(state);
            hook();
        } else {
            state.hook = Some(Box::new(hook));
        }
    }

    pub(super) fn forget(&self) {
        self.lock().hook = None;
    }
}

impl std::fmt::Debug for StopSwitch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StopSwitch").field("requested", &self.is_requested()).finish_non_exhaustive()
    }
}
