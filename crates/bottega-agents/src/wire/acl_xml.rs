//! Messages in XML (FIPA00071).

use std::{collections::BTreeMap, fmt::Write};

use super::{
    ADDRESSES_MAX, AGENTS_MAX, DateTime, USER_PARAMETERS_MAX, WireError, WireMessage, bad_value, bounded, identifier,
    set_once,
    string_form::texts,
    xml::{self, XmlElement, escape},
};
use crate::{AgentId, Performative};

/// Parses a message in the XML representation. Unknown elements are ignored.
///
/// # Errors
/// The text is not well-formed XML, has a document type or an entity, or is not a message; an agent has no name; the
/// performative is unknown, or a date-time is invalid; an element that may occur once is repeated; or a limit is
/// exceeded.
pub fn parse_xml(text: &str) -> Result<WireMessage, WireError> {
    let root = xml::parse(text)?;
    if root.name != "fipa-message" {
        return Err(WireError::Missing { object: "document", part: "fipa-message" });
    }
    let act = root.attribute("act").ok_or(WireError::Missing { object: "fipa-message", part: "act" })?;
    let performative = Performative::from_word(act).ok_or_else(|| bad_value("performative", act))?;
    let mut message = WireMessage::new(performative);
    let known = NamedAgents::of(&root);
    for element in &root.children {
        let name = element.name.as_str();
        match name {
            // Several elements with one agent each, or one with several
            "receiver" => push_agents(&mut message.receivers, element, &known)?,
            "reply-to" => push_agents(&mut message.reply_to, element, &known)?,
            "sender" => {
                let agent = element.child("agent-identifier");
                let agent = agent.ok_or(WireError::Missing { object: "sender", part: "agent-identifier" })?;
                set_once(&mut message.sender, parse_agent(agent, &known)?, name)?;
            }
            "content" => set_once(&mut message.content, text_of(element), name)?,
            "language" => set_once(&mut message.language, text_of(element), name)?,
            "encoding" => set_once(&mut message.encoding, text_of(element), name)?,
            "ontology" => set_once(&mut message.ontology, text_of(element), name)?,
            "protocol" => set_once(&mut message.protocol, text_of(element), name)?,
            "conversation-id" => set_once(&mut message.conversation_id, text_of(element), name)?,
            "reply-with" => set_once(&mut message.reply_with, text_of(element), name)?,
            "in-reply-to" => set_once(&mut message.in_reply_to, text_of(element), name)?,
            "reply-by" => {
                let time = element.attribute("time").ok_or(WireError::Missing { object: "reply-by", part: "time" })?;
                set_once(&mut message.reply_by, DateTime::parse(time)?, name)?;
            }
            "user-defined" => {
                bounded(message.user.len(), USER_PARAMETERS_MAX, "user-defined parameters")?;
                // Ignore a parameter without a name, which the document type allows
                let Some(key) = element.attribute("href") else { continue };
                if message.user.insert(key.to_owned(), element.text.clone()).is_some() {
                    return Err(WireError::Twice(key.to_owned()));
                }
            }
            _ => {}
        }
    }
    // Some platforms give it as an attribute and as an element; the element can contain any text
    if message.conversation_id.is_none() {
        message.conversation_id = root.attribute("conversation-id").map(str::to_owned);
    }
    Ok(message)
}

/// The addresses of agents named in full in the message: elsewhere `refid` may refer to them.
struct NamedAgents<'a>(BTreeMap<&'a str, Vec<String>>);

impl<'a> NamedAgents<'a> {
    fn of(root: &'a XmlElement) -> Self {
        let mut known = BTreeMap::new();
        let mut open = vec![root];
        while let Some(element) = open.pop() {
            open.extend(&element.children);
            if let Some(id) = element.child("name").and_then(|name| name.attribute("id")) {
                // An invalid one is reported where it is used
                if let Some(addresses) = addresses_of(element).ok().filter(|addresses| !addresses.is_empty()) {
                    known.insert(id, addresses);
                }
            }
        }
        Self(known)
    }
}

/// Returns the text of an element, or of its reference.
fn text_of(element: &XmlElement) -> String {
    match element.attribute("href") {
        Some(reference) if element.text.is_empty() => reference.to_owned(),
        _ => element.text.clone(),
    }
}

fn push_agents(agents: &mut Vec<AgentId>, element: &XmlElement, known: &NamedAgents<'_>) -> Result<(), WireError> {
    for agent in element.children("agent-identifier") {
        bounded(agents.len(), AGENTS_MAX, "agents")?;
        agents.push(parse_agent(agent, known)?);
    }
    Ok(())
}

fn parse_agent(element: &XmlElement, known: &NamedAgents<'_>) -> Result<AgentId, WireError> {
    let missing = WireError::Missing { object: "agent-identifier", part: "name" };
    let name = element.child("name").ok_or_else(|| missing.clone())?;
    let mut addresses = addresses_of(element)?;
    let name = match (name.attribute("id"), name.attribute("refid"), name.text.trim()) {
        (Some(id), ..) => id,
        (None, Some(other), _) => {
            if addresses.is_empty() {
                addresses.extend(known.0.get(other).into_iter().flatten().cloned());
            }
            other
        }
        (None, None, "") => return Err(missing),
        // Not standard, but written by some platforms, as in envelopes
        (None, None, text) => text,
    };
    Ok(identifier(name.to_owned(), addresses))
}

/// Returns the addresses of an agent; a `url` without an address, which the document type allows, is ignored.
fn addresses_of(agent: &XmlElement) -> Result<Vec<String>, WireError> {
    let mut addresses = Vec::new();
    for url in agent.children("addresses").flat_map(|addresses| addresses.children("url")) {
        bounded(addresses.len(), ADDRESSES_MAX, "addresses")?;
        match (url.attribute("href"), url.text.trim()) {
            (Some(address), _) => addresses.push(address.to_owned()),
            (None, "") => {}
            (None, text) => addresses.push(text.to_owned()),
        }
    }
    Ok(addresses)
}

/// Returns a message as XML of the document type of FIPA00071, which parses to the same message.
///
/// # Errors
/// A text contains characters that XML cannot represent.
pub fn print_xml(message: &WireMessage) -> Result<String, WireError> {
    let mut out = format!("<?xml version=\"1.0\"?>\n<fipa-message act=\"{}\">", message.performative.word());
    if let Some(sender) = &message.sender {
        push_agents_element(&mut out, "sender", std::slice::from_ref(sender))?;
    }
    // The only element that may be repeated, so that every parser accepts it
    for receiver in &message.receivers {
        push_agents_element(&mut out, "receiver", std::slice::from_ref(receiver))?;
    }
    if !message.reply_to.is_empty() {
        push_agents_element(&mut out, "reply-to", &message.reply_to)?;
    }
    for (name, value) in texts(message) {
        if let Some(value) = value {
            _ = write!(out, "<{name}>{}</{name}>", escape(value)?);
        }
    }
    if let Some(by) = &message.reply_by {
        _ = write!(out, "<reply-by time=\"{by}\"/>");
    }
    for (name, value) in &message.user {
        _ = write!(out, "<user-defined href=\"{}\">{}</user-defined>", escape(name)?, escape(value)?);
    }
    out.push_str("</fipa-message>");
    Ok(out)
}

fn push_agents_element(out: &mut String, name: &str, agents: &[AgentId]) -> Result<(), WireError> {
    _ = write!(out, "<{name}>");
    for agent in agents {
        _ = write!(out, "<agent-identifier><name id=\"{}\"/>", escape(&agent.name)?);
        if !agent.addresses.is_empty() {
            out.push_str("<addresses>");
            for address in agent.addresses.iter() {
                _ = write!(out, "<url href=\"{}\"/>", escape(address)?);
            }
            out.push_str("</addresses>");
        }
        out.push_str("</agent-identifier>");
    }
    _ = write!(out, "</{name}>");
    Ok(())
}
