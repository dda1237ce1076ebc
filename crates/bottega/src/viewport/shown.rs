//! The state of a viewport, shared by viewers and the rendering thread.

use std::{
    borrow::Cow,
    sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError},
    time::{Duration, Instant},
};

use bottega_engines::{BuiltinEngine, CancelSwitch};
use bottega_image::{AovSet, Layout, Rect, Tile};
use bottega_scene::Loaded;

use super::{
    follower::{ViewportFollower, ViewportLook},
    samples::{SamplePool, ViewportSamples},
    screen::ViewportScreen,
};
use crate::{
    error::Error,
    request::{Request, ViewOptions},
    session::Session,
};

/// Shortest interval between two frames of the same look.
const FRAME_EVERY: Duration = Duration::from_millis(40);

/// A frame of a viewport, with its pixels for display.
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

/// The state of a linear frame of a viewport, whose pixels [`super::Viewport::copy_linear`] copies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinearFrameState {
    /// Number of the frame; grows with each change.
    pub number: u64,
    /// Number of the look that the frame shows, from 0.
    pub look: u64,
    /// Samples that each pixel has at least. 0: a coarse frame.
    pub samples: u32,
    /// True if the frame is denoised.
    pub is_denoised: bool,
}

/// A change that the rendering thread is to make before it renders on.
pub(super) enum ViewportWish {
    /// Another view of the same scene.
    View(ViewOptions),
    /// Another state of the scene, as this request sees it.
    Scene(Box<Request>, Box<Loaded>),
}

/// The state of a viewport, shared by viewers and the rendering thread.
#[derive(Default)]
pub(super) struct ViewportShared {
    state: Mutex<ViewportState>,
    /// True if linear frames are made.
    pub(super) is_linear: bool,
    /// Notified when the look changes or the viewport is closed.
    wanted: Condvar,
    /// Notified when there is something new to show, and when the viewport is closed.
    changed: Condvar,
    /// Set when the viewport is closed.
    pub(super) closing: CancelSwitch,
    /// Called when there is something new to show.
    watcher: OnceLock<Box<dyn Fn() + Send + Sync>>,
    /// Receives the looks, if other processes render samples of them.
    follower: OnceLock<Box<dyn ViewportFollower>>,
    /// The samples of all processes, if there is a follower.
    pool: Mutex<SamplePool>,
}

#[derive(Default)]
struct ViewportState {
    /// The change that the rendering thread has not begun with; `None`: there is none.
    wish: Option<ViewportWish>,
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
    /// The look that is rendered, and the rectangle of its pixels.
    current: Option<(ViewportLook, Rect)>,
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
    pub(super) screen: Arc<ViewportScreen>,
    pub(super) look: u64,
    pub(super) samples: u32,
    pub(super) is_denoised: bool,
}

impl ViewportShared {
    /// Makes the state of a viewport that shows nothing yet.
    pub(super) fn new(is_linear: bool) -> Self {
        Self { is_linear, ..Self::default() }
    }

    fn state(&self) -> MutexGuard<'_, ViewportState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Requests a change, and ends the running step. A change that has not begun is replaced. Returns the number of the new look.
    pub(super) fn look(&self, wish: ViewportWish) -> u64 {
        let (look, left) = {
            let mut state = self.state();
            state.wish = Some(wish);
            state.look += 1;
            (state.look, state.leave())
        };
        left.end();
        self.wanted.notify_all();
        if let Some(follower) = self.follower.get() {
            follower.ends_before(look);
        }
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
        self.changed.notify_all();
    }

    /// Waits until there is a frame newer than `after`, the view has failed or the viewport is closed. Returns false after
    /// `timeout`.
    pub(super) fn wait(&self, after: u64, timeout: Duration) -> bool {
        let is_old = |state: &mut ViewportState| {
            let has_new = state.number > after && state.shown.is_some();
            !(has_new || state.problem.is_some() || self.closing.is_cancelled())
        };
        let waited = self.changed.wait_timeout_while(self.state(), timeout, is_old);
        !waited.unwrap_or_else(PoisonError::into_inner).1.timed_out()
    }

    /// Copies the current linear frame, the lowest row first. `None`: there is none, or it has another size.
    ///
    /// - `size`: columns and rows of `values`, which has four numbers per pixel.
    pub(super) fn copy_linear(&self, size: (u32, u32), values: &mut [f32]) -> Result<Option<LinearFrameState>, Error> {
        let (shown, number) = {
            let state = self.state();
            if let Some((problem, remedy)) = &state.problem {
                return Err(Error::usage(problem, remedy));
            }
            let Some(shown) = state.shown.clone() else { return Ok(None) };
            (shown, state.number)
        };
        let ShownView { screen, look, samples, is_denoised } = shown;
        if screen.linear_region().is_none_or(|region| (region.width(), region.height()) != size) {
            return Ok(None);
        }
        screen.copy_linear(values);
        Ok(Some(LinearFrameState { number, look, samples, is_denoised }))
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

    /// Returns the current frame if it is newer than `after` and due, else `None`.
    ///
    /// # Errors
    /// The wanted view failed, or the frame cannot be encoded.
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
        let ShownView { screen, look, samples, is_denoised } = shown;
        Ok(Some(ViewportFrame { number, look, samples, is_denoised, png: screen.to_png()? }))
    }

    /// Waits until another look than `look` is wanted. Returns the change to it and its number; `None`: the viewport is closed.
    pub(super) fn next_look(&self, look: u64) -> Option<(ViewportWish, u64)> {
        let is_content = |state: &mut ViewportState| state.look == look && !self.closing.is_cancelled();
        let mut state = self.wanted.wait_while(self.state(), is_content).unwrap_or_else(PoisonError::into_inner);
        let wish = state.wish.take()?;
        (!self.closing.is_cancelled()).then_some((wish, state.look))
    }

    /// Registers the receiver of looks, and tells it of the current one. Only the first call has an effect.
    pub(super) fn follow(&self, follower: Box<dyn ViewportFollower>) {
        if self.follower.set(follower).is_err() {
            return;
        }
        // The lock is held meanwhile, so that no later look is reported first.
        let state = self.state();
        if let (Some((look, region)), Some(follower)) = (&state.current, self.follower.get()) {
            self.pool().begin(look.number, *region);
            follower.begins(look.clone());
        }
    }

    /// Notes that a look begins, before its first step.
    pub(super) fn begin_look(&self, session: &Session, number: u64) {
        let region = session.settings().crop;
        let mut state = self.state();
        state.current = ViewportLook::of(session, number).map(|look| (look, region));
        if let (Some((look, _)), Some(follower)) = (&state.current, self.follower.get()) {
            self.pool().begin(number, region);
            follower.begins(look.clone());
        }
    }

    /// Notes that a look has all its samples.
    pub(super) fn rest(&self, look: u64) {
        if let Some(follower) = self.follower.get() {
            follower.rests(look);
        }
    }

    fn pool(&self) -> MutexGuard<'_, SamplePool> {
        self.pool.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Shows running sums of this process, with the samples of other processes.
    pub(super) fn show_own(&self, screen: &ViewportScreen, look: u64, tile: &Tile) {
        if self.follower.get().is_none() {
            return screen.show(tile);
        }
        let mut merged = tile.clone();
        {
            let mut pool = self.pool();
            pool.take_own(look, tile);
            pool.merge_into(&mut merged);
        }
        screen.show(&merged);
    }

    /// Shows the samples of all processes in a rectangle of a look.
    pub(super) fn show_merged(&self, screen: &ViewportScreen, look: u64, rect: Rect) {
        if let Some(merged) = self.pool().merged(look, rect, Layout::new(AovSet::NONE)) {
            screen.show(&merged);
        }
    }

    /// Returns a tile of this process with the colors of the samples of all processes.
    pub(super) fn with_others<'tile>(&self, look: u64, tile: &'tile Tile) -> Cow<'tile, Tile> {
        if self.follower.get().is_none() {
            return Cow::Borrowed(tile);
        }
        let mut merged = tile.clone();
        let mut pool = self.pool();
        pool.take_own(look, tile);
        pool.merge_into(&mut merged);
        Cow::Owned(merged)
    }

    /// Returns the samples from other processes that each pixel of the current look has at least.
    pub(super) fn samples_of_others(&self) -> u32 {
        if self.follower.get().is_some() { self.pool().others_min() } else { 0 }
    }

    /// Adds samples of another process, and shows them. Returns false if they are of another look, or do not fit.
    pub(super) fn add(&self, samples: &ViewportSamples) -> bool {
        let total = {
            let mut pool = self.pool();
            if !pool.add(samples) {
                return false;
            }
            pool.ends_with(samples.rect).then(|| pool.all_min())
        };
        let shown = self.state().shown.clone();
        // Coarse frames have other pixels, and denoised ones wait for the next denoising.
        let is_meant =
            |shown: &ShownView| shown.look == samples.look && !shown.is_denoised && shown.screen.shows_pixels();
        if let Some(ShownView { screen, .. }) = shown.filter(is_meant) {
            self.show_merged(&screen, samples.look, samples.rect);
            match total {
                Some(total) => self.note_samples(samples.look, total),
                None => self.touch(&screen),
            }
        }
        true
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

    /// Notes that pixels of a screen have changed.
    pub(super) fn touch(&self, screen: &Arc<ViewportScreen>) {
        self.change(|state| state.shown.as_ref().is_some_and(|shown| Arc::ptr_eq(&shown.screen, screen)));
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
        if is_new {
            self.changed.notify_all();
        }
        if let Some(watcher) = self.watcher.get().filter(|_| is_new) {
            watcher();
        }
    }
}
