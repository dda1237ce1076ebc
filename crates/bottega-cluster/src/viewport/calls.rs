//! The calls of viewports that a machine has heard.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use bottega::viewport::LookEnd;
use bottega_agents::driver::nats::{LiveSubscription, NatsLive};

use super::call::{CALL_LASTS, CALLS, ViewportCall};

/// Largest number of calls that are remembered.
const CALLS_MAX: usize = 64;

/// The calls of viewports that a machine hears.
pub(crate) struct HeardCalls {
    state: Mutex<CallState>,
    /// Notified after each call.
    changed: Condvar,
}

#[derive(Default)]
struct CallState {
    calls: BTreeMap<u64, (Arc<ViewportCall>, Instant)>,
    /// Viewports that this machine cannot help.
    refused: BTreeSet<u64>,
    rendered: Option<RenderedLook>,
}

/// A look that this machine renders samples of.
struct RenderedLook {
    viewport: u64,
    look: u64,
    end: LookEnd,
}

impl HeardCalls {
    /// Listens to the calls of a farm, until the subscription is dropped.
    pub(crate) fn listen(live: &NatsLive) -> (Arc<Self>, LiveSubscription) {
        let calls = Arc::new(Self { state: Mutex::default(), changed: Condvar::new() });
        let heard = Arc::downgrade(&calls);
        let subscription = live.listen(CALLS, move |bytes| {
            if let Some(calls) = heard.upgrade() {
                calls.hear(bytes);
            }
        });
        (calls, subscription)
    }

    fn hear(&self, bytes: &[u8]) {
        let call: ViewportCall = match serde_json::from_slice(bytes) {
            Ok(call) => call,
            Err(error) => return tracing::debug!(%error, "cannot read a call of a viewport"),
        };
        let mut state = self.state();
        let look = call.look.as_ref().map(|look| look.number).filter(|_| !call.is_over);
        // End at once what is no longer looked at.
        if let Some(rendered) =
            state.rendered.take_if(|frame| frame.viewport == call.viewport && Some(frame.look) != look)
        {
            rendered.end.end();
            tracing::debug!(look = rendered.look, "a step of the look before was dropped");
        }
        if call.is_over {
            state.calls.remove(&call.viewport);
            state.refused.remove(&call.viewport);
        } else if state.calls.len() < CALLS_MAX || state.calls.contains_key(&call.viewport) {
            state.calls.insert(call.viewport, (Arc::new(call), Instant::now()));
        }
        drop(state);
        self.changed.notify_all();
    }

    fn state(&self) -> MutexGuard<'_, CallState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the last call of a viewport; `None`: it is closed, or its owner is gone.
    pub(crate) fn get(&self, viewport: u64) -> Option<Arc<ViewportCall>> {
        let mut state = self.state();
        state.calls.retain(|_, (_, heard)| heard.elapsed() < CALL_LASTS);
        state.calls.get(&viewport).map(|(call, _)| Arc::clone(call))
    }

    /// Returns the number of an open viewport that has something to render and that this machine can help; `None`: there is none.
    pub(crate) fn open(&self) -> Option<u64> {
        let mut state = self.state();
        state.calls.retain(|_, (_, heard)| heard.elapsed() < CALL_LASTS);
        let CallState { calls, refused, .. } = &*state;
        let is_open = |(number, (call, _)): &(&u64, &(Arc<ViewportCall>, Instant))| {
            call.look.is_some() && !refused.contains(number)
        };
        let helpers = |&(_, (call, _)): &(&u64, &(Arc<ViewportCall>, Instant))| call.places.len();
        calls.iter().filter(is_open).min_by_key(helpers).map(|(&number, _)| number)
    }

    /// Returns true if a helper of a viewport should leave it for another one, which has at least two helpers fewer. Of the
    /// helpers only the one that came last leaves.
    ///
    /// - `name`: the name of the helper.
    pub(crate) fn is_needed_elsewhere(&self, call: &ViewportCall, name: &str) -> bool {
        let is_last = call.places.get(name).is_some_and(|place| call.places.values().all(|other| other <= place));
        let state = self.state();
        let is_short = |(number, (other, heard)): (&u64, &(Arc<ViewportCall>, Instant))| {
            *number != call.viewport
                && other.look.is_some()
                && heard.elapsed() < CALL_LASTS
                && !state.refused.contains(number)
                && other.places.len() + 2 <= call.places.len()
        };
        is_last && state.calls.iter().any(is_short)
    }

    /// Notes that this machine cannot help a viewport.
    pub(crate) fn refuse(&self, viewport: u64) {
        self.state().refused.insert(viewport);
    }

    /// Waits for a call of a viewport that is not `seen`, at most for `limit`.
    pub(crate) fn wait(&self, viewport: u64, seen: &Arc<ViewportCall>, limit: Duration) {
        let is_seen =
            |state: &mut CallState| state.calls.get(&viewport).is_some_and(|(call, _)| Arc::ptr_eq(call, seen));
        drop(self.changed.wait_timeout_while(self.state(), limit, is_seen));
    }

    /// Begins to render a look, which [`Self::leave`] and a call for another one end. Returns false if another one is called for.
    pub(crate) fn begin(&self, viewport: u64, look: u64, end: &LookEnd) -> bool {
        let mut state = self.state();
        let called = state.calls.get(&viewport).and_then(|(call, _)| call.look.as_ref());
        if called.is_none_or(|called| called.number != look) {
            return false;
        }
        state.rendered = Some(RenderedLook { viewport, look, end: end.clone() });
        true
    }

    /// Ends the rendering of a look, if any.
    pub(crate) fn leave(&self) {
        let rendered = self.state().rendered.take();
        if let Some(rendered) = rendered {
            rendered.end.end();
        }
    }
}

#[cfg(test)]
mod tests {
    use bottega::Request;
    use bottega_scene::Camera;

    use super::*;
    use crate::viewport::call::CalledLook;

    fn call(viewport: u64, helpers: &[&str]) -> ViewportCall {
        let (request, camera) = (Request::new("a.glb"), Camera::default());
        let scene = serde_json::from_str(r#"{"files": [], "environment": null}"#).unwrap();
        let numbered = |(name, place): (&&str, u32)| ((*name).to_owned(), place);
        ViewportCall {
            viewport,
            host: "here".to_owned(),
            version: "1".to_owned(),
            look: Some(CalledLook { number: 0, request, camera, state: 1, scene }),
            is_moving: false,
            places: helpers.iter().zip(1..).map(numbered).collect(),
            bytes_per_second: 1,
            is_over: false,
        }
    }

    fn heard(calls: &[ViewportCall]) -> HeardCalls {
        let all = HeardCalls { state: Mutex::default(), changed: Condvar::new() };
        for call in calls {
            all.hear(&serde_json::to_vec(call).unwrap());
        }
        all
    }

    #[test]
    fn viewports_share_the_machines() {
        let crowded = call(1, &["a", "b", "c"]);
        let calls = heard(&[crowded.clone(), call(2, &[])]);
        assert_eq!(calls.open(), Some(2), "a free machine goes where the fewest are");
        let leaves = ["a", "b", "c"].map(|name| calls.is_needed_elsewhere(&crowded, name));
        assert_eq!(leaves, [false, false, true], "one machine at a time, the last that came");
        let even = call(1, &["a", "b"]);
        assert!(!heard(&[even.clone(), call(2, &["c"])]).is_needed_elsewhere(&even, "b"), "then nobody leaves");
        let calls = heard(&[crowded.clone(), call(2, &[])]);
        calls.refuse(2);
        assert!(!calls.is_needed_elsewhere(&crowded, "c"), "this machine cannot help the other one");
        assert_eq!(calls.open(), Some(1));
    }
}
