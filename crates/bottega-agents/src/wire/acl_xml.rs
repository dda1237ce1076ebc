//! Messages in XML (FIPA00071).

use std::fmt::Write;

use super::{
    ADDRESSES_MAX, AGENTS_MAX, DateTime, USER_PARAMETERS_MAX, WireError, WireMessage, bad_value, bounded, identifier,
    set_once,
    string_form::texts,
    xml::{self, Element, escape},
};
use crate::{AgentId, Performative};

/// Reads one message.
///
/// # Errors
/// No well-formed XML, a document type or entity, not a message, or more than the bounds allow.
pub fn parse_xml(text: &str) -> Result<WireMessage, WireError> {
    let root = xml::parse(text)?;
    if root.name != "fipa-message" {
        return Err(WireError::Missing { object: "document", part: "fipa-message" });
    }
    let act = root.attribute("act").ok_or(WireError::Missing { object: "fipa-message", part: "act" })?;
    let performative = Performative::from_word(act).ok_or_else(|| bad_value("performative", act))?;
    let mut message = WireMessage::new(performative);
    message.conversation_id = root.attribute("conversation-id").map(str::to_owned);
    for element in &root.children {
        let name = element.name.as_str();
        match name {
            // Many elements with one agent each, or one with many.
            "receiver" => push_agents(&mut message.receivers, element)?,
            "reply-to" => push_agents(&mut message.reply_to, element)?,
            "sender" => {
                let agent = element.child("agent-identifier");
                let agent = agent.ok_or(WireError::Missing { object: "sender", part: "agent-identifier" })?;
                set_once(&mut message.sender, parse_agent(agent)?, name)?;
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
                let key =
                    element.attribute("href").ok_or(WireError::Missing { object: "user-defined", part: "href" })?;
                if message.user.insert(key.to_owned(), element.text.clone()).is_some() {
                    return Err(WireError::Twice(key.to_owned()));
                }
            }
            _ => {}
        }
    }
    Ok(message)
}

/// The text of an element, or what it refers to.
fn text_of(element: &Element) -> String {
    match element.attribute("href") {
        Some(reference) if element.text.is_empty() => reference.to_owned(),
        _ => element.text.clone(),
    }
}

fn push_agents(agents: &mut Vec<AgentId>, element: &Element) -> Result<(), WireError> {
    for agent in element.children("agent-identifier") {
        bounded(agents.len(), AGENTS_MAX, "agents")?;
        agents.push(parse_agent(agent)?);
    }
    Ok(())
}

fn parse_agent(element: &Element) -> Result<AgentId, WireError> {
    let missing = WireError::Missing { object: "agent-identifier", part: "name" };
    let name = element.child("name").ok_or_else(|| missing.clone())?;
    let name = name.attribute("id").or_else(|| name.attribute("refid")).ok_or(missing)?;
    let mut addresses = Vec::new();
    for url in element.children("addresses").flat_map(|addresses| addresses.children("url")) {
        bounded(addresses.len(), ADDRESSES_MAX, "addresses")?;
        let href = url.attribute("href").ok_or(WireError::Missing { object: "url", part: "href" })?;
        addresses.push(href.to_owned());
    }
    Ok(identifier(name.to_owned(), addresses))
}

/// Writes a message. It reads back as the same.
///
/// # Errors
/// Text with characters that XML cannot hold.
pub fn print_xml(message: &WireMessage) -> Result<String, WireError> {
    let mut out = format!("<?xml version=\"1.0\"?>\n<fipa-message act=\"{}\">", message.performative.word());
    if let Some(sender) = &message.sender {
        push_agents_element(&mut out, "sender", std::slice::from_ref(sender))?;
    }
    for (name, agents) in [("receiver", &message.receivers), ("reply-to", &message.reply_to)] {
        if !agents.is_empty() {
            push_agents_element(&mut out, name, agents)?;
        }
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
