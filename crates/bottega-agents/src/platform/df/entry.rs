//! The entries of a directory, and who may see them.

use super::super::{
    management::{DfAgentDescription, RefuseReason, largest},
    ontology::{DF_DESCRIPTION, df_description, read_df_description},
    service::Said,
    signature::{name_of_request, written_by},
};
use crate::{AgentId, Revision, Time, sl, wire::Calendar};

/// The longest text of an entry, in bytes.
pub const DESCRIPTION_BYTES_MAX: usize = 1 << 20;

/// The most offers of one answer, also where all were asked for: they must fit into a message.
pub const RESULTS_MAX: usize = 500;

/// The most that they take together, in bytes; one that takes as much by itself is told.
pub const RESULTS_BYTES_MAX: usize = DESCRIPTION_BYTES_MAX;

pub(super) const ENTRY: &str = "df/agent/";

/// One offer and the write that entered it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DfEntry {
    pub(super) offer: DfAgentDescription,
    /// The request that it was entered by.
    pub(super) by: Option<String>,
    pub(super) revision: Revision,
    /// Of its text.
    pub(super) bytes: usize,
}

impl DfEntry {
    /// What others wrote into the store: what cannot be read is passed over.
    pub(super) fn parse(calendar: Calendar, now: Time, revision: Revision, text: &str) -> Option<Self> {
        let term = sl::parse_term(text).ok()?;
        let offer = read_df_description(calendar, now, &term).ok()?;
        offer.name.as_ref()?;
        Some(Self { offer, by: written_by(DF_DESCRIPTION, &term), revision, bytes: text.len() })
    }

    /// Whether it is there by this request, which has come before.
    pub(super) fn is_by(&self, request: &Said, description: &DfAgentDescription) -> bool {
        // The lease is what was granted.
        let granted = DfAgentDescription { lease_time: self.offer.lease_time, ..description.clone() };
        self.by.is_some() && self.by == name_of_request(request) && self.offer == granted
    }
}

/// What an agent offers, as an entry of the yellow pages says it. When a lease ends is told by nobody's time.
pub fn read_yellow_page(text: &str) -> Option<DfAgentDescription> {
    DfEntry::parse(Calendar::default(), Time::ZERO, Revision::ABSENT, text).map(|entry| entry.offer)
}

/// Whether the lease of an offer has not ended.
pub(super) fn holds(offer: &DfAgentDescription, now: Time) -> bool {
    offer.lease_time.is_none_or(|end| now < end)
}

/// Whether `asker` may see an offer: what is `local` and not `global` is for agents of the directory's platform only.
pub(super) fn is_for(df: &AgentId, asker: &AgentId, offer: &DfAgentDescription) -> bool {
    let says = |scope: &str| offer.scope.iter().any(|said| said.eq_ignore_ascii_case(scope));
    let platform = |agent: &AgentId| agent.name.rsplit_once('@').map(|(_, platform)| platform.to_lowercase());
    !says("local") || says("global") || platform(df) == platform(asker)
}

/// The refusal of a description that is too large.
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

/// Names of agents are compared without case.
pub(super) fn index(agent: &AgentId) -> String {
    agent.name.to_lowercase()
}

pub(super) fn key(agent: &AgentId) -> String {
    format!("{ENTRY}{}", index(agent))
}
