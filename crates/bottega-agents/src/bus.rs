//! The bus between agents, store and blobs.

use std::sync::Arc;

use crate::{AclMessage, Action, AgentId, Key, StoreRequest, Ticket};

/// The digest that identifies a blob, 32 bytes. Its creator computes it; readers verify it, the bus does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BlobId(pub [u8; 32]);

/// The bytes of a blob. Clones share them.
pub type Blob = Arc<[u8]>;

/// Maximum number of blobs in an in-memory bus.
pub const BLOBS_MAX: usize = 1 << 20;

/// A carrier of messages, store requests and blobs between agents.
///
/// No method blocks for an answer. Results arrive as an [`Event`](crate::Event) in the mailbox of the requesting agent:
/// messages that answer a message, replies of the store to a [`StoreRequest`]. Any of them may be missing, so an agent
/// that waits for one sets a deadline.
pub trait Bus {
    /// The content of messages.
    type Content;
    /// The values in the store.
    type Value;

    /// Delivers the message to each of its receivers, or loses it.
    fn publish(&mut self, message: AclMessage<Self::Content>);

    /// Delivers the message to one of the agents that joined the queue, in turn. While there is none the queue keeps
    /// it; a full queue drops its oldest message.
    fn enqueue(&mut self, queue: &Key, message: AclMessage<Self::Content>);

    /// Adds an agent to a queue, which then gets the messages that waited for one.
    fn join(&mut self, queue: &Key, agent: &AgentId);

    /// Sends a request to the store: get, put, compare-and-set, watch. The replies carry `ticket`.
    fn ask_store(&mut self, from: &AgentId, ticket: Ticket, request: StoreRequest<Self::Value>);

    /// Reports to the agent which agents are present, and from now on every arrival and departure.
    fn watch_presence(&mut self, from: &AgentId);

    /// Stores a blob under its digest. Returns false if there is no room.
    fn put_blob(&mut self, id: BlobId, blob: Blob) -> bool;

    /// Returns a blob; `None`: it is not stored.
    fn blob(&self, id: BlobId) -> Option<Blob>;
}

/// The part of an action that a bus cannot carry out.
#[derive(Debug, PartialEq)]
pub(crate) enum OutsideAction<E> {
    /// An effect, for the driver.
    Effect(E),
    /// The agent has ended.
    Stop,
}

/// Carries an action of `from` out on the bus. Returns the part that is not for the bus.
pub(crate) fn carry_out<B: Bus, E>(
    bus: &mut B,
    from: &AgentId,
    action: Action<B::Content, B::Value, E>,
) -> Option<OutsideAction<E>> {
    match action {
        Action::Send(message) => bus.publish(message),
        Action::Enqueue { queue, message } => bus.enqueue(&queue, message),
        Action::JoinQueue(queue) => bus.join(&queue, from),
        Action::Store { ticket, request } => bus.ask_store(from, ticket, request),
        Action::WatchPresence => bus.watch_presence(from),
        Action::Effect(effect) => return Some(OutsideAction::Effect(effect)),
        Action::Stop => return Some(OutsideAction::Stop),
    }
    None
}
