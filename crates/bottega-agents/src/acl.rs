//! Messages of the Agent Communication Language (FIPA00061).

use std::fmt;

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

impl Performative {
    /// All performatives, in the order of the variants.
    pub const ALL: [Self; 22] = [
        Self::AcceptProposal,
        Self::Agree,
        Self::Cancel,
        Self::CallForProposal,
        Self::Confirm,
        Self::Disconfirm,
        Self::Failure,
        Self::InformIf,
        Self::Inform,
        Self::InformRef,
        Self::NotUnderstood,
        Self::Propagate,
        Self::Propose,
        Self::Proxy,
        Self::QueryIf,
        Self::QueryRef,
        Self::Refuse,
        Self::RejectProposal,
        Self::Request,
        Self::RequestWhen,
        Self::RequestWhenever,
        Self::Subscribe,
    ];

    /// Returns the name of the performative in the standard, in lower case, such as `cfp`.
    pub fn word(self) -> &'static str {
        match self {
            Self::AcceptProposal => "accept-proposal",
            Self::Agree => "agree",
            Self::Cancel => "cancel",
            Self::CallForProposal => "cfp",
            Self::Confirm => "confirm",
            Self::Disconfirm => "disconfirm",
            Self::Failure => "failure",
            Self::InformIf => "inform-if",
            Self::Inform => "inform",
            Self::InformRef => "inform-ref",
            Self::NotUnderstood => "not-understood",
            Self::Propagate => "propagate",
            Self::Propose => "propose",
            Self::Proxy => "proxy",
            Self::QueryIf => "query-if",
            Self::QueryRef => "query-ref",
            Self::Refuse => "refuse",
            Self::RejectProposal => "reject-proposal",
            Self::Request => "request",
            Self::RequestWhen => "request-when",
            Self::RequestWhenever => "request-whenever",
            Self::Subscribe => "subscribe",
        }
    }

    /// Returns the performative with this name in the standard, compared without case, because some platforms use
    /// capitals. `None`: there is none.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|performative| performative.word().eq_ignore_ascii_case(word))
    }
}

impl fmt::Display for Performative {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// A message of the Agent Communication Language. `C` is the type of its content; messages with other platforms are
/// translated to and from text, [`WireMessage`](crate::wire::WireMessage).
#[derive(Clone, Debug, PartialEq)]
pub struct AclMessage<C = String> {
    /// The communicative act.
    pub performative: Performative,
    /// The agent that sends the message.
    pub sender: AgentId,
    /// The agents that the message is for.
    pub receivers: Vec<AgentId>,
    /// The content, a value of the platform's own type.
    pub content: C,
    /// The language of the content: `fipa-sl0`, `bottega-typed`, …; empty: none is named.
    pub language: &'static str,
    /// The ontology of the content: `fipa-agent-management`, `bottega-farm`, …; empty: none is named.
    pub ontology: &'static str,
    /// The interaction protocol: `fipa-contract-net`, `fipa-request`, `fipa-subscribe`, …; empty: none.
    pub protocol: &'static str,
    /// The number of the conversation, chosen by the agent that began it; 0: none.
    pub conversation_id: u64,
    /// The number that a reply must have as its `in_reply_to`; 0: none.
    pub reply_with: u64,
    /// The `reply_with` of the message that this one replies to; 0: none.
    pub in_reply_to: u64,
    /// The time until which a reply is accepted; `None`: no limit.
    pub reply_by: Option<Time>,
}

impl<C> AclMessage<C> {
    /// Makes a message to one receiver, outside any conversation: without language, ontology, protocol and deadline.
    pub fn new(performative: Performative, sender: AgentId, receiver: AgentId, content: C) -> Self {
        Self {
            performative,
            sender,
            receivers: vec![receiver],
            content,
            language: "",
            ontology: "",
            protocol: "",
            conversation_id: 0,
            reply_with: 0,
            in_reply_to: 0,
            reply_by: None,
        }
    }

    /// Returns a reply of `from` to the sender: same conversation, protocol, language and ontology, and `in_reply_to`
    /// set to this message's `reply_with`.
    pub fn reply(&self, performative: Performative, from: AgentId, content: C) -> Self {
        Self {
            language: self.language,
            ontology: self.ontology,
            protocol: self.protocol,
            conversation_id: self.conversation_id,
            in_reply_to: self.reply_with,
            ..Self::new(performative, from, self.sender.clone(), content)
        }
    }

    /// Returns the message with its content replaced by `change` of it.
    pub fn map<D>(self, change: impl FnOnce(C) -> D) -> AclMessage<D> {
        AclMessage {
            performative: self.performative,
            sender: self.sender,
            receivers: self.receivers,
            content: change(self.content),
            language: self.language,
            ontology: self.ontology,
            protocol: self.protocol,
            conversation_id: self.conversation_id,
            reply_with: self.reply_with,
            in_reply_to: self.in_reply_to,
            reply_by: self.reply_by,
        }
    }

    /// Returns the not-understood reply of `from`, which repeats the content. `None` in reply to a not-understood or a
    /// failure, to avoid endless replies.
    pub fn not_understood(&self, from: AgentId) -> Option<Self>
    where
        C: Clone,
    {
        if matches!(self.performative, Performative::NotUnderstood | Performative::Failure) {
            return None;
        }
        Some(self.reply(Performative::NotUnderstood, from, self.content.clone()))
    }
}
