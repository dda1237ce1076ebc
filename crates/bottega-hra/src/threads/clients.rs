//! The clients by number, so that a unit need only bear a number.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::results_bin::ResultsBin;
use super::sync::lock;

/// Number of a client; never given twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ClientId(u64);

/// The results bins of all clients that are there. Units say by number whose they are: a count of references to the bin would be
/// written by submitters and lanes in turn, for each unit.
pub(crate) struct Clients<O>(Mutex<List<O>>);

struct List<O> {
    bins: BTreeMap<ClientId, Arc<ResultsBin<O>>>,
    next: u64,
}

impl<O> Clients<O> {
    pub(crate) fn new() -> Self {
        Self(Mutex::new(List { bins: BTreeMap::new(), next: 0 }))
    }

    /// A new client, and its results bin.
    pub(crate) fn enter(&self) -> (ClientId, Arc<ResultsBin<O>>) {
        let results = Arc::new(ResultsBin::new());
        let mut list = lock(&self.0);
        let id = ClientId(list.next);
        list.next += 1;
        list.bins.insert(id, Arc::clone(&results));
        (id, results)
    }

    /// Nobody will take the answers to this client any more.
    pub(crate) fn leave(&self, id: ClientId) {
        let results = lock(&self.0).bins.remove(&id);
        drop(results); // Outside the lock: an output may do anything in its `Drop`.
    }

    /// Whether anybody could take answers to this client.
    pub(crate) fn has(&self, id: ClientId) -> bool {
        lock(&self.0).bins.contains_key(&id)
    }

    /// Where answers go; `None` when nobody would take them.
    pub(crate) fn results(&self, id: ClientId) -> Option<Arc<ResultsBin<O>>> {
        lock(&self.0).bins.get(&id).cloned()
    }
}
