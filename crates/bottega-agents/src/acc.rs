//! The Agent Communication Channel: entry and exit of messages at the platform (FIPA00067).
//!
//! It takes an envelope and a message as text, and returns what to do; it opens no connections itself.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    hash::{DefaultHasher, Hash, Hasher},
    time::Duration,
};

use crate::{
    AgentId, Performative, Time,
    platform::{ManagementContent, print_content},
    wire::{
        Calendar, DateTime, Envelope, Received, STRING_FORM, WireError, WireMessage, XML_FORM, parse_string, parse_xml,
        print_string, print_xml,
    },
};

/// Maximum number of messages remembered to detect duplicates.
const REMEMBERED_MAX: usize = 1 << 14;
/// Time for which they are remembered.
const REMEMBERED_FOR: Duration = Duration::from_secs(300);

/// A received message, decoded and parsed.
#[derive(Clone, Debug, PartialEq)]
pub struct Letter {
    /// The envelope: receivers, representation, and stamps of the platforms that it passed.
    pub envelope: Envelope,
    /// The message, with its content.
    pub message: WireMessage,
    /// The message as text, for forwarding.
    pub payload: String,
}

impl Letter {
    /// Decodes and parses a message in the representation and the character set that its envelope names.
    ///
    /// - `payload`: the message as received, in that character set.
    ///
    /// # Errors
    /// The representation or the character set is unknown, the bytes are not valid in the character set, or the message
    /// is invalid.
    pub fn open(envelope: Envelope, payload: &[u8]) -> Result<Self, AccError> {
        let payload = decode(envelope.payload_encoding.as_deref(), payload)?;
        let message = match envelope.acl_representation.to_ascii_lowercase().as_str() {
            STRING_FORM => parse_string(&payload),
            XML_FORM => parse_xml(&payload),
            _ => return Err(AccError::UnknownForm(envelope.acl_representation.chars().take(80).collect())),
        };
        Ok(Self { message: message.map_err(AccError::Message)?, envelope, payload })
    }
}

/// Decodes bytes in a character set. ASCII, the default, is read as UTF-8, which includes it.
fn decode(charset: Option<&str>, bytes: &[u8]) -> Result<String, AccError> {
    match charset.unwrap_or("us-ascii").to_ascii_lowercase().as_str() {
        "us-ascii" | "ascii" | "utf-8" | "utf8" => {
            std::str::from_utf8(bytes).map(str::to_owned).map_err(|_| AccError::NotText)
        }
        "iso-8859-1" | "latin1" => Ok(bytes.iter().map(|byte| char::from(*byte)).collect()),
        other => Err(AccError::UnknownCharset(other.chars().take(80).collect())),
    }
}

/// A message to an agent of another platform, or of another process of this one, ready to send, with the addresses to
/// try.
#[derive(Clone, Debug, PartialEq)]
pub struct Outbound {
    /// Addresses to try in order, until one accepts the message.
    pub addresses: Vec<String>,
    /// The envelope, addressed to the agents there.
    pub envelope: Envelope,
    /// The message as text.
    pub payload: String,
    /// The message, with its content.
    pub message: WireMessage,
}

/// The next step for a received message.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "lives for a moment, and forwarding is as common as delivery")]
pub enum Routed {
    /// Put the message into the mailbox of an agent of this process.
    Deliver {
        /// The receiving agent, of this process.
        to: AgentId,
        /// The message, with its content.
        message: WireMessage,
    },
    /// Forward the message to another platform, or to another process of this one.
    Forward(Outbound),
}

/// The reason why a received message is rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AccError {
    /// The message is invalid.
    #[error("the message cannot be read")]
    Message(#[source] WireError),
    /// The representation is unknown; holds its name, at most 80 characters.
    #[error("messages in the form `{0}` are not accepted")]
    UnknownForm(String),
    /// The character set is unknown; holds its name, at most 80 characters.
    #[error("messages in the character set `{0}` are not accepted")]
    UnknownCharset(String),
    /// The bytes are not valid in their character set.
    #[error("the message is not text in its character set")]
    NotText,
    /// The message has passed this channel before, or a copy of it did within the last five minutes: a loop or a
    /// duplicate.
    #[error("the message has already passed this channel")]
    Loop,
}

/// The Agent Communication Channel of one process of a platform: it routes messages to agents and other platforms.
#[derive(Clone, Debug)]
pub struct Acc {
    platform: String,
    calendar: Calendar,
    /// Addresses of this channel; the first one is in its stamps.
    addresses: Vec<String>,
    /// Agents in this process, by name in lower case.
    agents: BTreeMap<String, AgentId>,
    /// Agents of this platform in other processes.
    elsewhere: BTreeMap<String, AgentId>,
    /// Digests of recent messages, and the times until which they are kept.
    remembered: BTreeSet<u64>,
    forget_at: VecDeque<(Time, u64)>,
    /// A secret, so that others cannot predict these digests.
    salt: u64,
}

impl Acc {
    /// Makes the channel of a platform.
    ///
    /// - `platform`: the name of the platform.
    /// - `addresses`: the addresses at which other platforms reach the channel. The first one stands in its stamps on
    ///   envelopes; without any, the platform's name does.
    /// - `calendar`: converts the platform's time to the dates in the stamps.
    /// - `salt`: a secret number, so that others cannot predict the digests by which duplicates are detected.
    pub fn new(platform: impl Into<String>, addresses: Vec<String>, calendar: Calendar, salt: u64) -> Self {
        Self {
            platform: platform.into(),
            calendar,
            addresses,
            agents: BTreeMap::new(),
            elsewhere: BTreeMap::new(),
            remembered: BTreeSet::new(),
            forget_at: VecDeque::new(),
            salt,
        }
    }

    /// Adds an agent of this process, to which messages are delivered from now on.
    pub fn add(&mut self, agent: AgentId) {
        self.agents.insert(agent.name.to_lowercase(), agent);
    }

    /// Removes an agent of this process: messages to it are no longer delivered.
    pub fn remove(&mut self, agent: &AgentId) {
        self.agents.remove(&agent.name.to_lowercase());
    }

    /// Returns the agent with this name in this process, compared without case; `None`: it is not here.
    pub fn resident(&self, agent: &AgentId) -> Option<&AgentId> {
        self.agents.get(&agent.name.to_lowercase())
    }

    /// Notes the addresses of an agent that is not in this process, as its entry in the white pages states them.
    ///
    /// - `name`: the name of the agent, compared without case.
    /// - `agent`: its identifier with addresses; `None`: it has no address in another process.
    pub fn learn(&mut self, name: &str, agent: Option<AgentId>) {
        match agent {
            Some(agent) => _ = self.elsewhere.insert(name.to_lowercase(), agent),
            None => _ = self.elsewhere.remove(&name.to_lowercase()),
        }
    }

    /// Returns the address in this channel's stamps.
    fn mark(&self) -> &str {
        self.addresses.first().unwrap_or(&self.platform)
    }

    /// Returns the next step of a received message for each of its intended receivers, or, if the envelope names none,
    /// for each of `to`. For a receiver that cannot be reached the step is a failure message of the AMS to the sender,
    /// as [`Self::failure`] makes it; where that returns `None` there is no step.
    ///
    /// # Errors
    /// [`AccError::Loop`]: the message has passed this channel before.
    pub fn receive(&mut self, now: Time, letter: &Letter) -> Result<Vec<Routed>, AccError> {
        let envelope = &letter.envelope;
        if envelope.received.iter().any(|stamp| stamp.by == self.mark()) || !self.is_new(now, letter) {
            return Err(AccError::Loop);
        }
        let intended = &envelope.intended_receivers;
        let receivers: BTreeSet<&AgentId> =
            if intended.is_empty() { envelope.to.iter().collect() } else { intended.iter().collect() };
        let mut routed = Vec::new();
        for receiver in receivers {
            if let Some(resident) = self.resident(receiver) {
                routed.push(Routed::Deliver { to: resident.clone(), message: letter.message.clone() });
                continue;
            }
            let addresses = self.ways_to(receiver);
            if addresses.is_empty() {
                let form = &envelope.acl_representation;
                let from = envelope.from.as_ref();
                routed.extend(self.failure(now, form, from, &letter.message, receiver, "the agent is unknown"));
            } else {
                routed.push(Routed::Forward(Outbound {
                    addresses,
                    envelope: self.stamped(now, envelope, receiver),
                    payload: letter.payload.clone(),
                    message: letter.message.clone(),
                }));
            }
        }
        Ok(routed)
    }

    /// Returns true if the message has not been seen recently. Only its date distinguishes a duplicate from a message
    /// sent twice on purpose.
    fn is_new(&mut self, now: Time, letter: &Letter) -> bool {
        while self.forget_at.front().is_some_and(|(at, _)| *at <= now) || self.forget_at.len() >= REMEMBERED_MAX {
            if let Some((_, digest)) = self.forget_at.pop_front() {
                self.remembered.remove(&digest);
            }
        }
        let envelope = &letter.envelope;
        let Some(date) = &envelope.date else { return true };
        let mut hasher = DefaultHasher::new();
        (self.salt, date.as_str(), &letter.payload).hash(&mut hasher);
        (&envelope.from, &envelope.to, &envelope.intended_receivers).hash(&mut hasher);
        let digest = hasher.finish();
        let new = self.remembered.insert(digest);
        if new {
            self.forget_at.push_back((now + REMEMBERED_FOR, digest));
        }
        new
    }

    /// Returns the addresses of an agent that is not in this process, without those of this channel; empty: none is
    /// known. The addresses in `agent` itself count only if it is of another platform.
    pub fn ways_to(&self, agent: &AgentId) -> Vec<String> {
        let known = self.elsewhere.get(&agent.name.to_lowercase()).map_or(&[][..], |known| &known.addresses);
        // Addresses in the name do not count for agents of this platform
        let named = if self.is_ours(agent) { &[][..] } else { &agent.addresses };
        let mut ways: Vec<String> = Vec::new();
        for address in known.iter().chain(named) {
            if !self.addresses.contains(address) && !ways.contains(address) {
                ways.push(address.clone());
            }
        }
        ways
    }

    /// Returns true if the part of an agent's name after the last `@` is this platform, compared without case.
    pub fn is_ours(&self, agent: &AgentId) -> bool {
        agent.name.rsplit_once('@').is_some_and(|(_, platform)| platform.eq_ignore_ascii_case(&self.platform))
    }

    fn stamped(&self, now: Time, envelope: &Envelope, receiver: &AgentId) -> Envelope {
        let mut copy = envelope.clone();
        copy.intended_receivers = vec![receiver.clone()];
        copy.received.push(Received {
            by: self.mark().to_owned(),
            date: Some(self.calendar.date(now)),
            from: None,
            id: None,
            via: None,
        });
        copy
    }

    /// Returns a message from an agent of this platform to one that is not in this process, with its envelope and the
    /// addresses to try.
    ///
    /// - `form`: the representation: [`XML_FORM`]; any other name stands for [`STRING_FORM`].
    ///
    /// # Errors
    /// The receiver has no known address, or the message cannot be written in this representation.
    pub fn dispatch(
        &self,
        now: Time,
        form: &str,
        message: WireMessage,
        receiver: &AgentId,
    ) -> Result<Outbound, Undeliverable> {
        let addresses = self.ways_to(receiver);
        if addresses.is_empty() {
            return Err(Undeliverable::NoAddress);
        }
        self.wrap(&self.calendar.date(now), form, message, receiver, addresses).map_err(Undeliverable::Message)
    }

    fn wrap(
        &self,
        date: &DateTime,
        form: &str,
        message: WireMessage,
        receiver: &AgentId,
        addresses: Vec<String>,
    ) -> Result<Outbound, WireError> {
        let xml = form.eq_ignore_ascii_case(XML_FORM);
        let payload = if xml { print_xml(&message) } else { print_string(&message) }?;
        // No stamps of the message it answers, because the other side would detect a loop
        let envelope = Envelope {
            to: vec![receiver.clone()],
            from: message.sender.clone(),
            acl_representation: if xml { XML_FORM } else { STRING_FORM }.to_owned(),
            payload_length: Some(payload.len() as u64),
            payload_encoding: Some("UTF-8".to_owned()),
            date: Some(date.clone()),
            intended_receivers: vec![receiver.clone()],
            ..Envelope::default()
        };
        Ok(Outbound { addresses, envelope, payload, message })
    }

    /// Returns the AMS's messages to the sender that a message did not reach its receivers, one for each of them; see
    /// [`Self::failure`] for when there are none.
    ///
    /// - `reason`: the error, as text for the user.
    pub fn undelivered(&self, now: Time, outbound: &Outbound, reason: &str) -> Vec<Routed> {
        let envelope = &outbound.envelope;
        let receivers =
            if envelope.intended_receivers.is_empty() { &envelope.to } else { &envelope.intended_receivers };
        let form = &envelope.acl_representation;
        let failures = receivers.iter().filter_map(|receiver| {
            self.failure(now, form, envelope.from.as_ref(), &outbound.message, receiver, reason)
        });
        failures.collect()
    }

    /// Returns the AMS's message to a sender that a receiver cannot be reached. `None`: the message is itself a failure
    /// or a not-understood (to avoid endless replies), the sender is unknown or has no address, or the failure message
    /// cannot be written in the representation.
    ///
    /// - `form`: the representation of the undelivered message, and of this one.
    /// - `from`: the sender in the envelope, if the message does not name one.
    /// - `reason`: the error, as text for the user.
    pub fn failure(
        &self,
        now: Time,
        form: &str,
        from: Option<&AgentId>,
        message: &WireMessage,
        receiver: &AgentId,
        reason: &str,
    ) -> Option<Routed> {
        if matches!(message.performative, Performative::Failure | Performative::NotUnderstood) {
            return None;
        }
        let sender = message.sender.as_ref().or(from)?.clone();
        let ams = AgentId { name: format!("ams@{}", self.platform).into(), addresses: self.addresses.clone().into() };
        let content = ManagementContent::Undelivered { receiver: receiver.clone(), reason: reason.to_owned() };
        let content = print_content(self.calendar, &sender, &content);
        let mut answer = message.reply(Performative::Failure, ams, content);
        answer.receivers = vec![sender.clone()];
        answer.language = Some("fipa-sl".to_owned());
        answer.ontology = Some(crate::platform::ONTOLOGY.to_owned());
        if let Some(resident) = self.resident(&sender) {
            return Some(Routed::Deliver { to: resident.clone(), message: answer });
        }
        let addresses = self.ways_to(&sender);
        if addresses.is_empty() {
            return None;
        }
        self.wrap(&self.calendar.date(now), form, answer, &sender, addresses).ok().map(Routed::Forward)
    }
}

/// The reason why a message to another platform cannot be sent.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Undeliverable {
    /// No address of the receiver is known.
    #[error("the agent has no known address")]
    NoAddress,
    /// The message cannot be written in the representation.
    #[error("the message cannot be written")]
    Message(#[source] WireError),
}
