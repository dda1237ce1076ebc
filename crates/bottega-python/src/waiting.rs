//! Work on another thread. The calling thread waits for it, runs callbacks, and sees Ctrl-C.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel},
    },
    thread,
    time::Duration,
};

use bottega::{Event, StopSwitch, Watcher};
use bottega_image::Tile;
use pyo3::{exceptions::PyKeyboardInterrupt, prelude::*};

use crate::{errors, live::LivePicture, process::UnderWay, values::to_python};

/// Interval between checks for Ctrl-C.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Largest number of events queued for a callback; rendering threads block if there are more.
const EVENTS_MAX: usize = 4096;

/// A message of the working thread.
enum CallMessage<T> {
    Happened(Box<Event>),
    Over(T),
}

/// The watcher on the working threads. It forwards the events that Python needs.
struct Teller<T> {
    sender: SyncSender<CallMessage<T>>,
    /// True if there is a callback; otherwise only warnings are forwarded.
    hears_all: bool,
    live: Option<Arc<LivePicture>>,
}

impl<T: Send> Watcher for Teller<T> {
    fn event(&self, event: Event) {
        if self.hears_all || matches!(event, Event::Warning { .. }) {
            // The receiver is gone if the calling thread has given up.
            _ = self.sender.send(CallMessage::Happened(Box::new(event)));
        }
    }

    fn previewed(&self, png: Vec<u8>) {
        if let Some(live) = &self.live {
            live.previewed(png);
        }
    }

    fn tile(&self, tile: &Tile) {
        if let Some(live) = &self.live {
            live.painted(tile);
        }
    }
}

/// The settings of a call that waits for work.
pub(crate) struct Caller<'py> {
    pub(crate) py: Python<'py>,
    /// Called with each event, as a dictionary.
    pub(crate) on_event: Option<Bound<'py, PyAny>>,
    /// The switch that stops the work.
    pub(crate) stop: StopSwitch,
    /// The unfinished picture, updated meanwhile; `None`: it is not kept.
    pub(crate) live: Option<Arc<LivePicture>>,
    /// Stack level at which a warning is reported; 1: the Python code that calls this module.
    pub(crate) warn_level: u8,
    /// True if the end of stopped work is awaited, because it returns a partial result or takes back what it has sent.
    pub(crate) waits_for_end: bool,
}

/// The result of work, by the way it ended.
pub(crate) enum Ending<T> {
    /// The work ended by itself, or was stopped by its switch.
    Whole(T),
    /// The work was stopped by Ctrl-C.
    Interrupted(T),
}

impl<'py> Caller<'py> {
    pub(crate) fn new(py: Python<'py>) -> Self {
        Self { py, on_event: None, stop: StopSwitch::new(), live: None, warn_level: 2, waits_for_end: false }
    }

    /// Runs `work` on its own thread and waits for it, without the interpreter's lock.
    ///
    /// # Errors
    /// The exception of a callback or a signal handler. The work is then stopped, and its end awaited if `waits_for_end` is
    /// set; a second Ctrl-C does not wait.
    pub(crate) fn wait_for<T: Send + 'static>(
        self,
        work: impl FnOnce(Arc<dyn Watcher>, &StopSwitch) -> T + Send + 'static,
    ) -> PyResult<Ending<T>> {
        let (sender, messages) = sync_channel(EVENTS_MAX);
        let teller = Teller { sender: sender.clone(), hears_all: self.on_event.is_some(), live: self.live.clone() };
        let stop = self.stop.clone();
        let under_way = UnderWay::new(&stop);
        thread::spawn(move || {
            let over = work(Arc::new(teller), &stop);
            drop(under_way);
            // The receiver is gone if the calling thread has given up.
            _ = sender.send(CallMessage::Over(over));
        });
        self.listen(messages)
    }

    fn listen<T: Send>(&self, mut messages: Receiver<CallMessage<T>>) -> PyResult<Ending<T>> {
        let mut raised: Option<PyErr> = None;
        loop {
            let (next, again) = self.py.detach(move || (messages.recv_timeout(LOOK_EVERY), messages));
            messages = again;
            let heard = match next {
                Ok(CallMessage::Over(over)) => return self.end(over, raised),
                Ok(CallMessage::Happened(event)) if raised.is_none() => self.hear(&event),
                Ok(CallMessage::Happened(_)) | Err(RecvTimeoutError::Timeout) => Ok(()),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(errors::failed("the painting thread has failed", "this is unexpected; report it"));
                }
            };
            if let Err(error) = heard.and_then(|()| self.py.check_signals()) {
                self.stop.request();
                if raised.is_some() || !self.waits_for_end {
                    return Err(error);
                }
                raised = Some(error);
            }
        }
    }

    fn end<T>(&self, over: T, raised: Option<PyErr>) -> PyResult<Ending<T>> {
        match raised {
            None => Ok(Ending::Whole(over)),
            Some(error) if error.is_instance_of::<PyKeyboardInterrupt>(self.py) => Ok(Ending::Interrupted(over)),
            Some(error) => Err(error),
        }
    }

    fn hear(&self, event: &Event) -> PyResult<()> {
        if let Some(callback) = &self.on_event {
            callback.call1((to_python(self.py, event)?,))?;
        } else if let Event::Warning { message } = event {
            let category = self.py.import("bottega._errors")?.getattr("RenderWarning")?;
            self.py.import("warnings")?.call_method1("warn", (message.as_str(), category, self.warn_level))?;
        }
        Ok(())
    }
}

impl<T> Ending<T> {
    /// Returns the value; after Ctrl-C an exception without a picture.
    pub(crate) fn whole(self) -> PyResult<T> {
        match self {
            Self::Whole(value) => Ok(value),
            Self::Interrupted(_) => Err(errors::interrupted(None)),
        }
    }
}
