//! The trait of stores for drivers: in memory, in a file, or on a server.

use std::{
    collections::BTreeSet,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use crate::{
    StoreRequest, Ticket,
    store::{AddressedStore, MemoryStore},
};

/// A store of watched entries, such as [`MemoryStore`]. `V` is the type of the values; `W` identifies a client.
///
/// Replies to one client arrive in the order of the events: they never go back in time, neither for its own writes nor
/// for those of others.
pub trait EntryStore<V, W> {
    /// Executes a request of client `from` and appends the replies: the one to the client, and those to clients that
    /// watch the written entry.
    fn handle(&mut self, from: W, ticket: Ticket, request: StoreRequest<V>, replies: &mut Vec<AddressedStore<V, W>>);

    /// Ends all watches of a client that is gone.
    fn forget(&mut self, who: &W);

    /// Appends reports of changes by other processes to those that watch. Drivers call it from time to time; by default
    /// there are no other processes.
    fn poll(&mut self, _replies: &mut Vec<AddressedStore<V, W>>) {}
}

impl<V: Clone, W: Clone + PartialEq> EntryStore<V, W> for MemoryStore<V, W> {
    fn handle(&mut self, from: W, ticket: Ticket, request: StoreRequest<V>, replies: &mut Vec<AddressedStore<V, W>>) {
        Self::handle(self, from, ticket, request, replies);
    }

    fn forget(&mut self, who: &W) {
        Self::forget(self, who);
    }
}

/// A store in memory, shared by several drivers of one process, each with its own client numbers.
#[derive(Debug)]
pub struct SharedStore<V>(Arc<Mutex<StoreMembers<V>>>);

type StoreMember = (usize, usize);

#[derive(Debug)]
struct StoreMembers<V> {
    store: MemoryStore<V, StoreMember>,
    /// Pending replies for the members other than the one that made the request.
    waiting: Vec<Vec<AddressedStore<V, usize>>>,
    /// The clients of each member.
    askers: Vec<BTreeSet<usize>>,
}

/// The access of one driver to a [`SharedStore`].
#[derive(Debug)]
pub struct SharedMember<V> {
    shared: Arc<Mutex<StoreMembers<V>>>,
    number: usize,
}

impl<V: Clone> Default for SharedStore<V> {
    fn default() -> Self {
        let shared = StoreMembers { store: MemoryStore::default(), waiting: Vec::new(), askers: Vec::new() };
        Self(Arc::new(Mutex::new(shared)))
    }
}

impl<V: Clone> SharedStore<V> {
    /// Adds a member, and returns its access to the store: one for each driver.
    pub fn member(&self) -> SharedMember<V> {
        let mut shared = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        shared.waiting.push(Vec::new());
        shared.askers.push(BTreeSet::new());
        SharedMember { shared: Arc::clone(&self.0), number: shared.waiting.len() - 1 }
    }
}

impl<V> SharedMember<V> {
    fn lock(&self) -> MutexGuard<'_, StoreMembers<V>> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<V> Drop for SharedMember<V> {
    fn drop(&mut self) {
        let number = self.number;
        let mut shared = self.lock();
        for asker in std::mem::take(&mut shared.askers[number]) {
            shared.store.forget(&(number, asker));
        }
        shared.waiting[number].clear();
    }
}

impl<V: Clone> EntryStore<V, usize> for SharedMember<V> {
    fn handle(
        &mut self,
        from: usize,
        ticket: Ticket,
        request: StoreRequest<V>,
        out: &mut Vec<AddressedStore<V, usize>>,
    ) {
        let mut shared = self.lock();
        // Deliver earlier events first
        out.append(&mut shared.waiting[self.number]);
        shared.askers[self.number].insert(from);
        let mut replies = Vec::new();
        shared.store.handle((self.number, from), ticket, request, &mut replies);
        for AddressedStore { to: (member, to), ticket, reply } in replies {
            let addressed = AddressedStore { to, ticket, reply };
            if member == self.number { out.push(addressed) } else { shared.waiting[member].push(addressed) }
        }
    }

    fn forget(&mut self, who: &usize) {
        let who = (self.number, *who);
        self.lock().store.forget(&who);
    }

    fn poll(&mut self, out: &mut Vec<AddressedStore<V, usize>>) {
        out.append(&mut self.lock().waiting[self.number]);
    }
}
