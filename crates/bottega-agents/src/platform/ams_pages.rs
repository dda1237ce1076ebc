//! The white pages as they stand in the store.

use super::{
    LifeCycleState,
    management::{AmsAgentDescription, LifeCycleRequest},
    ontology::{AMS_DESCRIPTION, Object, ams_description, read_ams_description},
    signature::{by_request, written_by},
};
use crate::{AgentId, sl, sl::Term};

pub(super) const AGENT: &str = "ams/agent/";
pub(super) const NODE: &str = "ams/node/";
/// The parameter of an entry that says how an agent shall end.
const ENDING: &str = ":X-ending";

/// An agent as it stands in the store.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AmsEntry {
    pub(super) description: AmsAgentDescription,
    /// It is asked to end, or must: then it counts as gone.
    pub(super) ending: Option<LifeCycleRequest>,
    /// The request that it was entered by.
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

    /// What others wrote into the store: what cannot be read is passed over.
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

/// The white pages, for those who find ways by them.
#[derive(Clone, Debug, PartialEq)]
pub enum AmsPages<'a> {
    /// Of an agent.
    Agent {
        /// Its name in small letters.
        name: &'a str,
        /// Where it lives; `None`: it is gone.
        agent: Option<AgentId>,
    },
    /// Of a process that serves the platform.
    Node {
        /// Where it can be reached.
        address: &'a str,
        /// Whether it serves.
        present: bool,
    },
}

impl<'a> AmsPages<'a> {
    /// How the names of the entries begin.
    pub const PREFIX: &'static str = "ams/";

    /// Reads an entry; `None`: it says nothing of this kind.
    pub fn read(key: &'a str, text: &str) -> Option<Self> {
        if let Some(name) = key.strip_prefix(AGENT) {
            let entry = AmsEntry::parse(text).filter(|entry| !entry.is_gone());
            return Some(Self::Agent { name, agent: entry.and_then(|entry| entry.description.name) });
        }
        let address = key.strip_prefix(NODE)?;
        Some(Self::Node { address, present: !text.is_empty() })
    }
}
