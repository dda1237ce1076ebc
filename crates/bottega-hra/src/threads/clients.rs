//! Clients by id, so that units only carry an id.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::results_bin::ResultsBin;
use super::sync::lock;

/// The id of a client; never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ClientId(u64);

/// The results bins of all clients. Units refer to them by id: a reference count of the bin is written by submitters
/// and lanes alternately, for each unit.
pub(crate) struct Clients<O>(Mutex<List<O>>);

struct List<O> {
    bins: BTreeMap<ClientId, Arc<ResultsBin<O>>>,
    next: u64,
}

impl<O> Clients<O> {
    pub(crate) fn new() -> Self {
        Self(Mutex::new(List { bins: BTreeMap::new(), next: 0 }))
    }

    /// Adds a client with a results bin.
    pub(crate) fn enter(&self) -> (ClientId, Arc<ResultsBin<O>>) {
        let results = Arc::new(ResultsBin::new());
        let mut list = lock(&self.0);
        let id = ClientId(list.next);
        list.next += 1;
        list.bins.insert(id, Arc::clone(&results));
        (id, results)
    }

    /// Removes a client, whose answers are discarded from now on.
    pub(crate) fn leave(&self, id: ClientId) {
        let results = lock(&self.0).bins.remove(&id);
        drop(results); // Outside the lock: an output may do anything in its `Drop`.
    }

    /// Returns true if the client exists.
    pub(crate) fn has(&self, id: ClientId) -> bool {
        lock(&self.0).bins.contains_key(&id)
    }

    /// Returns the results bin of a client; `None` if it is gone.
    pub(crate) fn results(&self, id: ClientId) -> Option<Arc<ResultsBin<O>>> {
        lock(&self.0).bins.get(&id).cloned()
    }
}
