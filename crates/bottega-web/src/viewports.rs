//! The viewports of a door: interactive views of scenes. Their number is limited, and each is closed when no client uses it any
//! more.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use axum::http::StatusCode;
use bottega::viewport::Viewport;
use bottega_cluster::client::{SharedViewport, ViewportMachine};
use tokio::sync::watch;

use crate::{
    limits::{VIEWPORT_IDLE, VIEWPORTS_MAX},
    problem::Problem,
};

/// Interval between checks for unused viewports.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// All viewports of a door, by number.
#[derive(Default)]
pub(crate) struct Viewports {
    state: Mutex<ViewportTable>,
}

#[derive(Default)]
struct ViewportTable {
    last: u32,
    /// Number of places in use, viewports being opened included.
    taken: usize,
    open: BTreeMap<u32, WatchedViewport>,
}

struct WatchedViewport {
    viewport: Arc<Viewport>,
    /// The help of a farm's machines, which ends when this is dropped; `None`: there are none.
    shared: Option<SharedViewport>,
    /// Signals that there may be a new frame.
    frames: watch::Receiver<()>,
    /// Time of the last request for it.
    requested_at: Instant,
}

/// A place for a viewport. Dropping it unused frees the place.
pub(crate) struct ViewportPlace {
    all: Arc<Viewports>,
}

impl Viewports {
    /// Reserves a place for a viewport.
    ///
    /// # Errors
    /// There are too many viewports.
    pub(crate) fn place(self: &Arc<Self>) -> Result<ViewportPlace, Problem> {
        let mut state = self.state();
        if state.taken >= VIEWPORTS_MAX {
            let detail = format!("{VIEWPORTS_MAX} viewports are open, the maximum");
            return Err(Problem::new(StatusCode::SERVICE_UNAVAILABLE, detail, "close one, or wait a moment"));
        }
        state.taken += 1;
        Ok(ViewportPlace { all: Arc::clone(self) })
    }

    /// Returns a viewport, and marks it as used now.
    ///
    /// # Errors
    /// There is no such viewport.
    pub(crate) fn get(&self, number: u32) -> Result<Arc<Viewport>, Problem> {
        self.watched(number).map(|(viewport, _)| viewport)
    }

    /// Returns a viewport like [`Self::get`], with a receiver that is notified of possible new frames and ends when the viewport
    /// is closed.
    ///
    /// # Errors
    /// There is no such viewport.
    pub(crate) fn watched(&self, number: u32) -> Result<(Arc<Viewport>, watch::Receiver<()>), Problem> {
        let mut state = self.state();
        let known = state.open.get_mut(&number).map(|known| {
            known.requested_at = Instant::now();
            (Arc::clone(&known.viewport), known.frames.clone())
        });
        known.ok_or_else(|| Problem::unknown(format!("there is no viewport {number}"), "open one: POST /api/viewports"))
    }

    /// Returns the machines that render samples for a viewport.
    pub(crate) fn machines(&self, number: u32) -> Vec<ViewportMachine> {
        let state = self.state();
        let shared = state.open.get(&number).and_then(|known| known.shared.as_ref());
        shared.map(SharedViewport::machines).unwrap_or_default()
    }

    /// Closes a viewport; waits for its rendering thread, which ends within a moment.
    pub(crate) fn close(&self, number: u32) {
        let closed = {
            let mut state = self.state();
            let closed = state.open.remove(&number);
            state.taken -= usize::from(closed.is_some());
            closed
        };
        // Outside the lock, so that others need not wait for the thread.
        drop(closed);
    }

    fn is_idle(&self, number: u32) -> bool {
        self.state().open.get(&number).is_none_or(|known| known.requested_at.elapsed() > VIEWPORT_IDLE)
    }

    fn state(&self) -> MutexGuard<'_, ViewportTable> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ViewportPlace {
    /// Fills the place with a viewport, which is closed when no client uses it any more. Returns its number.
    ///
    /// - `shared`: the help of a farm's machines.
    pub(crate) fn fill(self, viewport: Arc<Viewport>, shared: Option<SharedViewport>) -> u32 {
        let (new_frame, frames) = watch::channel(());
        viewport.watch(move || new_frame.send_replace(()));
        let number = {
            let mut state = self.all.state();
            // The viewport keeps the place when `self` is dropped
            state.taken += 1;
            state.last += 1;
            let number = state.last;
            state.open.insert(number, WatchedViewport { viewport, shared, frames, requested_at: Instant::now() });
            number
        };
        let viewports = Arc::clone(&self.all);
        tokio::spawn(async move {
            while !viewports.is_idle(number) {
                tokio::time::sleep(LOOK_EVERY).await;
            }
            tokio::task::spawn_blocking(move || viewports.close(number));
        });
        number
    }
}

impl Drop for ViewportPlace {
    fn drop(&mut self) {
        self.all.state().taken -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_as_many_places_as_are_not_taken() {
        let viewports = Arc::new(Viewports::default());
        let mut places: Vec<ViewportPlace> = (0..VIEWPORTS_MAX).map(|_| viewports.place().expect("a place")).collect();
        assert_eq!(viewports.place().map(drop).expect_err("one too many").status, 503);
        places.pop();
        assert!(viewports.place().is_ok());
        assert_eq!(viewports.get(1).map(drop).expect_err("none is open").status, 404);
    }
}
