//! Ctrl-C and SIGTERM: stop the work and keep its results.

use std::{
    process::ExitCode,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use bottega::StopSwitch;

use crate::error::CliError;

/// The exit code of work that the user stopped.
const INTERRUPTED: u8 = 130;

/// The message printed when a second Ctrl-C ends the process at once.
static PARTING: Mutex<Option<String>> = Mutex::new(None);

/// True while the first signal ends the process at once, because there is nothing to keep.
static AT_ONCE: AtomicBool = AtomicBool::new(false);

/// A guard: until it is dropped, the first signal ends the process at once.
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

/// Stops the work on Ctrl-C or SIGTERM and keeps its results; a second signal ends the process at once.
pub(crate) fn stop_on_signal(stop: &StopSwitch) -> Result<(), CliError> {
    let stop = stop.clone();
    ctrlc::set_handler(move || {
        if stop.is_requested() || AT_ONCE.load(Ordering::SeqCst) {
            // Do not wait for the lock: that may delay the exit.
            if let Some(words) = PARTING.try_lock().ok().and_then(|mut words| words.take()) {
                eprintln!("{words}");
            }
            std::process::exit(i32::from(INTERRUPTED));
        }
        stop.request();
    })
    .map_err(|error| CliError::failed(format!("cannot watch for Ctrl-C: {error}"), "this is unexpected; report it"))
}

/// Sets the message printed when the user ends the process at once; `None`: no message.
pub(crate) fn say_if_ended_at_once(words: Option<String>) {
    *PARTING.lock().unwrap_or_else(PoisonError::into_inner) = words;
}

/// Returns the exit code of work that the user stopped.
pub(crate) fn interrupted() -> ExitCode {
    ExitCode::from(INTERRUPTED)
}
