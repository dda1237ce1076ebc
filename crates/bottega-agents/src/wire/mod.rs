//! Messages and envelopes as text, in the forms of FIPA: everything that crosses the border of the platform.
//!
//! [`WireMessage`] is a message as strangers see it, all in text; within a platform it is the typed
//! [`AclMessage`](crate::AclMessage). Every reader bounds what it takes and answers nonsense with a [`WireError`].

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

/// A form in which messages are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// Brackets, words and strings: what every platform reads.
    #[default]
    String,
    /// XML.
    Xml,
}

impl Form {
    /// Its name in envelopes.
    pub fn name(self) -> &'static str {
        match self {
            Self::String => STRING_FORM,
            Self::Xml => XML_FORM,
        }
    }

    /// The form of this name, if it is one of these.
    pub fn of_name(name: &str) -> Option<Self> {
        [Self::String, Self::Xml].into_iter().find(|form| form.name().eq_ignore_ascii_case(name))
    }
}

/// The most bytes of a message or envelope as text: enough for the largest entry of a directory, quoted.
pub const TEXT_BYTES_MAX: usize = 3 << 20;
/// The most agents in one parameter.
pub const AGENTS_MAX: usize = 1024;
/// The most addresses of an agent.
pub const ADDRESSES_MAX: usize = 64;
/// The most user-defined parameters.
pub const USER_PARAMETERS_MAX: usize = 64;

/// A message in text (FIPA00061).
#[derive(Clone, Debug, PartialEq)]
pub struct WireMessage {
    /// What the sender does by saying it.
    pub performative: Performative,
    /// Who says it.
    pub sender: Option<AgentId>,
    /// To whom.
    pub receivers: Vec<AgentId>,
    /// To whom answers go, if not to the sender.
    pub reply_to: Vec<AgentId>,
    /// What is said.
    pub content: Option<String>,
    /// The language of the content.
    pub language: Option<String>,
    /// The encoding of the content.
    pub encoding: Option<String>,
    /// The vocabulary of the content.
    pub ontology: Option<String>,
    /// The interaction protocol.
    pub protocol: Option<String>,
    /// Ties the messages of one conversation together.
    pub conversation_id: Option<String>,
    /// What an answer must carry as `in_reply_to`.
    pub reply_with: Option<String>,
    /// The `reply_with` of the message that this one answers.
    pub in_reply_to: Option<String>,
    /// When an answer is of no more use.
    pub reply_by: Option<DateTime>,
    /// User-defined parameters; their names begin with `X-`.
    pub user: BTreeMap<String, String>,
}

impl WireMessage {
    /// A message that says nothing yet.
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

    /// An answer of `from`, threaded as the standard wants it: to `reply_to` if given, else to the sender.
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

/// Refuses one more than `max`.
fn bounded(count: usize, max: usize, what: &'static str) -> Result<(), WireError> {
    if count < max { Ok(()) } else { Err(WireError::TooMany { what, max }) }
}

/// Refuses a second value.
fn set_once<T>(slot: &mut Option<T>, value: T, name: &str) -> Result<(), WireError> {
    if slot.replace(value).is_some() { Err(WireError::Twice(name.to_owned())) } else { Ok(()) }
}

/// An identifier as it was read.
fn identifier(name: String, addresses: Vec<String>) -> AgentId {
    AgentId { name: name.into(), addresses: addresses.into() }
}
