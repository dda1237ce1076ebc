//! Messages and entries as bytes: a version, followed by `postcard` data.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{
    AclMessage, AgentId, Performative, Time,
    codec::{Codec, WIRE_VERSION},
};

/// Stands for a word that is not in the vocabulary.
const NO_WORD: u8 = u8::MAX;

/// The reason why a message or an entry is rejected.
#[derive(Debug, PartialEq, thiserror::Error)]
pub(super) enum CodecError<E: std::error::Error + 'static> {
    #[error("it is empty")]
    Empty,
    #[error("it has layout {found}, but this build reads layout {WIRE_VERSION}")]
    Version { found: u8 },
    #[error("its head is cut off or has another layout")]
    Head(#[source] postcard::Error),
    #[error("its head has the {what} {found}, which does not exist")]
    Word { what: &'static str, found: u8 },
    #[error(transparent)]
    Body(E),
}

/// The header of a message. Sender and receiver are in its subject.
#[derive(Serialize, Deserialize)]
struct FrameHeader {
    /// The index in [`Performative::ALL`].
    performative: u8,
    /// Language, ontology and protocol: indices in [`Codec::words`].
    words: [u8; 3],
    conversation_id: u64,
    reply_with: u64,
    in_reply_to: u64,
    /// Time from now until which an answer is accepted, in nanoseconds; relative, because clocks differ.
    reply_within: Option<u64>,
}

/// Encodes a message, without sender and receiver.
pub(super) fn write_message<K: Codec>(codec: &K, now: Time, message: &AclMessage<K::Content>) -> Vec<u8> {
    let words = codec.words();
    let word = |word: &str| words.iter().position(|known| *known == word).map_or(NO_WORD, |at| at as u8);
    let performative = Performative::ALL.iter().position(|known| *known == message.performative).unwrap_or_default();
    let head = FrameHeader {
        performative: performative as u8,
        words: [message.language, message.ontology, message.protocol].map(word),
        conversation_id: message.conversation_id,
        reply_with: message.reply_with,
        in_reply_to: message.in_reply_to,
        reply_within: message.reply_by.map(|at| u64::try_from((at - now).as_nanos()).unwrap_or(u64::MAX)),
    };
    let bytes = postcard::to_extend(&head, vec![WIRE_VERSION]);
    let mut bytes = bytes.expect("memory takes all, and there are no lists in the head");
    codec.write_content(&message.content, &mut bytes);
    bytes
}

/// Decodes a message of `sender` to `receiver`.
pub(super) fn read_message<K: Codec>(
    codec: &K,
    now: Time,
    sender: AgentId,
    receiver: AgentId,
    bytes: &[u8],
) -> Result<AclMessage<K::Content>, CodecError<K::Error>> {
    let (head, content) = postcard::take_from_bytes::<FrameHeader>(body(bytes)?).map_err(CodecError::Head)?;
    let performative = Performative::ALL.get(usize::from(head.performative));
    let unknown = |what, found| CodecError::Word { what, found };
    let word = |what, index: u8| match index {
        NO_WORD => Ok(""),
        _ => codec.words().get(usize::from(index)).copied().ok_or(unknown(what, index)),
    };
    let [language, ontology, protocol] = head.words;
    Ok(AclMessage {
        performative: *performative.ok_or(unknown("performative", head.performative))?,
        sender,
        receivers: vec![receiver],
        content: codec.read_content(content).map_err(CodecError::Body)?,
        language: word("language", language)?,
        ontology: word("ontology", ontology)?,
        protocol: word("protocol", protocol)?,
        conversation_id: head.conversation_id,
        reply_with: head.reply_with,
        in_reply_to: head.in_reply_to,
        reply_by: head.reply_within.map(|left| now + Duration::from_nanos(left)),
    })
}

/// Encodes the value of an entry.
pub(super) fn write_entry<K: Codec>(codec: &K, value: &K::Value) -> Vec<u8> {
    let mut bytes = vec![WIRE_VERSION];
    codec.write_value(value, &mut bytes);
    bytes
}

/// Decodes the value of an entry.
pub(super) fn read_entry<K: Codec>(codec: &K, bytes: &[u8]) -> Result<K::Value, CodecError<K::Error>> {
    codec.read_value(body(bytes)?).map_err(CodecError::Body)
}

/// Returns the bytes after the version.
fn body<E: std::error::Error>(bytes: &[u8]) -> Result<&[u8], CodecError<E>> {
    match bytes.split_first() {
        None => Err(CodecError::Empty),
        Some((&WIRE_VERSION, body)) => Ok(body),
        Some((&found, _)) => Err(CodecError::Version { found }),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Text as it is.
    struct Utf8;

    impl Codec for Utf8 {
        type Content = String;
        type Value = String;
        type Error = std::string::FromUtf8Error;

        fn words(&self) -> &'static [&'static str] {
            &["text", "weather", "fipa-request"]
        }

        fn write_content(&self, content: &String, bytes: &mut Vec<u8>) {
            bytes.extend(content.as_bytes());
        }

        fn read_content(&self, bytes: &[u8]) -> Result<String, Self::Error> {
            String::from_utf8(bytes.to_vec())
        }

        fn write_value(&self, value: &String, bytes: &mut Vec<u8>) {
            self.write_content(value, bytes);
        }

        fn read_value(&self, bytes: &[u8]) -> Result<String, Self::Error> {
            self.read_content(bytes)
        }
    }

    const NOW: Time = Time::ZERO;

    fn message(reply_by: Option<Time>) -> AclMessage {
        let (sender, receiver) = (AgentId::new("a@here"), AgentId::new("b@there"));
        AclMessage {
            language: "text",
            protocol: "fipa-request",
            conversation_id: 3,
            reply_with: u64::MAX,
            in_reply_to: 1 << 40,
            reply_by,
            ..AclMessage::new(Performative::Propose, sender, receiver, "it rains".to_owned())
        }
    }

    fn read(now: Time, bytes: &[u8]) -> Result<AclMessage, CodecError<std::string::FromUtf8Error>> {
        read_message(&Utf8, now, AgentId::new("a@here"), AgentId::new("b@there"), bytes)
    }

    #[test]
    fn a_message_is_read_as_it_was_written_by_a_clock_of_ones_own() {
        let seconds = |seconds| Time::since_start(Duration::from_secs(seconds));
        for (reply_by, read_by) in
            [(None, None), (Some(seconds(30)), Some(seconds(120))), (Some(NOW), Some(seconds(100)))]
        {
            let bytes = write_message(&Utf8, seconds(10), &message(reply_by));
            let expected = message(read_by);
            assert_eq!(read(seconds(100), &bytes), Ok(expected));
        }
    }

    #[test]
    fn what_is_of_another_version_cut_off_or_unknown_is_refused() {
        let bytes = write_message(&Utf8, NOW, &message(None));
        let changed = |at: usize, to: u8| {
            let mut bytes = bytes.clone();
            bytes[at] = to;
            read(NOW, &bytes)
        };
        assert_eq!(read(NOW, &[]), Err(CodecError::Empty));
        assert_eq!(changed(0, 1), Err(CodecError::Version { found: 1 }));
        assert_eq!(changed(1, 22), Err(CodecError::Word { what: "performative", found: 22 }));
        assert_eq!(changed(2, 3), Err(CodecError::Word { what: "language", found: 3 }));
        assert_eq!(changed(4, 200), Err(CodecError::Word { what: "protocol", found: 200 }));
        let content = bytes.len() - message(None).content.len();
        for end in 1..content {
            assert!(matches!(read(NOW, &bytes[..end]), Err(CodecError::Head(_))), "{end} bytes");
        }
        assert!(matches!(changed(content, 0xff), Err(CodecError::Body(_))));
    }

    #[test]
    fn an_entry_is_read_as_it_was_written_in_this_version_only() {
        let mut bytes = write_entry(&Utf8, &"sunny".to_owned());
        assert_eq!(read_entry(&Utf8, &bytes), Ok("sunny".to_owned()));
        bytes[0] += 1;
        assert_eq!(read_entry(&Utf8, &bytes), Err(CodecError::Version { found: WIRE_VERSION + 1 }));
        assert_eq!(read_entry(&Utf8, &[]), Err(CodecError::Empty));
    }

    proptest! {
        #[test]
        fn no_bytes_make_a_reader_panic(mut bytes in prop::collection::vec(any::<u8>(), 1..60), known in any::<bool>()) {
            if known {
                bytes[0] = WIRE_VERSION;
            }
            _ = read(NOW, &bytes);
            _ = read_entry(&Utf8, &bytes);
        }
    }
}
