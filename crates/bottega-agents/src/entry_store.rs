//! The trait of a store that drivers need: in memory, in a file, or on a server.

use std::{
    collections::BTreeSet,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use crate::{
    StoreRequest, Ticket,
    store::{AddressedStore, MemoryStore},
};

/// A store of entries that are watched, as [`MemoryStore`] is one.
///
/// Replies to one asker come in the order in which things happened: what it is told of a write by itself or others
/// never goes back in time.
pub trait EntryStore<V, W> {
    /// Carries out a request of `from` and appends the replies, to the asker first, to those who watch after it.
    fn handle(&mut self, from: W, ticket: Ticket, request: StoreRequest<V>, replies: &mut Vec<AddressedStore<V, W>>);

    /// Ends all watches of one who is gone.
    fn forget(&mut self, who: &W);

    /// Appends what those who watch must hear of writes by other processes. To be called now and then.
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

/// A store that several drivers in one process share; each says by a number of its own who asks.
#[derive(Debug)]
pub struct SharedStore<V>(Arc<Mutex<StoreMembers<V>>>);

type StoreMember = (usize, usize);

#[derive(Debug)]
struct StoreMembers<V> {
    store: MemoryStore<V, StoreMember>,
    /// What the members other than the one who asked must hear.
    waiting: Vec<Vec<AddressedStore<V, usize>>>,
    /// Who of each member has asked.
    askers: Vec<BTreeSet<usize>>,
}

/// One driver's part in a [`SharedStore`].
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
    /// A part for one more driver.
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
        // What happened before comes first.
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
