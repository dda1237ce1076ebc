//! A message that passed a platform, as a line of JSON.

use bottega_agents::{gateway::Passage, wire::Calendar};
use serde::{Deserialize, Serialize};

/// Longer contents are cut, in characters.
const CONTENT_MAX: usize = 400;

/// A message that passed, as a line of JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct PassedMessage {
    /// When, as FIPA writes it, UTC.
    pub(crate) at: String,
    /// `in`, `out`, `dropped`, `lost`.
    pub(crate) way: String,
    pub(crate) act: String,
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) conversation: String,
    pub(crate) protocol: String,
    pub(crate) content: String,
}

impl PassedMessage {
    /// `hh:mm:ss.mmm` of the moment.
    pub(crate) fn clock(&self) -> String {
        let part = |range: std::ops::Range<usize>| self.at.get(range).unwrap_or("");
        format!("{}:{}:{}.{}", part(9..11), part(11..13), part(13..15), part(15..18))
    }
}

/// What a platform tells of a message that passes.
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
    // Text and numbers can always be written.
    serde_json::to_string(&passed).unwrap_or_default()
}
