//! The state of a viewport, shared by viewers and the rendering thread.

use std::{
    sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError},
    time::{Duration, Instant},
};

use bottega_engines::{BuiltinEngine, CancelSwitch};
use bottega_image::Preview;

use crate::{error::Error, request::ViewOptions};

/// Shortest interval between two frames of the same look.
const FRAME_EVERY: Duration = Duration::from_millis(40);

/// A frame of a viewport.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ViewportFrame {
    /// Number of the frame; grows with each change.
    pub number: u64,
    /// Number of the look that the frame shows, from 0.
    pub look: u64,
    /// Samples that each pixel has at least. 0: a coarse frame, which may have fewer pixels than the viewport.
    pub samples: u32,
    /// True if the frame is denoised.
    pub is_denoised: bool,
    /// The frame as the bytes of a PNG file.
    pub png: Vec<u8>,
}

/// The state of a viewport, shared by viewers and the rendering thread.
#[derive(Default)]
pub(super) struct ViewportShared {
    state: Mutex<ViewportState>,
    /// Notified when the look changes or the viewport is closed.
    wanted: Condvar,
    /// Set when the viewport is closed.
    pub(super) closing: CancelSwitch,
    /// Called when there is something new to show.
    watcher: OnceLock<Box<dyn Fn() + Send + Sync>>,
}

#[derive(Default)]
struct ViewportState {
    view: ViewOptions,
    look: u64,
    /// The engine of the running step; `None`: no step, or one that is always completed.
    engine: Option<Arc<BuiltinEngine>>,
    /// Ends the running step.
    cancel: CancelSwitch,
    shown: Option<ShownView>,
    number: u64,
    given: Option<(u64, Instant)>,
    /// The error of the view and its remedy; `None`: no error.
    problem: Option<(String, String)>,
}

/// A running step of a look that is no longer wanted.
struct LeftStep {
    engine: Option<Arc<BuiltinEngine>>,
    cancel: CancelSwitch,
}

impl LeftStep {
    /// Drops the queued units of the step, and ends the running ones soon.
    fn end(self) {
        // Expire the queued units first, so that all of them are counted.
        if let Some(engine) = self.engine {
            engine.leave();
        }
        self.cancel.cancel();
    }
}

impl ViewportState {
    /// Takes the running step out of the state.
    fn leave(&mut self) -> LeftStep {
        LeftStep { engine: self.engine.take(), cancel: self.cancel.clone() }
    }
}

/// The view that is currently shown.
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

    /// Changes the view, and ends the running step. Returns the number of the new look.
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

    /// Closes the viewport, and ends the running step.
    pub(super) fn close(&self) {
        let left = {
            let mut state = self.state();
            self.closing.cancel();
            state.leave()
        };
        left.end();
        self.wanted.notify_all();
    }

    /// Registers a function that is called after each change; only the first call has an effect.
    pub(super) fn watch(&self, watcher: impl Fn() + Send + Sync + 'static) {
        let _ = self.watcher.set(Box::new(watcher));
    }

    /// Returns the time until a frame newer than `after` is due; `None`: there is none yet.
    pub(super) fn due(&self, after: u64) -> Option<Duration> {
        let state = self.state();
        if state.problem.is_some() {
            return Some(Duration::ZERO);
        }
        // Skip fine frames of a look that is no longer wanted: encoding and sending them delays the next look.
        let is_wanted = |shown: &&ShownView| shown.look == state.look || shown.samples == 0;
        let shown = state.shown.as_ref().filter(|_| state.number > after).filter(is_wanted)?;
        let given = state.given.filter(|&(look, _)| look == shown.look);
        Some(given.map_or(Duration::ZERO, |(_, at)| FRAME_EVERY.saturating_sub(at.elapsed())))
    }

    /// Returns the current frame if it is newer than `after` and due.
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

    /// Waits until another look than `look` is wanted. Returns its view and number; `None`: the viewport is closed.
    pub(super) fn next_look(&self, look: u64) -> Option<(ViewOptions, u64)> {
        let is_content = |state: &mut ViewportState| state.look == look && !self.closing.is_cancelled();
        let state = self.wanted.wait_while(self.state(), is_content).unwrap_or_else(PoisonError::into_inner);
        (!self.closing.is_cancelled()).then(|| (state.view.clone(), state.look))
    }

    /// Begins a step of a look on `engine`. Returns the switch that cancels it; `None`: another look is wanted.
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

    /// Notes that pixels of a preview have changed.
    pub(super) fn touch(&self, preview: &Arc<Preview>) {
        self.change(|state| state.shown.as_ref().is_some_and(|shown| Arc::ptr_eq(&shown.preview, preview)));
    }

    /// Notes the number of samples that all pixels of a look have.
    pub(super) fn note_samples(&self, look: u64, samples: u32) {
        self.change(|state| {
            if let Some(shown) = state.shown.as_mut().filter(|shown| shown.look == look && !shown.is_denoised) {
                shown.samples = samples;
            }
            true
        });
    }

    /// Notes that the wanted view failed.
    pub(super) fn fail(&self, error: &Error) {
        let problem = (error.error_chain(), error.remedy().unwrap_or_default());
        self.change(|state| {
            state.problem = Some(problem);
            true
        });
    }

    /// Changes the state, and calls the watcher if there is something new.
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
