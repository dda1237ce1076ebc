//! What lies beyond this process.

use super::Mailbox;
use crate::{AclMessage, AgentId, StateMachine, StoreRequest, Ticket, Time};

/// Links a platform in one process with others: for messages to agents who are elsewhere, and for a store that all share.
///
/// No method waits. What comes back goes into a mailbox.
pub trait Uplink<M: StateMachine>: Send + Sync {
    /// An agent has come to life here: what others send to it goes into its mailbox. Returns when that is so, or when
    /// it is known that it cannot be for now.
    fn add(&self, agent: &AgentId, mailbox: Mailbox<M>);

    /// Brings a message to one of its receivers, who is not here, or loses it.
    fn publish(&self, now: Time, message: &AclMessage<M::Content>, receiver: &AgentId);

    /// Asks the store for the agent with this mailbox.
    fn ask_store(&self, mailbox: Mailbox<M>, ticket: Ticket, request: StoreRequest<M::Value>);
}
