//! Messages as bytes.

use std::time::Duration;

use crate::{AclMessage, AgentId, Performative, Time};

/// The layout of messages and entries. Whoever has another one does not understand a word, and is told so when it joins.
pub const WIRE_VERSION: u8 = 1;

/// Words that are no words of the vocabulary.
const NO_WORD: u8 = u8::MAX;
/// Version, performative, three words, three numbers, and when an answer is of no more use.
const HEAD_BYTES: usize = 5 + 3 * 8 + 8;

/// How the contents of messages and the values of entries are written. What is read was written by somebody else:
/// nothing in it is believed.
pub trait Codec: Send + Sync + 'static {
    /// What messages say.
    type Content: Send + 'static;
    /// What the store holds.
    type Value: Send + 'static;

    /// All languages, ontologies and protocols of messages, the same in each version of the layout.
    fn words(&self) -> &'static [&'static str];

    /// Appends a content.
    fn write_content(&self, content: &Self::Content, bytes: &mut Vec<u8>);

    /// Reads what [`Self::write_content`] wrote. `None`: it is something else.
    fn read_content(&self, bytes: &[u8]) -> Option<Self::Content>;

    /// Appends a value.
    fn write_value(&self, value: &Self::Value, bytes: &mut Vec<u8>);

    /// Reads what [`Self::write_value`] wrote. `None`: it is something else.
    fn read_value(&self, bytes: &[u8]) -> Option<Self::Value>;
}

/// A message without sender and receiver, who stand in its subject. Times are told from now on: clocks differ.
pub(super) fn write_message<K: Codec>(codec: &K, now: Time, message: &AclMessage<K::Content>) -> Vec<u8> {
    let words = codec.words();
    let word = |word: &str| words.iter().position(|known| *known == word).map_or(NO_WORD, |at| at as u8);
    let performative = Performative::ALL.iter().position(|known| *known == message.performative).unwrap_or_default();
    let mut bytes =
        vec![WIRE_VERSION, performative as u8, word(message.language), word(message.ontology), word(message.protocol)];
    for number in [message.conversation_id, message.reply_with, message.in_reply_to] {
        bytes.extend(number.to_le_bytes());
    }
    let left = message.reply_by.map_or(u64::MAX, |at| u64::try_from((at - now).as_nanos()).unwrap_or(u64::MAX - 1));
    bytes.extend(left.to_le_bytes());
    codec.write_content(&message.content, &mut bytes);
    bytes
}

/// Reads a message of `sender` to `receiver`.
pub(super) fn read_message<K: Codec>(
    codec: &K,
    now: Time,
    sender: AgentId,
    receiver: AgentId,
    bytes: &[u8],
) -> Option<AclMessage<K::Content>> {
    let (head, content) = bytes.split_at_checked(HEAD_BYTES)?;
    let [version, performative, language, ontology, protocol] = *head.first_chunk()?;
    if version != WIRE_VERSION {
        return None;
    }
    let word = |index: u8| match index {
        NO_WORD => Some(""),
        _ => codec.words().get(usize::from(index)).copied(),
    };
    let number = |index: usize| Some(u64::from_le_bytes(*head.get(5 + 8 * index..)?.first_chunk()?));
    let left = Some(number(3)?).filter(|left| *left != u64::MAX);
    Some(AclMessage {
        performative: *Performative::ALL.get(usize::from(performative))?,
        sender,
        receivers: vec![receiver],
        content: codec.read_content(content)?,
        language: word(language)?,
        ontology: word(ontology)?,
        protocol: word(protocol)?,
        conversation_id: number(0)?,
        reply_with: number(1)?,
        in_reply_to: number(2)?,
        reply_by: left.map(|left| now + Duration::from_nanos(left)),
    })
}
