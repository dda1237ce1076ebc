//! What is said when the user ends the process at once, by a second Ctrl-C: nothing else can be done then.

use std::sync::{Mutex, PoisonError};

static WORDS: Mutex<Option<String>> = Mutex::new(None);

/// From now on this is said.
pub(crate) fn say_if_ended_at_once(words: String) {
    *WORDS.lock().unwrap_or_else(PoisonError::into_inner) = Some(words);
}

/// From now on there is nothing to say.
pub(crate) fn say_nothing() {
    *WORDS.lock().unwrap_or_else(PoisonError::into_inner) = None;
}

/// The process ends now.
pub(crate) fn say() {
    // Whoever holds it would hold up the end.
    if let Some(words) = WORDS.try_lock().ok().and_then(|mut words| words.take()) {
        eprintln!("{words}");
    }
}
