//! Clients: the renderer's interface for submitting units and taking answers.

use std::sync::{Arc, Weak};
use std::time::Duration;

use crate::threads::clients::ClientId;
use crate::threads::results_bin::{ResultsBin, deadline_after};
use crate::threads::shared::AllocatorState;
use crate::threads::submit::{Submitter, into_unit};
use crate::{Completed, SubmitError, TrySubmit, Work, WorkUnit};

/// A client of an allocator, with a results bin of its own.
///
/// Clones share the results bin: an answer goes to the first that asks. When the last clone is dropped, waiting units
/// are cancelled and later answers are discarded. A client may outlive its allocator; it can then take the remaining
/// answers, but not submit units.
pub struct HraClient<W: Work> {
    handle: Arc<ClientHandle<W>>,
    /// The inlet of the client's units; different for each clone, to avoid lock contention.
    inlet: usize,
}

struct ClientHandle<W: Work> {
    shared: Arc<AllocatorState<W>>,
    id: ClientId,
    results: Arc<ResultsBin<W::Output>>,
    priority: i32,
}

/// A handle to end the life time of a client's units. It does not keep the client alive.
pub struct LifeTime<W: Work>(Weak<ClientHandle<W>>);

impl<W: Work> LifeTime<W> {
    /// Ends the life time of the client's units, as [`HraClient::expire`] does; does nothing if the client is gone.
    pub fn end(&self) {
        if let Some(handle) = self.0.upgrade() {
            handle.expire();
        }
    }

    /// Returns true if the client is gone.
    pub fn is_over(&self) -> bool {
        self.0.strong_count() == 0
    }
}

impl<W: Work> ClientHandle<W> {
    fn expire(&self) {
        self.results.end();
        self.shared.expire(self.id);
    }
}

impl<W: Work> Clone for HraClient<W> {
    fn clone(&self) -> Self {
        Self { handle: Arc::clone(&self.handle), inlet: self.handle.shared.inlets.assign() }
    }
}

impl<W: Work> HraClient<W> {
    pub(crate) fn new(shared: Arc<AllocatorState<W>>, priority: i32) -> Self {
        let inlet = shared.inlets.assign();
        let (id, results) = shared.clients.enter();
        Self { handle: Arc::new(ClientHandle { shared, id, results, priority }), inlet }
    }

    fn as_submitter(&self) -> Submitter<'_, W::Output> {
        let ClientHandle { id, results, priority, .. } = &*self.handle;
        Submitter { client: *id, results, inlet: self.inlet, priority: *priority }
    }

    /// Ends the life time of all units of this client, including future ones: waiting units are answered by
    /// [`UnitError::Expired`](crate::UnitError::Expired) now and not done, those in progress when their resource
    /// answers.
    pub fn expire(&self) {
        self.handle.expire();
    }

    /// Returns a handle to end the life time of this client's units.
    pub fn life_time(&self) -> LifeTime<W> {
        LifeTime(Arc::downgrade(&self.handle))
    }

    /// Puts a unit into the work bin; blocks while the bin is full.
    ///
    /// # Errors
    /// No resource supports the primitive or has room for the data of the unit, or the allocator is closed.
    pub fn submit(&self, unit: WorkUnit<W>) -> Result<(), SubmitError> {
        self.handle.shared.submit(&self.as_submitter(), unit)
    }

    /// Puts units into the work bin in one call, in order; blocks whenever the bin is full.
    ///
    /// If no resource can do one of them, none is accepted. If the allocator is shut down while the call blocks, units
    /// accepted so far are answered, the others are dropped.
    ///
    /// # Errors
    /// As for [`Self::submit`].
    pub fn submit_group(&self, units: Vec<WorkUnit<W>>) -> Result<(), SubmitError> {
        self.handle.shared.submit_group(&self.as_submitter(), units)
    }

    /// Puts a unit into the work bin if there is room.
    ///
    /// # Errors
    /// As for [`Self::submit`]; or the bin is full. Both give the unit back.
    pub fn try_submit(&self, unit: WorkUnit<W>) -> Result<(), TrySubmit<W>> {
        self.handle.shared.try_submit(&self.as_submitter(), unit)
    }

    /// Takes the next answer, in order of completion. Blocks; `None` if nothing is outstanding.
    pub fn take(&self) -> Option<Completed<W::Output>> {
        self.handle.results.take(None)
    }

    /// Takes the next answer; `None` after the timeout, or if nothing is outstanding.
    pub fn take_timeout(&self, timeout: Duration) -> Option<Completed<W::Output>> {
        self.handle.results.take(deadline_after(timeout))
    }

    /// Takes all available answers, at most `max`. Blocks for the first; empty if nothing is outstanding.
    pub fn take_many(&self, max: usize) -> Vec<Completed<W::Output>> {
        self.handle.results.take_many(max, None)
    }

    /// Returns the number of units submitted, or being submitted, for which no answer was taken yet.
    pub fn outstanding(&self) -> usize {
        self.handle.results.outstanding()
    }

    /// Takes all waiting units of this client back, and returns them; they get no answer. Units in progress do. The
    /// maximum delay of a returned unit is bounded by
    /// [`HraConfig::max_delay_bound`](crate::HraConfig::max_delay_bound).
    pub fn cancel_pending(&self) -> Vec<WorkUnit<W>> {
        let cancelled = self.handle.shared.cancel(self.handle.id);
        self.handle.results.forget(cancelled.len());
        cancelled.into_iter().filter_map(into_unit).collect()
    }
}

impl<W: Work> Drop for ClientHandle<W> {
    fn drop(&mut self) {
        // Remove the client first, so that units failing later are not put back; see `AllocatorState::try_again`.
        self.shared.clients.leave(self.id);
        let _units = self.shared.cancel(self.id); // Dropped here, outside all locks.
    }
}
