//! Messages of the Agent Communication Language (FIPA00061).

use crate::{AgentId, Time};

/// The communicative acts (FIPA00037).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the words of the standard, explained there")]
pub enum Performative {
    AcceptProposal,
    Agree,
    Cancel,
    CallForProposal,
    Confirm,
    Disconfirm,
    Failure,
    InformIf,
    Inform,
    InformRef,
    NotUnderstood,
    Propagate,
    Propose,
    Proxy,
    QueryIf,
    QueryRef,
    Refuse,
    RejectProposal,
    Request,
    RequestWhen,
    RequestWhenever,
    Subscribe,
}

/// One message. `C` is the content: typed within one platform (nothing is encoded there), text on a wire.
#[derive(Clone, Debug, PartialEq)]
pub struct AclMessage<C = String> {
    /// What the sender does by saying it.
    pub performative: Performative,
    /// Who says it.
    pub sender: AgentId,
    /// To whom.
    pub receivers: Vec<AgentId>,
    /// What is said.
    pub content: C,
    /// The language of the content, as text: `fipa-sl`, `bottega-json`, …
    pub language: &'static str,
    /// The vocabulary of the content.
    pub ontology: &'static str,
    /// The interaction protocol: `fipa-contract-net`, `fipa-request`, `fipa-subscribe`, …
    pub protocol: &'static str,
    /// Ties the messages of one conversation together.
    pub conversation_id: u64,
    /// What an answer must carry as `in_reply_to`; 0: none.
    pub reply_with: u64,
    /// The `reply_with` of the message that this one answers; 0: none.
    pub in_reply_to: u64,
    /// When an answer is of no more use.
    pub reply_by: Option<Time>,
}
