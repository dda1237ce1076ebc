//! A message of a platform's log, as a line of JSON.

use bottega_agents::{gateway::Passage, wire::Calendar};
use serde::{Deserialize, Serialize};

/// The maximum length of contents, in characters.
const CONTENT_MAX: usize = 400;

/// A message that passed a platform, serialized as a line of JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct PassedMessage {
    /// The time in FIPA's format, UTC.
    pub(crate) at: String,
    /// The direction: `in`, `out`, `dropped` or `lost`.
    pub(crate) way: String,
    pub(crate) act: String,
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) conversation: String,
    pub(crate) protocol: String,
    pub(crate) content: String,
}

impl PassedMessage {
    /// Returns `hh:mm:ss.mmm` of the time.
    pub(crate) fn clock(&self) -> String {
        let part = |range: std::ops::Range<usize>| self.at.get(range).unwrap_or("");
        format!("{}:{}:{}.{}", part(9..11), part(11..13), part(13..15), part(15..18))
    }
}

/// Formats a message that passes as a line of JSON.
pub(crate) fn line(passage: &Passage, calendar: Calendar) -> String {
    let message = &passage.message;
    let text = |value: &Option<String>| value.clone().unwrap_or_default();
    let passed = PassedMessage {
        at: calendar.date(passage.time).as_str().to_owned(),
        way: passage.way.word().to_owned(),
        act: message.performative.word().to_owned(),
        from: message.sender.as_ref().map(ToString::to_string).unwrap_or_default(),
        to: passage.to.to_string(),
        conversation: text(&message.conversation_id),
        protocol: text(&message.protocol),
        content: text(&message.content).chars().take(CONTENT_MAX).collect(),
    };
    // Serializing strings and numbers cannot fail.
    serde_json::to_string(&passed).unwrap_or_default()
}
