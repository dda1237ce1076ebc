//! The bus between agents, the store and the blobs.

use std::sync::Arc;

use crate::{AclMessage, Action, AgentId, Key, StoreRequest, Ticket};

/// The digest by which a blob is known. Whoever makes the blob computes it; whoever reads checks it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BlobId(pub [u8; 32]);

/// The bytes of a blob, shared.
pub type Blob = Arc<[u8]>;

/// The most blobs that a bus in memory keeps.
pub const BLOBS_MAX: usize = 1 << 20;

/// Carries messages, store requests and blobs between agents.
///
/// No method waits. What comes back arrives as an [`Event`](crate::Event) in the mailbox of the agent that asked:
/// a *request* is a message with `reply_by`, a *compare-and-set* is a [`StoreRequest`], and silence is a refusal.
pub trait Bus {
    /// What messages say.
    type Content;
    /// What the store holds.
    type Value;

    /// Brings the message to each of its receivers, or loses it.
    fn publish(&mut self, message: AclMessage<Self::Content>);

    /// Brings the message to one of those who joined the queue: all take turns. Kept while nobody has joined.
    fn enqueue(&mut self, queue: &Key, message: AclMessage<Self::Content>);

    /// Lets an agent take its turn at a queue.
    fn join(&mut self, queue: &Key, agent: &AgentId);

    /// Asks the store: get, put, compare-and-set, watch.
    fn ask_store(&mut self, from: &AgentId, ticket: Ticket, request: StoreRequest<Self::Value>);

    /// Tells the agent who is here, and from now on who comes and goes.
    fn watch_presence(&mut self, from: &AgentId);

    /// Keeps a blob for all. `false`: there is no room.
    fn put_blob(&mut self, id: BlobId, blob: Blob) -> bool;

    /// Reads a blob, if it is here.
    fn blob(&self, id: BlobId) -> Option<Blob>;
}

/// What of an action a bus cannot carry out.
#[derive(Debug, PartialEq)]
pub(crate) enum OutsideAction<E> {
    /// To be begun in the world.
    Effect(E),
    /// The agent is finished.
    Stop,
}

/// Hands an action of `from` to the bus, and returns what is not a bus's business.
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
