//! Retries while a farm does not answer.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    thread::{self, Thread},
    time::Duration,
};

use bottega_farm::StopSwitch;

use crate::{error::Error, server::room::MAKE_ROOM};

const BETWEEN_TRIES: Duration = Duration::from_millis(250);

/// Retries until success, a lasting error, or a stop. A server that is down may come back, and a full disk may be cleaned
/// up; until then the work so far is kept.
///
/// - `say`: informs the user once of what it waits for.
pub(crate) fn patiently<T>(
    stop: &StopSwitch,
    say: impl Fn(&str),
    attempt: impl FnMut() -> Result<T, Error>,
) -> Result<T, Error> {
    patiently_until(|| stop.is_requested(), say, attempt)
}

/// Retries like [`patiently`], or until `is_enough` returns `true`.
pub(crate) fn patiently_until<T>(
    is_enough: impl Fn() -> bool,
    say: impl Fn(&str),
    mut attempt: impl FnMut() -> Result<T, Error>,
) -> Result<T, Error> {
    let mut has_said = false;
    loop {
        match attempt() {
            Err(error) if error.may_pass() && !is_enough() => {
                if !std::mem::replace(&mut has_said, true) {
                    let is_full = matches!(&error, Error::Blob(error) if error.is_full);
                    say(&if is_full {
                        format!("the farm's server has no room: waiting for it. {MAKE_ROOM}")
                    } else {
                        "the farm does not carry out a request: waiting for it".to_owned()
                    });
                }
                tracing::debug!(%error, "trying again");
            }
            result => return result,
        }
        thread::sleep(BETWEEN_TRIES);
    }
}

/// Calls `tick` at intervals while `work` runs, for long work such as loading a scene or compiling kernels.
pub(crate) fn meanwhile<T>(every: Duration, mut tick: impl FnMut() + Send, work: impl FnOnce() -> T) -> T {
    /// Stops the ticker thread when dropped, even if `work` panics.
    struct Done<'a>(&'a AtomicBool, Thread);
    impl Drop for Done<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
            self.1.unpark();
        }
    }
    let is_done = AtomicBool::new(false);
    thread::scope(|scope| {
        let ticker = scope.spawn(|| {
            while !is_done.load(Ordering::Relaxed) {
                tick();
                thread::park_timeout(every);
            }
        });
        let _done = Done(&is_done, ticker.thread().clone());
        work()
    })
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use bottega_agents::driver::nats::BlobError;

    use super::*;

    fn wrong(is_lasting: bool) -> Error {
        Error::Blob(BlobError { name: "b".to_owned(), reason: "r".to_owned(), is_lasting, is_full: false })
    }

    #[test]
    fn a_passing_failure_is_waited_for_and_reported_once() {
        let (tries, said) = (Cell::new(0), Cell::new(0));
        let done = patiently(
            &StopSwitch::new(),
            |_| said.set(said.get() + 1),
            || {
                tries.set(tries.get() + 1);
                if tries.get() < 4 { Err(wrong(false)) } else { Ok(7) }
            },
        );
        assert_eq!((done.unwrap(), tries.get(), said.get()), (7, 4, 1));
    }

    #[test]
    fn what_lasts_is_an_error_and_so_is_all_when_the_user_wants_to_stop() {
        let stop = StopSwitch::new();
        let silent = |_: &str| panic!("there is nothing to wait for");
        assert!(patiently(&stop, silent, || Err::<(), _>(wrong(true))).is_err());
        assert!(patiently(&stop, silent, || Err::<(), _>(Error::failed("p", "r"))).is_err());
        stop.request();
        assert!(patiently(&stop, silent, || Err::<(), _>(wrong(false))).is_err());
    }
}
