//! Ctrl-C and SIGTERM: the work stops, and is kept.

use std::{
    process::ExitCode,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use bottega::StopSwitch;

use crate::error::CliError;

/// Exit code of a work that the user stopped.
const INTERRUPTED: u8 = 130;

/// What is said when the user ends the process at once, by a second Ctrl-C: nothing else can be done then.
static PARTING: Mutex<Option<String>> = Mutex::new(None);

/// Whether the first signal ends the process at once, for there is nothing to keep.
static AT_ONCE: AtomicBool = AtomicBool::new(false);

/// A time in which the first signal ends the process at once, until this is dropped.
pub(crate) struct EndAtOnce(());

impl EndAtOnce {
    pub(crate) fn begin() -> Self {
        AT_ONCE.store(true, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for EndAtOnce {
    fn drop(&mut self) {
        AT_ONCE.store(false, Ordering::SeqCst);
    }
}

/// Ctrl-C and SIGTERM stop the work and keep it; a second one ends the process at once.
pub(crate) fn stop_on_signal(stop: &StopSwitch) -> Result<(), CliError> {
    let stop = stop.clone();
    ctrlc::set_handler(move || {
        if stop.is_requested() || AT_ONCE.load(Ordering::SeqCst) {
            // Whoever holds it would hold up the end.
            if let Some(words) = PARTING.try_lock().ok().and_then(|mut words| words.take()) {
                eprintln!("{words}");
            }
            std::process::exit(i32::from(INTERRUPTED));
        }
        stop.request();
    })
    .map_err(|error| CliError::failed(format!("cannot watch for Ctrl-C: {error}"), "this is unexpected; report it"))
}

/// From now on this is said where the user ends the process at once; `None`: nothing.
pub(crate) fn say_if_ended_at_once(words: Option<String>) {
    *PARTING.lock().unwrap_or_else(PoisonError::into_inner) = words;
}

/// How a work ends that the user stopped.
pub(crate) fn interrupted() -> ExitCode {
    ExitCode::from(INTERRUPTED)
}
