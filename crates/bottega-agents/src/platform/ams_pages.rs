//! Entries of the white pages in the store.

use super::{
    LifeCycleState,
    management::{AmsAgentDescription, LifeCycleRequest},
    ontology::{AMS_DESCRIPTION, Object, ams_description, read_ams_description},
    signature::{by_request, written_by},
};
use crate::{AgentId, sl, sl::Term};

pub(super) const AGENT: &str = "ams/agent/";
pub(super) const NODE: &str = "ams/node/";
/// The parameter of an entry with the requested end of an agent.
const ENDING: &str = ":X-ending";

/// The entry of an agent.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AmsEntry {
    pub(super) description: AmsAgentDescription,
    /// The requested end of the agent. A destroyed agent counts as gone.
    pub(super) ending: Option<LifeCycleRequest>,
    /// The request that created the entry.
    pub(super) by: Option<String>,
}

impl AmsEntry {
    pub(super) fn of(description: AmsAgentDescription) -> Self {
        Self { description, ending: None, by: None }
    }

    pub(super) fn print(&self) -> String {
        let mut term = by_request(ams_description(&self.description), self.by.as_deref());
        if let (Term::List(terms), Some(ending)) = (&mut term, self.ending) {
            terms.extend([Term::Bare(ENDING.to_owned()), Term::text(ending.word())]);
        }
        sl::print_term(&term)
    }

    /// Parses an entry; others write to the store too, so invalid ones are ignored.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let term = sl::parse_term(text).ok()?;
        let description = read_ams_description(&term).ok()?;
        description.name.as_ref()?;
        let object = Object::read(AMS_DESCRIPTION, &term).ok()?;
        let ending = object.text("X-ending").ok()?;
        let ending = ending.and_then(|word| LifeCycleRequest::ALL.into_iter().find(|request| request.word() == word));
        Some(Self { description, ending, by: written_by(AMS_DESCRIPTION, &term) })
    }

    pub(super) fn is_gone(&self) -> bool {
        self.ending == Some(LifeCycleRequest::Destroy)
    }

    pub(super) fn state(&self) -> LifeCycleState {
        self.description.state.unwrap_or(LifeCycleState::Active)
    }
}

/// Returns the agent in the text of an entry of the white pages; `None`: the text is not a valid entry, or the agent
/// was destroyed.
pub fn read_white_page(text: &str) -> Option<AmsAgentDescription> {
    AmsEntry::parse(text).filter(|entry| !entry.is_gone()).map(|entry| entry.description)
}

/// The content of an entry of the white pages, for routing.
#[derive(Clone, Debug, PartialEq)]
pub enum AmsPages<'a> {
    /// The entry of an agent.
    Agent {
        /// The agent's name in lower case.
        name: &'a str,
        /// The agent's identifier with addresses; `None`: the agent is gone, or its entry is invalid.
        agent: Option<AgentId>,
    },
    /// A process that serves the platform.
    Node {
        /// The address of the process.
        address: &'a str,
        /// True if the process serves the platform; false if it has ended.
        present: bool,
    },
}

impl<'a> AmsPages<'a> {
    /// The common prefix of the keys of the white pages.
    pub const PREFIX: &'static str = "ams/";

    /// Parses an entry from its key and its text. `None`: it is neither that of an agent nor that of a process.
    pub fn read(key: &'a str, text: &str) -> Option<Self> {
        if let Some(name) = key.strip_prefix(AGENT) {
            let entry = AmsEntry::parse(text).filter(|entry| !entry.is_gone());
            return Some(Self::Agent { name, agent: entry.and_then(|entry| entry.description.name) });
        }
        let address = key.strip_prefix(NODE)?;
        Some(Self::Node { address, present: !text.is_empty() })
    }
}
