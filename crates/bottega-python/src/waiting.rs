//! Work on another thread, for which the calling thread waits: it runs callbacks, and sees Ctrl-C.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel},
    },
    thread,
    time::Duration,
};

use bottega::{Event, StopSwitch, Watcher};
use pyo3::{exceptions::PyKeyboardInterrupt, prelude::*};

use crate::{errors, process::UnderWay, values::to_python};

/// How often the calling thread looks for Ctrl-C.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Events that wait for a callback, at most; painters wait where there are more.
const EVENTS_MAX: usize = 4096;

/// What the working thread says.
enum News<T> {
    Told(Box<Event>),
    Over(T),
}

/// Who is told on the working threads. It passes on what Python wants to hear.
struct Teller<T> {
    news: SyncSender<News<T>>,
    /// Whether there is a callback; without it only warnings are heard.
    hears_all: bool,
    shown: Option<ShowPreview>,
}

/// Takes the bytes of a PNG file.
pub(crate) type ShowPreview = Arc<dyn Fn(Vec<u8>) + Send + Sync>;

impl<T: Send> Watcher for Teller<T> {
    fn told(&self, event: Event) {
        if self.hears_all || matches!(event, Event::Warning { .. }) {
            // Nobody hears it any more where the calling thread has given up.
            _ = self.news.send(News::Told(Box::new(event)));
        }
    }

    fn previewed(&self, png: Vec<u8>) {
        if let Some(show) = &self.shown {
            show(png);
        }
    }
}

/// How the calling thread takes part.
pub(crate) struct Caller<'py> {
    pub(crate) py: Python<'py>,
    /// Called with each event, as a dictionary.
    pub(crate) on_event: Option<Bound<'py, PyAny>>,
    /// How the work is stopped.
    pub(crate) stop: StopSwitch,
    /// Who is shown previews.
    pub(crate) shown: Option<ShowPreview>,
    /// How many calls up the stack a warning is shown at: 1 is the Python code that calls this module.
    pub(crate) warn_level: u8,
    /// Whether work that is to stop is waited for: it hands over what it has, or takes back what it has sent.
    pub(crate) waits_for_end: bool,
}

/// How work came to its end.
pub(crate) enum Ending<T> {
    /// By itself, or stopped by its switch.
    Whole(T),
    /// Stopped by Ctrl-C.
    Interrupted(T),
}

impl<'py> Caller<'py> {
    pub(crate) fn new(py: Python<'py>) -> Self {
        Self { py, on_event: None, stop: StopSwitch::new(), shown: None, warn_level: 2, waits_for_end: false }
    }

    /// Does `work` on a thread of its own and waits for it, without the interpreter's lock.
    ///
    /// # Errors
    /// What a callback or a handler of a signal raises: the work is stopped then, and its end waited for where the caller says so. A
    /// second Ctrl-C does not wait.
    pub(crate) fn wait_for<T: Send + 'static>(
        self,
        work: impl FnOnce(Arc<dyn Watcher>, &StopSwitch) -> T + Send + 'static,
    ) -> PyResult<Ending<T>> {
        let (news, told) = sync_channel(EVENTS_MAX);
        let teller = Teller { news: news.clone(), hears_all: self.on_event.is_some(), shown: self.shown.clone() };
        let stop = self.stop.clone();
        let under_way = UnderWay::new(&stop);
        thread::spawn(move || {
            let over = work(Arc::new(teller), &stop);
            drop(under_way);
            // Nobody waits any more where the calling thread has given up.
            _ = news.send(News::Over(over));
        });
        self.listen(told)
    }

    fn listen<T: Send>(&self, mut told: Receiver<News<T>>) -> PyResult<Ending<T>> {
        let mut raised: Option<PyErr> = None;
        loop {
            let (next, again) = self.py.detach(move || (told.recv_timeout(LOOK_EVERY), told));
            told = again;
            let heard = match next {
                Ok(News::Over(over)) => return self.end(over, raised),
                Ok(News::Told(event)) if raised.is_none() => self.hear(&event),
                Ok(News::Told(_)) | Err(RecvTimeoutError::Timeout) => Ok(()),
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
    /// What there is where nothing was painted: Ctrl-C leaves nothing then.
    pub(crate) fn whole(self) -> PyResult<T> {
        match self {
            Self::Whole(value) => Ok(value),
            Self::Interrupted(_) => Err(errors::interrupted(None)),
        }
    }
}
