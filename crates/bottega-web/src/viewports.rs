//! The viewports of a door: scenes that somebody looks around in. Few at once, and each closed when nobody asks for it any more.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use axum::http::StatusCode;
use bottega::viewport::Viewport;
use tokio::sync::watch;

use crate::{
    limits::{VIEWPORT_IDLE, VIEWPORTS_MAX},
    problem::Problem,
};

/// How often is looked whether anybody asks for a viewport.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// All viewports of a door, by number.
#[derive(Default)]
pub(crate) struct Viewports {
    state: Mutex<ViewportTable>,
}

#[derive(Default)]
struct ViewportTable {
    last: u32,
    /// Those that are being opened, too.
    taken: usize,
    open: BTreeMap<u32, WatchedViewport>,
}

struct WatchedViewport {
    viewport: Arc<Viewport>,
    /// Changes when there may be a new frame.
    news: watch::Receiver<()>,
    asked: Instant,
}

/// The right to open a viewport. Dropped without being used it is given back.
pub(crate) struct ViewportPlace {
    all: Arc<Viewports>,
}

impl Viewports {
    /// Takes a place for one more.
    pub(crate) fn place(self: &Arc<Self>) -> Result<ViewportPlace, Problem> {
        let mut state = self.state();
        if state.taken >= VIEWPORTS_MAX {
            let detail = format!("{VIEWPORTS_MAX} scenes are looked around in, and no more are allowed");
            return Err(Problem::new(StatusCode::SERVICE_UNAVAILABLE, detail, "close one, or wait a moment"));
        }
        state.taken += 1;
        Ok(ViewportPlace { all: Arc::clone(self) })
    }

    /// The viewport of a number, for which somebody has asked now.
    pub(crate) fn get(&self, number: u32) -> Result<Arc<Viewport>, Problem> {
        self.watched(number).map(|(viewport, _)| viewport)
    }

    /// The same with what changes when there may be a new frame, and ends when it is closed.
    pub(crate) fn watched(&self, number: u32) -> Result<(Arc<Viewport>, watch::Receiver<()>), Problem> {
        let mut state = self.state();
        let known = state.open.get_mut(&number).map(|known| {
            known.asked = Instant::now();
            (Arc::clone(&known.viewport), known.news.clone())
        });
        known.ok_or_else(|| Problem::unknown(format!("there is no viewport {number}"), "open one: POST /api/viewports"))
    }

    /// Closes one. Who paints it ends within a moment, on the caller's time.
    pub(crate) fn close(&self, number: u32) {
        let closed = {
            let mut state = self.state();
            let closed = state.open.remove(&number);
            state.taken -= usize::from(closed.is_some());
            closed
        };
        // Outside the lock: others need not wait for its thread.
        drop(closed);
    }

    fn is_idle(&self, number: u32) -> bool {
        self.state().open.get(&number).is_none_or(|known| known.asked.elapsed() > VIEWPORT_IDLE)
    }

    fn state(&self) -> MutexGuard<'_, ViewportTable> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ViewportPlace {
    /// Puts a viewport there. Returns its number. It is closed when nobody asks for it any more.
    pub(crate) fn fill(self, viewport: Viewport) -> u32 {
        let (tell, news) = watch::channel(());
        viewport.watch(move || tell.send_replace(()));
        let number = {
            let mut state = self.all.state();
            // This place goes on as that of the viewport.
            state.taken += 1;
            state.last += 1;
            let number = state.last;
            state.open.insert(number, WatchedViewport { viewport: Arc::new(viewport), news, asked: Instant::now() });
            number
        };
        let all = Arc::clone(&self.all);
        tokio::spawn(async move {
            while !all.is_idle(number) {
                tokio::time::sleep(LOOK_EVERY).await;
            }
            tokio::task::spawn_blocking(move || all.close(number));
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
        let all = Arc::new(Viewports::default());
        let mut places: Vec<ViewportPlace> = (0..VIEWPORTS_MAX).map(|_| all.place().expect("a place")).collect();
        assert_eq!(all.place().map(drop).expect_err("one too many").status, 503);
        places.pop();
        assert!(all.place().is_ok());
        assert_eq!(all.get(1).map(drop).expect_err("none is open").status, 404);
    }
}
