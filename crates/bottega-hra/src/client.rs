//! The renderer's side: units in, answers out.

use std::sync::{Arc, Weak};
use std::time::Duration;

use crate::threads::clients::ClientId;
use crate::threads::results_bin::{ResultsBin, deadline_after};
use crate::threads::shared::AllocatorState;
use crate::threads::submit::{Submitter, into_unit};
use crate::{Completed, SubmitError, TrySubmit, Work, WorkUnit};

/// A client of an allocator, with a results bin of its own.
///
/// Clones share the results bin: an answer goes to whichever asks first. When the last clone goes, units that still
/// wait are cancelled and answers that still come are dropped. A client may outlive its allocator; it then takes what
/// was answered, and submits nothing more.
pub struct HraClient<W: Work> {
    handle: Arc<ClientHandle<W>>,
    /// Where its units go in; another for each clone, so that threads do not meet there.
    inlet: usize,
}

struct ClientHandle<W: Work> {
    shared: Arc<AllocatorState<W>>,
    id: ClientId,
    results: Arc<ResultsBin<W::Output>>,
    priority: i32,
}

/// The life time of a client's units, for somebody who may end it. It does not keep the client.
pub struct LifeTime<W: Work>(Weak<ClientHandle<W>>);

impl<W: Work> LifeTime<W> {
    /// As [`HraClient::expire`]; nothing where the client is gone.
    pub fn end(&self) {
        if let Some(handle) = self.0.upgrade() {
            handle.expire();
        }
    }

    /// Whether the client is gone.
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

    /// Ends the life time of all units of this client, also of those to come: those that wait are answered by
    /// [`UnitError::Expired`](crate::UnitError::Expired) now and done by nobody, those under way when their resource answers.
    pub fn expire(&self) {
        self.handle.expire();
    }

    /// The life time of its units, for whoever may end it.
    pub fn life_time(&self) -> LifeTime<W> {
        LifeTime(Arc::downgrade(&self.handle))
    }

    /// Puts a unit into the work bin; waits while the bin is full.
    pub fn submit(&self, unit: WorkUnit<W>) -> Result<(), SubmitError> {
        self.handle.shared.submit(&self.as_submitter(), unit)
    }

    /// Puts units into the work bin in one call, in their order; waits as often as the bin is full.
    ///
    /// When any of them cannot be done by any resource, none is taken. When the allocator is shut down while the call
    /// waits, those already taken are answered, the others are dropped.
    pub fn submit_group(&self, units: Vec<WorkUnit<W>>) -> Result<(), SubmitError> {
        self.handle.shared.submit_group(&self.as_submitter(), units)
    }

    /// Puts a unit into the work bin if there is room just now.
    pub fn try_submit(&self, unit: WorkUnit<W>) -> Result<(), TrySubmit<W>> {
        self.handle.shared.try_submit(&self.as_submitter(), unit)
    }

    /// The next answer, in the order in which they were computed. Waits for it; `None` when nothing is outstanding.
    pub fn take(&self) -> Option<Completed<W::Output>> {
        self.handle.results.take(None)
    }

    /// The next answer; `None` when none came in time, or nothing is outstanding.
    pub fn take_timeout(&self, timeout: Duration) -> Option<Completed<W::Output>> {
        self.handle.results.take(deadline_after(timeout))
    }

    /// The next answers, all that are there but at most `max`. Waits for the first; none when nothing is outstanding.
    pub fn take_many(&self, max: usize) -> Vec<Completed<W::Output>> {
        self.handle.results.take_many(max, None)
    }

    /// How many units were submitted, or are being so, and not yet answered to this client.
    pub fn outstanding(&self) -> usize {
        self.handle.results.outstanding()
    }

    /// Takes back all units of this client that still wait in the bin; they get no answer. Those under way do.
    /// Their maximum delay is cut to [`HraConfig::max_delay_bound`](crate::HraConfig::max_delay_bound).
    pub fn cancel_pending(&self) -> Vec<WorkUnit<W>> {
        let cancelled = self.handle.shared.cancel(self.handle.id);
        self.handle.results.forget(cancelled.len());
        cancelled.into_iter().filter_map(into_unit).collect()
    }
}

impl<W: Work> Drop for ClientHandle<W> {
    fn drop(&mut self) {
        // First the name goes, so that what fails after that is not put back; see `AllocatorState::try_again`.
        self.shared.clients.leave(self.id);
        let _units = self.shared.cancel(self.id); // Dropped here, outside all locks.
    }
}
