//! Messages of the door to agents of other platforms; its entry in the yellow pages; the keys of deliveries.

use std::sync::Arc;

use bottega_agents::{
    AclMessage, AgentId, Performative, Revision,
    gateway::PlainContent,
    platform::{DfAgentDescription, Property, ServiceDescription},
    sl,
    sl::Term,
    wire::WireMessage,
};
use bottega_farm::ZoneId;

use super::{
    super::{
        talk::{self, Message},
        terms::Unread,
    },
    ontology::{ONTOLOGY, SERVICE_TYPE},
};

/// Returns the key of an agent in maps: names are compared without case.
pub(super) fn index(agent: &AgentId) -> String {
    agent.name.to_lowercase()
}

/// Returns the secret key of a delivery.
pub(super) fn key_of(secret: u64, agent: &str, zone: ZoneId, fence: Revision) -> String {
    let mut hasher = blake3::Hasher::new();
    for number in [secret, u64::from(zone.0), fence.0] {
        hasher.update(&number.to_le_bytes());
    }
    hasher.update(agent.as_bytes());
    hasher.finalize().to_hex().as_str()[..32].to_owned()
}

/// Returns the content of a message from an agent of another platform; unlike [`talk::foreign`], also of answers. `None`: it has
/// no such content.
pub(super) fn foreign(message: &Message) -> Option<&WireMessage> {
    match &message.content {
        PlainContent::Foreign(wire) => Some(wire),
        PlainContent::Management(_) => None,
    }
}

/// Returns the expressions in a content of this ontology.
pub(super) fn talk_terms(wire: &WireMessage) -> Result<Vec<Term>, Unread> {
    talk::is_of(wire, ONTOLOGY)?;
    talk::expressions(wire)
}

/// Returns a message that starts a conversation or continues one, but is not a reply.
pub(super) fn say(
    me: &AgentId,
    to: &AgentId,
    act: Performative,
    protocol: &'static str,
    conversation: u64,
    terms: &[Term],
) -> Message {
    let content = WireMessage {
        content: Some(sl::print(terms)),
        language: Some("fipa-sl".to_owned()),
        ontology: Some(ONTOLOGY.to_owned()),
        ..WireMessage::new(act)
    };
    AclMessage {
        protocol,
        conversation_id: conversation,
        reply_with: conversation,
        ..AclMessage::new(act, me.clone(), to.clone(), PlainContent::Foreign(Arc::new(content)))
    }
}

/// Returns the entry of a Master in the yellow pages.
pub(super) fn offer(id: &AgentId, job: u32) -> DfAgentDescription {
    let texts = |texts: &[&str]| texts.iter().map(|&text| text.to_owned()).collect::<Vec<String>>();
    let protocols = texts(&["fipa-subscribe", "fipa-request", "fipa-contract-net"]);
    let (ontologies, languages) = (texts(&[ONTOLOGY]), texts(&["fipa-sl", "fipa-sl0"]));
    let job = Property { name: "job".to_owned(), value: Term::integer(job.into()) };
    let service = ServiceDescription {
        name: Some("master".to_owned()),
        service_type: Some(SERVICE_TYPE.to_owned()),
        protocols: protocols.clone(),
        ontologies: ontologies.clone(),
        languages: languages.clone(),
        ownership: None,
        properties: vec![job],
    };
    let services = vec![service];
    DfAgentDescription { name: Some(id.clone()), protocols, ontologies, languages, services, ..Default::default() }
}
