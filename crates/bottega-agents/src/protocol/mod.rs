//! Interaction protocols, as components of agents.
//!
//! A role is not an agent: it handles the messages of its conversations and the time, appends the messages to send, and
//! returns the decisions that its agent must take. A message out of sequence gives an [`OutOfSequence`], which the
//! agent answers by [`AclMessage::not_understood`](crate::AclMessage::not_understood).

mod contract_net;
mod request;
mod subscribe;

pub use contract_net::{
    Call, ContractNetInitiator, ContractNetResponder, Conversation, InitiatorEvent, Proposal, RESPONSES_MAX,
    ResponderEvent, TaskOutcome,
};
pub use request::{Answer, RequestInitiator};
pub use subscribe::{PublisherEvent, SUBSCRIBERS_MAX, Subscriptions, TooManySubscribers};

use crate::{AgentId, Performative};

/// A message that the protocol does not allow in the current state.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{got}` from {from} is out of sequence: the conversation is {state}")]
pub struct OutOfSequence {
    /// The sender of the message.
    pub from: AgentId,
    /// The performative received.
    pub got: Performative,
    /// The state of the conversation, as text for the error.
    pub state: &'static str,
}
