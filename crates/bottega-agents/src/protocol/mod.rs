//! Interaction protocols as parts that an agent is built of.
//!
//! A role is not an agent: it takes the messages of its conversations and the time, appends what must be said, and
//! tells the agent around it what there is to decide. What a peer sends out of turn is an [`OutOfSequence`], which the
//! agent answers by [`AclMessage::not_understood`](crate::AclMessage::not_understood).

mod contract_net;
mod request;
mod subscribe;

pub use contract_net::{
    Call, ContractNetInitiator, ContractNetResponder, Conversation, InitiatorNews, Outcome, Proposal, RESPONSES_MAX,
    ResponderNews,
};
pub use request::{Answer, RequestInitiator};
pub use subscribe::{SUBSCRIBERS_MAX, SubscribeNews, Subscriptions, TooManySubscribers};

use crate::{AgentId, Performative};

/// A message that the protocol does not allow at this point.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{got}` from {from} is out of sequence: the conversation is {state}")]
pub struct OutOfSequence {
    /// Who sent it.
    pub from: AgentId,
    /// What it was.
    pub got: Performative,
    /// Where the conversation stands.
    pub state: &'static str,
}
