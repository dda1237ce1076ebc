//! Messages and envelopes as text, in FIPA's representations: everything that crosses the platform's border.
//!
//! [`WireMessage`] is a message to or from another platform, all in text; within a platform it is the typed
//! [`AclMessage`](crate::AclMessage). Every parser has limits and reports invalid input as a [`WireError`].

mod acl_xml;
mod date;
mod envelope;
mod error;
mod string_form;
mod xml;

use std::collections::BTreeMap;

pub use acl_xml::{parse_xml, print_xml};
pub use date::{Calendar, DateTime};
pub use envelope::{Envelope, Received, parse_envelope, print_envelope};
pub use error::WireError;
pub(crate) use error::bad_value;
pub(crate) use string_form::{TextReader, is_word, push_text};
pub use string_form::{parse_string, print_string};

use crate::{AgentId, Performative};

/// The name of the string form in envelopes (FIPA00070).
pub const STRING_FORM: &str = "fipa.acl.rep.string.std";
/// The name of the XML form in envelopes (FIPA00071).
pub const XML_FORM: &str = "fipa.acl.rep.xml.std";

/// A representation of messages as text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// The string representation: every platform reads it.
    #[default]
    String,
    /// The XML representation.
    Xml,
}

impl Form {
    /// Returns the name of the representation in envelopes.
    pub fn name(self) -> &'static str {
        match self {
            Self::String => STRING_FORM,
            Self::Xml => XML_FORM,
        }
    }

    /// Returns the representation with this name in envelopes, compared without case; `None`: it is unsupported.
    pub fn of_name(name: &str) -> Option<Self> {
        [Self::String, Self::Xml].into_iter().find(|form| form.name().eq_ignore_ascii_case(name))
    }
}

/// Maximum length of a message or envelope as text, in bytes: enough for the largest entry of a directory, quoted.
pub const TEXT_BYTES_MAX: usize = 3 << 20;
/// Maximum number of agents in one parameter.
pub const AGENTS_MAX: usize = 1024;
/// Maximum number of addresses of an agent.
pub const ADDRESSES_MAX: usize = 64;
/// Maximum number of user-defined parameters of a message or an envelope.
pub const USER_PARAMETERS_MAX: usize = 64;

/// A message with all its parameters as text (FIPA00061).
#[derive(Clone, Debug, PartialEq)]
pub struct WireMessage {
    /// The communicative act.
    pub performative: Performative,
    /// The agent that sends the message, with its addresses; `None`: it is not named.
    pub sender: Option<AgentId>,
    /// The agents that the message is for, with their addresses.
    pub receivers: Vec<AgentId>,
    /// The receivers of replies; empty: the sender.
    pub reply_to: Vec<AgentId>,
    /// The content, as text in its language.
    pub content: Option<String>,
    /// The language of the content.
    pub language: Option<String>,
    /// The encoding of the content.
    pub encoding: Option<String>,
    /// The ontology of the content.
    pub ontology: Option<String>,
    /// The interaction protocol.
    pub protocol: Option<String>,
    /// The name of the conversation, chosen by the agent that began it.
    pub conversation_id: Option<String>,
    /// The text that a reply must have as its `in_reply_to`.
    pub reply_with: Option<String>,
    /// The `reply_with` of the message that this one replies to.
    pub in_reply_to: Option<String>,
    /// The time until which a reply is accepted.
    pub reply_by: Option<DateTime>,
    /// User-defined parameters; their names start with `X-`.
    pub user: BTreeMap<String, String>,
}

impl WireMessage {
    /// Makes a message with this performative, without sender, receivers and content.
    pub fn new(performative: Performative) -> Self {
        Self {
            performative,
            sender: None,
            receivers: Vec::new(),
            reply_to: Vec::new(),
            content: None,
            language: None,
            encoding: None,
            ontology: None,
            protocol: None,
            conversation_id: None,
            reply_with: None,
            in_reply_to: None,
            reply_by: None,
            user: BTreeMap::new(),
        }
    }

    /// Returns a reply of `from`, threaded according to the standard: to `reply_to` if given, else to the sender.
    pub fn reply(&self, performative: Performative, from: AgentId, content: String) -> Self {
        let receivers =
            if self.reply_to.is_empty() { self.sender.iter().cloned().collect() } else { self.reply_to.clone() };
        Self {
            sender: Some(from),
            receivers,
            content: Some(content),
            language: self.language.clone(),
            encoding: self.encoding.clone(),
            ontology: self.ontology.clone(),
            protocol: self.protocol.clone(),
            conversation_id: self.conversation_id.clone(),
            in_reply_to: self.reply_with.clone(),
            ..Self::new(performative)
        }
    }
}

/// Checks that one more item is within `max`.
fn bounded(count: usize, max: usize, what: &'static str) -> Result<(), WireError> {
    if count < max { Ok(()) } else { Err(WireError::TooMany { what, max }) }
}

/// Sets a value; fails if it is set already.
fn set_once<T>(slot: &mut Option<T>, value: T, name: &str) -> Result<(), WireError> {
    if slot.replace(value).is_some() { Err(WireError::Twice(name.to_owned())) } else { Ok(()) }
}

/// Returns an identifier from its parsed parts.
fn identifier(name: String, addresses: Vec<String>) -> AgentId {
    AgentId { name: name.into(), addresses: addresses.into() }
}
