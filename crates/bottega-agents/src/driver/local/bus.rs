//! The bus of a platform in one process.

use std::sync::Arc;

use super::state::{Mailbox, PlatformShared, PlatformState};
use crate::{
    AclMessage, AgentId, Event, Key, StateMachine, StoreRequest, Ticket,
    bus::{BLOBS_MAX, Blob, BlobId, Bus},
};

/// The bus of a [`LocalPlatform`](super::LocalPlatform), which any thread may clone and use.
pub struct LocalBus<M: StateMachine>(pub(super) Arc<PlatformShared<M>>);

impl<M: StateMachine> Clone for LocalBus<M> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<M: StateMachine> LocalBus<M>
where
    M::Content: Clone,
    M::Value: Clone,
{
    fn with(&self, change: impl FnOnce(&mut PlatformState<M>)) {
        change(&mut self.0.lock());
        self.0.work.notify_all();
    }
}

impl<M: StateMachine> Bus for LocalBus<M>
where
    M::Content: Clone,
    M::Value: Clone,
{
    type Content = M::Content;
    type Value = M::Value;

    fn publish(&mut self, message: AclMessage<M::Content>) {
        let mut elsewhere = Vec::new();
        self.with(|state| {
            for receiver in &message.receivers {
                // For a stopped agent, the gateway informs the sender
                let here = |to: usize| state.gateway.is_none_or(|gateway| gateway != to && !state.slots[to].stopped);
                match state.index.get(receiver) {
                    Some(&to) if here(to) => _ = state.deliver(to, Event::Message(message.clone())),
                    _ => elsewhere.push(receiver.clone()),
                }
            }
            match (state.gateway, &self.0.uplink) {
                _ if elsewhere.is_empty() => {}
                (Some(gateway), _) => {
                    let receivers = std::mem::take(&mut elsewhere);
                    state.deliver(gateway, Event::Message(AclMessage { receivers, ..message.clone() }));
                }
                (None, Some(_)) => {}
                (None, None) => state.messages_lost += elsewhere.len() as u64,
            }
        });
        if let Some(uplink) = &self.0.uplink {
            elsewhere.iter().for_each(|receiver| uplink.publish(self.0.now(), &message, receiver));
        }
    }

    fn enqueue(&mut self, queue: &Key, message: AclMessage<M::Content>) {
        let addressed = self.0.lock().queues.enqueue(queue, message);
        if let Some(message) = addressed {
            self.publish(message);
        }
    }

    fn join(&mut self, queue: &Key, agent: &AgentId) {
        let waiting = self.0.lock().queues.join(queue, agent);
        for message in waiting {
            self.publish(message);
        }
    }

    fn ask_store(&mut self, from: &AgentId, ticket: Ticket, request: StoreRequest<M::Value>) {
        let from = self.0.lock().index.get(from).copied();
        let Some(agent) = from else { return };
        match &self.0.uplink {
            Some(uplink) => uplink.ask_store(Mailbox { shared: Arc::clone(&self.0), agent }, ticket, request),
            None => self.0.with_store(|store, replies| store.handle(agent, ticket, request, replies)),
        }
    }

    fn watch_presence(&mut self, from: &AgentId) {
        self.with(|state| {
            if let Some(&watcher) = state.index.get(from) {
                state.watch_presence(watcher);
            }
        });
    }

    fn put_blob(&mut self, id: BlobId, blob: Blob) -> bool {
        let mut state = self.0.lock();
        if state.blobs.len() >= BLOBS_MAX && !state.blobs.contains_key(&id) {
            return false;
        }
        state.blobs.insert(id, blob);
        true
    }

    fn blob(&self, id: BlobId) -> Option<Blob> {
        self.0.lock().blobs.get(&id).cloned()
    }
}
