//! The state of a viewport, shared by those who look and the one who paints.

use std::{
    sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError},
    time::{Duration, Instant},
};

use bottega_engines::{BuiltinEngine, CancelSwitch};
use bottega_image::Preview;

use crate::{error::Error, request::ViewOptions};

/// A picture of the same look is given so often at most.
const FRAME_EVERY: Duration = Duration::from_millis(40);

/// What is to be seen of a viewport.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ViewportFrame {
    /// It grows with each change.
    pub number: u64,
    /// Of which look it is: the first is 0.
    pub look: u64,
    /// Samples that each pixel has; some may have more. 0: it is coarse, and may have fewer pixels than the viewport.
    pub samples: u32,
    /// Whether noise was removed.
    pub is_denoised: bool,
    /// A PNG file.
    pub png: Vec<u8>,
}

/// What those who look and the one who paints share.
#[derive(Default)]
pub(super) struct ViewportShared {
    state: Mutex<ViewportState>,
    /// Something else is wanted.
    wanted: Condvar,
    /// Pressed when the viewport is closed.
    pub(super) closing: CancelSwitch,
    /// Is told when there is something new.
    watcher: OnceLock<Box<dyn Fn() + Send + Sync>>,
}

#[derive(Default)]
struct ViewportState {
    view: ViewOptions,
    look: u64,
    /// Paints the step that is under way, unless that goes on to its end.
    engine: Option<Arc<BuiltinEngine>>,
    /// Ends the step.
    cancel: CancelSwitch,
    shown: Option<ShownView>,
    number: u64,
    given: Option<(u64, Instant)>,
    /// Why nothing is shown, and what to do about it.
    problem: Option<(String, String)>,
}

/// A step that nobody looks at any more.
struct LeftStep {
    engine: Option<Arc<BuiltinEngine>>,
    cancel: CancelSwitch,
}

impl LeftStep {
    /// What waits of it is painted by nobody; what is under way ends soon.
    fn end(self) {
        // First the life times, so that all units that still wait are counted.
        if let Some(engine) = self.engine {
            engine.leave();
        }
        self.cancel.cancel();
    }
}

impl ViewportState {
    /// Leaves the step that is under way.
    fn leave(&mut self) -> LeftStep {
        LeftStep { engine: self.engine.take(), cancel: self.cancel.clone() }
    }
}

/// What is shown.
#[derive(Clone)]
pub(super) struct ShownView {
    pub(super) preview: Arc<Preview>,
    pub(super) look: u64,
    pub(super) samples: u32,
    pub(super) is_denoised: bool,
}

impl ViewportShared {
    pub(super) fn new(view: ViewOptions) -> Self {
        Self { state: Mutex::new(ViewportState { view, ..ViewportState::default() }), ..Self::default() }
    }

    fn state(&self) -> MutexGuard<'_, ViewportState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// From now on something else is wanted. Returns the number of the look.
    pub(super) fn look(&self, view: &ViewOptions) -> u64 {
        let (look, left) = {
            let mut state = self.state();
            state.view = view.clone();
            state.look += 1;
            (state.look, state.leave())
        };
        left.end();
        self.wanted.notify_all();
        look
    }

    /// Nothing is wanted any more.
    pub(super) fn close(&self) {
        let left = {
            let mut state = self.state();
            self.closing.cancel();
            state.leave()
        };
        left.end();
        self.wanted.notify_all();
    }

    /// Has `watcher` told of all that is new; a second one is told nothing.
    pub(super) fn watch(&self, watcher: impl Fn() + Send + Sync + 'static) {
        let _ = self.watcher.set(Box::new(watcher));
    }

    /// In how long there is something newer than the frame `after`.
    pub(super) fn due(&self, after: u64) -> Option<Duration> {
        let state = self.state();
        if state.problem.is_some() {
            return Some(Duration::ZERO);
        }
        // A fine frame of a view that is left would delay the first one of the next: it takes long to encode and to send.
        let is_wanted = |shown: &&ShownView| shown.look == state.look || shown.samples == 0;
        let shown = state.shown.as_ref().filter(|_| state.number > after).filter(is_wanted)?;
        let given = state.given.filter(|&(look, _)| look == shown.look);
        Some(given.map_or(Duration::ZERO, |(_, at)| FRAME_EVERY.saturating_sub(at.elapsed())))
    }

    /// What is newer than the frame `after`, if it is time to show it.
    pub(super) fn frame(&self, after: u64) -> Result<Option<ViewportFrame>, Error> {
        if self.due(after) != Some(Duration::ZERO) {
            return Ok(None);
        }
        let (shown, number) = {
            let mut state = self.state();
            if let Some((problem, remedy)) = &state.problem {
                return Err(Error::usage(problem, remedy));
            }
            let Some(shown) = state.shown.clone() else { return Ok(None) };
            state.given = Some((shown.look, Instant::now()));
            (shown, state.number)
        };
        let ShownView { preview, look, samples, is_denoised } = shown;
        Ok(Some(ViewportFrame { number, look, samples, is_denoised, png: preview.to_png()? }))
    }

    /// Waits for another look than this one. Returns it with its number; `None`: the viewport is closed.
    pub(super) fn next_look(&self, look: u64) -> Option<(ViewOptions, u64)> {
        let is_content = |state: &mut ViewportState| state.look == look && !self.closing.is_cancelled();
        let state = self.wanted.wait_while(self.state(), is_content).unwrap_or_else(PoisonError::into_inner);
        (!self.closing.is_cancelled()).then(|| (state.view.clone(), state.look))
    }

    /// Begins a step of a look, which `engine` paints. Returns what will end it; `None`: something else is wanted.
    pub(super) fn begin(&self, look: u64, engine: &Arc<BuiltinEngine>) -> Option<CancelSwitch> {
        let mut state = self.state();
        if state.look != look || self.closing.is_cancelled() {
            return None;
        }
        state.engine = Some(Arc::clone(engine));
        state.cancel = CancelSwitch::default();
        Some(state.cancel.clone())
    }

    pub(super) fn show(&self, shown: ShownView) {
        self.change(|state| {
            state.shown = Some(shown);
            true
        });
    }

    /// Some pixels of a preview are painted.
    pub(super) fn touch(&self, preview: &Arc<Preview>) {
        self.change(|state| state.shown.as_ref().is_some_and(|shown| Arc::ptr_eq(&shown.preview, preview)));
    }

    /// All pixels have so many samples.
    pub(super) fn note_samples(&self, look: u64, samples: u32) {
        self.change(|state| {
            if let Some(shown) = state.shown.as_mut().filter(|shown| shown.look == look && !shown.is_denoised) {
                shown.samples = samples;
            }
            true
        });
    }

    /// The scene cannot be seen as it is wanted.
    pub(super) fn fail(&self, error: &Error) {
        let problem = (error.error_chain(), error.remedy().unwrap_or_default());
        self.change(|state| {
            state.problem = Some(problem);
            true
        });
    }

    /// Changes what is shown, and tells of it if there is anything new.
    fn change(&self, change: impl FnOnce(&mut ViewportState) -> bool) {
        let is_new = {
            let mut state = self.state();
            let is_new = change(&mut state);
            state.number += u64::from(is_new);
            is_new
        };
        if let Some(watcher) = self.watcher.get().filter(|_| is_new) {
            watcher();
        }
    }
}
