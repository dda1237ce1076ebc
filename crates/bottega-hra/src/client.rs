//! The renderer's side: units in, answers out.

use std::sync::Arc;
use std::time::Duration;

use crate::results_bin::{ResultsBin, deadline_after};
use crate::shared::Shared;
use crate::{Completed, SubmitError, TrySubmit, Work, WorkUnit};

/// A client of an allocator, with a results bin of its own.
///
/// Clones share the results bin: an answer goes to whichever asks first. When the last clone goes, units that still
/// wait are cancelled and answers that still come are dropped. A client may outlive its allocator; it then takes what
/// was answered, and submits nothing more.
pub struct HraClient<W: Work> {
    handle: Arc<Handle<W>>,
}

struct Handle<W: Work> {
    shared: Arc<Shared<W>>,
    results: Arc<ResultsBin<W::Output>>,
}

impl<W: Work> Clone for HraClient<W> {
    fn clone(&self) -> Self {
        Self { handle: Arc::clone(&self.handle) }
    }
}

impl<W: Work> HraClient<W> {
    pub(crate) fn new(shared: Arc<Shared<W>>) -> Self {
        Self { handle: Arc::new(Handle { shared, results: Arc::new(ResultsBin::new()) }) }
    }

    /// Puts a unit into the work bin; waits while the bin is full.
    pub fn submit(&self, unit: WorkUnit<W>) -> Result<(), SubmitError> {
        self.submit_group(vec![unit])
    }

    /// Puts units into the work bin in one call, in their order; waits as often as the bin is full.
    ///
    /// When any of them cannot be done by any resource, none is taken. When the allocator is shut down while the call
    /// waits, those already taken are answered, the others are dropped.
    pub fn submit_group(&self, units: Vec<WorkUnit<W>>) -> Result<(), SubmitError> {
        self.handle.shared.submit(&self.handle.results, units)
    }

    /// Puts a unit into the work bin if there is room just now.
    pub fn try_submit(&self, unit: WorkUnit<W>) -> Result<(), TrySubmit<W>> {
        self.handle.shared.try_submit(&self.handle.results, unit)
    }

    /// The next answer, in the order in which they were computed. Waits for it; `None` when nothing is outstanding.
    pub fn take(&self) -> Option<Completed<W::Output>> {
        self.handle.results.take(None)
    }

    /// The next answer; `None` when none came in time, or nothing is outstanding.
    pub fn take_timeout(&self, timeout: Duration) -> Option<Completed<W::Output>> {
        self.handle.results.take(deadline_after(timeout))
    }

    /// How many units were submitted, or are being so, and not yet answered to this client.
    pub fn outstanding(&self) -> usize {
        self.handle.results.outstanding()
    }

    /// Takes back all units of this client that still wait in the bin; they get no answer. Those under way do.
    pub fn cancel_pending(&self) -> Vec<WorkUnit<W>> {
        self.handle.shared.cancel(&self.handle.results)
    }
}

impl<W: Work> Drop for Handle<W> {
    fn drop(&mut self) {
        // What this gives back is dropped here, outside all locks.
        let _answers = self.results.abandon();
        let _units = self.shared.cancel(&self.results);
    }
}
