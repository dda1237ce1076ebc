//! The Agent Communication Channel: where messages enter the platform (FIPA00067).
//!
//! It takes an envelope and a message in text, and says what must happen; it opens no connection itself.

use std::collections::BTreeSet;

use crate::{
    AgentId, Performative,
    wire::{
        DateTime, Envelope, Received, STRING_FORM, WireError, WireMessage, XML_FORM, parse_string, parse_xml,
        print_agent, print_string, print_xml,
    },
};

/// What an ACC wants done with what it received.
#[derive(Clone, Debug, PartialEq)]
pub enum Routed {
    /// Put the message into the mailbox of an agent of this platform.
    Deliver {
        /// Whose mailbox.
        to: AgentId,
        /// What goes in.
        message: WireMessage,
    },
    /// Send envelope and message on to another platform, to the first of the addresses that takes it.
    Forward {
        /// Where to try, in order.
        addresses: Vec<String>,
        /// The envelope, made out to the agents there.
        envelope: Envelope,
        /// The message as it came.
        payload: String,
    },
}

/// Why an ACC does nothing with what it received.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AccError {
    /// The message cannot be read.
    #[error("the message cannot be read")]
    Message(#[source] WireError),
    /// A form of messages that is not known here.
    #[error("messages in the form `{0}` are not taken")]
    UnknownForm(String),
    /// The message has been here before.
    #[error("the message has passed this channel already")]
    Loop,
}

/// The channel of one platform.
#[derive(Clone, Debug)]
pub struct Acc {
    platform: String,
    /// The first of its addresses stands on its stamps.
    addresses: Vec<String>,
    agents: BTreeSet<AgentId>,
}

impl Acc {
    /// The channel of the platform with this name, reachable at these addresses.
    pub fn new(platform: impl Into<String>, addresses: Vec<String>) -> Self {
        Self { platform: platform.into(), addresses, agents: BTreeSet::new() }
    }

    /// From now on there is this agent.
    pub fn add(&mut self, agent: AgentId) {
        self.agents.insert(agent);
    }

    /// From now on there is not.
    pub fn remove(&mut self, agent: &AgentId) {
        self.agents.remove(agent);
    }

    /// What stands on the stamps of this channel.
    fn mark(&self) -> &str {
        self.addresses.first().unwrap_or(&self.platform)
    }

    /// Takes a message. Each of its intended receivers, or else each of `to`, gets it once; the sender is told, by the
    /// AMS, of those who cannot.
    ///
    /// # Errors
    /// Nobody gets it.
    pub fn receive(&self, date: &DateTime, envelope: &Envelope, payload: &str) -> Result<Vec<Routed>, AccError> {
        if envelope.received.iter().any(|stamp| stamp.by == self.mark()) {
            return Err(AccError::Loop);
        }
        let message = match envelope.acl_representation.to_ascii_lowercase().as_str() {
            STRING_FORM => parse_string(payload),
            XML_FORM => parse_xml(payload),
            _ => return Err(AccError::UnknownForm(envelope.acl_representation.clone())),
        };
        let message = message.map_err(AccError::Message)?;
        let intended = &envelope.intended_receivers;
        let receivers: BTreeSet<&AgentId> =
            if intended.is_empty() { envelope.to.iter().collect() } else { intended.iter().collect() };
        let mut routed = Vec::new();
        for receiver in receivers {
            if self.agents.contains(receiver) {
                routed.push(Routed::Deliver { to: receiver.clone(), message: message.clone() });
                continue;
            }
            let elsewhere: Vec<String> =
                receiver.addresses.iter().filter(|address| !self.addresses.contains(address)).cloned().collect();
            if elsewhere.is_empty() || self.is_ours(receiver) {
                routed.extend(self.failure(date, envelope, &message, receiver));
            } else {
                let envelope = self.stamped(date, envelope, receiver);
                routed.push(Routed::Forward { addresses: elsewhere, envelope, payload: payload.to_owned() });
            }
        }
        Ok(routed)
    }

    /// Whether an agent was born here, so that nobody else can know it better.
    fn is_ours(&self, agent: &AgentId) -> bool {
        agent.name.rsplit_once('@').is_some_and(|(_, platform)| platform.eq_ignore_ascii_case(&self.platform))
    }

    fn stamped(&self, date: &DateTime, envelope: &Envelope, receiver: &AgentId) -> Envelope {
        let mut copy = envelope.clone();
        copy.intended_receivers = vec![receiver.clone()];
        copy.received.push(Received {
            by: self.mark().to_owned(),
            date: date.clone(),
            from: None,
            id: None,
            via: None,
        });
        copy
    }

    /// Tells the sender that a receiver cannot be reached, in the form in which it wrote. Never for a failure or a
    /// not-understood: such talk would not end.
    fn failure(
        &self,
        date: &DateTime,
        envelope: &Envelope,
        message: &WireMessage,
        receiver: &AgentId,
    ) -> Option<Routed> {
        if matches!(message.performative, Performative::Failure | Performative::NotUnderstood) {
            return None;
        }
        let sender = message.sender.clone().or_else(|| envelope.from.clone())?;
        let ams = AgentId { name: format!("ams@{}", self.platform).into(), addresses: self.addresses.clone().into() };
        let content = format!(
            "((action {} (ACLMessage)) (MTS-error {} (internal-error \"the agent is not known\")))",
            print_agent(&sender),
            print_agent(receiver)
        );
        let mut answer = message.reply(Performative::Failure, ams.clone(), content);
        answer.receivers = vec![sender.clone()];
        answer.language = Some("fipa-sl".to_owned());
        if self.agents.contains(&sender) {
            return Some(Routed::Deliver { to: sender, message: answer });
        }
        let xml = envelope.acl_representation.eq_ignore_ascii_case(XML_FORM);
        let payload = if xml { print_xml(&answer) } else { print_string(&answer) }.ok()?;
        // No stamps of the request: the other side would see a loop.
        let envelope = Envelope {
            to: vec![sender.clone()],
            from: Some(ams),
            acl_representation: envelope.acl_representation.clone(),
            payload_length: Some(payload.len() as u64),
            payload_encoding: (!payload.is_ascii()).then(|| "UTF-8".to_owned()),
            date: Some(date.clone()),
            intended_receivers: vec![sender.clone()],
            ..Envelope::default()
        };
        Some(Routed::Forward { addresses: sender.addresses.to_vec(), envelope, payload })
    }
}
