//! Entries of a directory, and their visibility.

use super::super::{
    management::{DfAgentDescription, RefuseReason, largest},
    ontology::{DF_DESCRIPTION, df_description, read_df_description},
    service::Said,
    signature::{name_of_request, written_by},
};
use crate::{AgentId, Revision, Time, sl, wire::Calendar};

/// Maximum length of an entry's text, in bytes.
pub const DESCRIPTION_BYTES_MAX: usize = 1 << 20;

/// Maximum number of offers in an answer, even if all were requested: they must fit into a message.
pub const RESULTS_MAX: usize = 500;

/// Maximum length of the returned offers together, in bytes; a single offer of that length is returned.
pub const RESULTS_BYTES_MAX: usize = DESCRIPTION_BYTES_MAX;

pub(super) const ENTRY: &str = "df/agent/";

/// An offer with the write that entered it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DfEntry {
    pub(super) offer: DfAgentDescription,
    /// The request that made the entry.
    pub(super) by: Option<String>,
    pub(super) revision: Revision,
    /// Length of the entry's text, in bytes.
    pub(super) bytes: usize,
}

impl DfEntry {
    /// Parses an entry; others write to the store too, so invalid ones are ignored.
    pub(super) fn parse(calendar: Calendar, now: Time, revision: Revision, text: &str) -> Option<Self> {
        let term = sl::parse_term(text).ok()?;
        let offer = read_df_description(calendar, now, &term).ok()?;
        offer.name.as_ref()?;
        Some(Self { offer, by: written_by(DF_DESCRIPTION, &term), revision, bytes: text.len() })
    }

    /// Returns true if this same request has already made the entry.
    pub(super) fn is_by(&self, request: &Said, description: &DfAgentDescription) -> bool {
        // Compare with the granted lease
        let granted = DfAgentDescription { lease_time: self.offer.lease_time, ..description.clone() };
        self.by.is_some() && self.by == name_of_request(request) && self.offer == granted
    }
}

/// Returns the offer in the text of an entry of the yellow pages; `None`: the text is not a valid entry. Its
/// `lease_time` counts from the beginning of 1970 (UTC), not from the start of the platform.
pub fn read_yellow_page(text: &str) -> Option<DfAgentDescription> {
    DfEntry::parse(Calendar::default(), Time::ZERO, Revision::ABSENT, text).map(|entry| entry.offer)
}

/// Returns true if the lease of an offer has not ended.
pub(super) fn holds(offer: &DfAgentDescription, now: Time) -> bool {
    offer.lease_time.is_none_or(|end| now < end)
}

/// Returns true if `asker` may see an offer: `local` offers that are not `global` are for agents of the directory's
/// platform only.
pub(super) fn is_for(df: &AgentId, asker: &AgentId, offer: &DfAgentDescription) -> bool {
    let says = |scope: &str| offer.scope.iter().any(|said| said.eq_ignore_ascii_case(scope));
    let platform = |agent: &AgentId| agent.name.rsplit_once('@').map(|(_, platform)| platform.to_lowercase());
    !says("local") || says("global") || platform(df) == platform(asker)
}

/// Returns the refusal of a description that is too large.
pub(super) fn largest_of(calendar: Calendar, offer: &DfAgentDescription) -> RefuseReason {
    let bytes = |part: DfAgentDescription| sl::print_term(&df_description(calendar, &part)).len();
    let none = DfAgentDescription::default;
    let sizes = [
        ("services", bytes(DfAgentDescription { services: offer.services.clone(), ..none() })),
        ("protocols", bytes(DfAgentDescription { protocols: offer.protocols.clone(), ..none() })),
        ("ontologies", bytes(DfAgentDescription { ontologies: offer.ontologies.clone(), ..none() })),
        ("languages", bytes(DfAgentDescription { languages: offer.languages.clone(), ..none() })),
        ("scope", bytes(DfAgentDescription { scope: offer.scope.clone(), ..none() })),
        ("name", bytes(DfAgentDescription { name: offer.name.clone(), ..none() })),
    ];
    largest(DF_DESCRIPTION, &sizes)
}

/// Returns the key of an agent: names are compared without case.
pub(super) fn index(agent: &AgentId) -> String {
    agent.name.to_lowercase()
}

pub(super) fn key(agent: &AgentId) -> String {
    format!("{ENTRY}{}", index(agent))
}
