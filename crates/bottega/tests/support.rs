//! Functions that the tests of rendering share.

use std::sync::{Mutex, MutexGuard, PoisonError};

use bottega::{Watcher, events::Event};

/// The processors and devices of this process, for one test at a time: pictures of one process share them, which some tests count and
/// others time.
pub(crate) fn processors() -> MutexGuard<'static, ()> {
    static PROCESSORS: Mutex<()> = Mutex::new(());
    PROCESSORS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An observer that keeps all events.
#[derive(Default)]
pub(crate) struct Notes(pub(crate) Mutex<Vec<Event>>);

impl Watcher for Notes {
    fn event(&self, event: Event) {
        self.0.lock().unwrap().push(event);
    }
}

impl Notes {
    /// Returns the warnings.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let message = |event: &Event| match event {
            Event::Warning { message } => Some(message.clone()),
            _ => None,
        };
        self.0.lock().unwrap().iter().filter_map(message).collect()
    }
}
