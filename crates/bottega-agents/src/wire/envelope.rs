//! Envelopes in XML (FIPA00067, FIPA00085).

use std::{collections::BTreeMap, fmt::Write};

use super::{
    ADDRESSES_MAX, AGENTS_MAX, DateTime, USER_PARAMETERS_MAX, WireError, bad_value, bounded, identifier,
    xml::{self, XmlElement, escape},
};
use crate::AgentId;

/// Maximum number of stamps on an envelope.
const STAMPS_MAX: usize = 64;

/// The envelope of a message: addressing and trace.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Envelope {
    /// The receivers of the message.
    pub to: Vec<AgentId>,
    /// The sender of the message, if it is named.
    pub from: Option<AgentId>,
    /// A comment, which no platform interprets.
    pub comments: Option<String>,
    /// The name of the message's representation: [`STRING_FORM`](super::STRING_FORM), [`XML_FORM`](super::XML_FORM), or
    /// one that is not supported.
    pub acl_representation: String,
    /// Length of the message in bytes, as the sender states it.
    pub payload_length: Option<u64>,
    /// Character set of the message; absent: ASCII.
    pub payload_encoding: Option<String>,
    /// The date-time of sending.
    pub date: Option<DateTime>,
    /// The receivers of this copy. Empty: all of `to`.
    pub intended_receivers: Vec<AgentId>,
    /// The stamps of the channels that it passed, in order.
    pub received: Vec<Received>,
    /// User-defined parameters, by name.
    pub user: BTreeMap<String, String>,
}

/// The stamp of a channel that forwarded the message.
#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    /// The address of the channel that set the stamp.
    pub by: String,
    /// The date-time at which the channel got the message; the document type allows a stamp without one.
    pub date: Option<DateTime>,
    /// The address of the channel from which it came.
    pub from: Option<String>,
    /// The identifier that the channel gave to the message.
    pub id: Option<String>,
    /// The name of the message transport that delivered the message.
    pub via: Option<String>,
}

/// Parses an envelope: for each parameter the value with the greatest index; all stamps in order of index.
///
/// # Errors
/// The text is not well-formed XML, has a document type or an entity, or is not an envelope; receivers, the
/// representation, or the name of an agent are missing; an index, a length or a date-time is invalid; or a limit is
/// exceeded.
pub fn parse_envelope(text: &str) -> Result<Envelope, WireError> {
    let root = xml::parse(text)?;
    if root.name != "envelope" {
        return Err(WireError::Missing { object: "document", part: "envelope" });
    }
    let mut params = Vec::new();
    for element in root.children("params") {
        let index = element.attribute("index").unwrap_or("1");
        params.push((index.trim().parse::<u32>().map_err(|_| bad_value("index", index))?, element));
    }
    params.sort_by_key(|(index, _)| *index);
    let mut envelope = Envelope::default();
    for (_, params) in params {
        read_params(&mut envelope, params)?;
    }
    let missing = |part| WireError::Missing { object: "envelope", part };
    if envelope.to.is_empty() {
        return Err(missing("to"));
    }
    if envelope.acl_representation.is_empty() {
        return Err(missing("acl-representation"));
    }
    Ok(envelope)
}

/// Takes in one `params` element.
fn read_params(envelope: &mut Envelope, params: &XmlElement) -> Result<(), WireError> {
    let trimmed = |element: &XmlElement| element.text.trim().to_owned();
    let (mut to, mut intended) = (Vec::new(), Vec::new());
    for element in &params.children {
        match element.name.as_str() {
            "to" => push_agents(&mut to, element)?,
            "intended-receiver" => push_agents(&mut intended, element)?,
            "from" => envelope.from = element.child("agent-identifier").map(parse_agent).transpose()?,
            "comments" => envelope.comments = Some(element.text.clone()),
            "acl-representation" => envelope.acl_representation = trimmed(element),
            "payload-length" => {
                let text = trimmed(element);
                envelope.payload_length = Some(text.parse().map_err(|_| bad_value("payload-length", &text))?);
            }
            "payload-encoding" => envelope.payload_encoding = Some(trimmed(element)),
            "date" => envelope.date = Some(DateTime::parse(element.text.trim())?),
            "received" => {
                bounded(envelope.received.len(), STAMPS_MAX, "stamps")?;
                envelope.received.push(parse_stamp(element)?);
            }
            "user-defined" => {
                bounded(envelope.user.len(), USER_PARAMETERS_MAX, "user-defined parameters")?;
                // Ignore a parameter without a name, which the document type allows
                if let Some(key) = element.attribute("href") {
                    envelope.user.insert(key.to_owned(), element.text.clone());
                }
            }
            _ => {}
        }
    }
    if !to.is_empty() {
        envelope.to = to;
    }
    if !intended.is_empty() {
        envelope.intended_receivers = intended;
    }
    Ok(())
}

fn push_agents(agents: &mut Vec<AgentId>, element: &XmlElement) -> Result<(), WireError> {
    for agent in element.children("agent-identifier") {
        bounded(agents.len(), AGENTS_MAX, "agents")?;
        agents.push(parse_agent(agent)?);
    }
    Ok(())
}

/// Unlike in messages, a name is text here.
fn parse_agent(element: &XmlElement) -> Result<AgentId, WireError> {
    let name = element.child("name").map(|name| name.text.trim().to_owned()).filter(|name| !name.is_empty());
    let name = name.ok_or(WireError::Missing { object: "agent-identifier", part: "name" })?;
    let mut addresses = Vec::new();
    for url in element.children("addresses").flat_map(|addresses| addresses.children("url")) {
        bounded(addresses.len(), ADDRESSES_MAX, "addresses")?;
        addresses.push(url.text.trim().to_owned());
    }
    Ok(identifier(name, addresses))
}

fn parse_stamp(element: &XmlElement) -> Result<Received, WireError> {
    // The standard's example has the values in attributes, its document type has url elements
    let value = |name: &str| {
        let part = element.child(name)?;
        let url = || part.child("url").map_or(part.text.as_str(), |url| url.text.as_str());
        Some(part.attribute("value").unwrap_or_else(url).trim().to_owned())
    };
    let date = value("received-date").filter(|date| !date.is_empty());
    Ok(Received {
        by: value("received-by").ok_or(WireError::Missing { object: "received", part: "received-by" })?,
        date: date.map(|date| DateTime::parse(&date)).transpose()?,
        from: value("received-from"),
        id: value("received-id"),
        via: value("received-via"),
    })
}

/// Returns an envelope as XML of the document type of FIPA00085: one `params` of the sender, one per stamp. It parses
/// to the same envelope if names, addresses and stamps have no blanks at their ends.
///
/// # Errors
/// A text contains characters that XML cannot represent.
pub fn print_envelope(envelope: &Envelope) -> Result<String, WireError> {
    let mut out = "<?xml version=\"1.0\"?>\n<envelope><params index=\"1\">".to_owned();
    push_agents_element(&mut out, "to", &envelope.to)?;
    push_agents_element(&mut out, "from", envelope.from.as_slice())?;
    let length = envelope.payload_length.map(|length| length.to_string());
    for (name, value) in [
        ("comments", envelope.comments.as_deref()),
        ("acl-representation", Some(envelope.acl_representation.as_str())),
        ("payload-length", length.as_deref()),
        ("payload-encoding", envelope.payload_encoding.as_deref()),
        ("date", envelope.date.as_ref().map(DateTime::as_str)),
    ] {
        if let Some(value) = value {
            _ = write!(out, "<{name}>{}</{name}>", escape(value)?);
        }
    }
    push_agents_element(&mut out, "intended-receiver", &envelope.intended_receivers)?;
    for (name, value) in &envelope.user {
        _ = write!(out, "<user-defined href=\"{}\">{}</user-defined>", escape(name)?, escape(value)?);
    }
    out.push_str("</params>");
    for (stamp, index) in envelope.received.iter().zip(2..) {
        _ = write!(out, "<params index=\"{index}\">");
        push_stamp(&mut out, stamp)?;
        out.push_str("</params>");
    }
    out.push_str("</envelope>");
    Ok(out)
}

/// Formats a stamp: the channel is a URL in an element, everything else an attribute.
fn push_stamp(out: &mut String, stamp: &Received) -> Result<(), WireError> {
    _ = write!(out, "<received><received-by><url>{}</url></received-by>", escape(&stamp.by)?);
    if let Some(from) = &stamp.from {
        _ = write!(out, "<received-from><url>{}</url></received-from>", escape(from)?);
    }
    // The date is required, but may be empty
    match &stamp.date {
        Some(date) => _ = write!(out, "<received-date value=\"{date}\"/>"),
        None => out.push_str("<received-date/>"),
    }
    for (name, value) in [("received-id", &stamp.id), ("received-via", &stamp.via)] {
        if let Some(value) = value {
            _ = write!(out, "<{name} value=\"{}\"/>", escape(value)?);
        }
    }
    out.push_str("</received>");
    Ok(())
}

/// Formats all agents in one element: the document type allows it once. Nothing without agents.
fn push_agents_element(out: &mut String, name: &str, agents: &[AgentId]) -> Result<(), WireError> {
    if agents.is_empty() {
        return Ok(());
    }
    _ = write!(out, "<{name}>");
    for agent in agents {
        push_agent(out, agent)?;
    }
    _ = write!(out, "</{name}>");
    Ok(())
}

fn push_agent(out: &mut String, agent: &AgentId) -> Result<(), WireError> {
    _ = write!(out, "<agent-identifier><name>{}</name>", escape(&agent.name)?);
    if !agent.addresses.is_empty() {
        out.push_str("<addresses>");
        for address in agent.addresses.iter() {
            _ = write!(out, "<url>{}</url>", escape(address)?);
        }
        out.push_str("</addresses>");
    }
    out.push_str("</agent-identifier>");
    Ok(())
}
