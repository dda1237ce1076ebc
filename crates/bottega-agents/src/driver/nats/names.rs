//! Names of agents and entries as tokens of subjects and keys; names of subjects, buckets and streams.
//!
//! Letters, digits, `-` and `_` stand for themselves, every other byte is `=` and two hexadecimal digits: so every name
//! is a single token, and different names have different tokens.

use std::fmt::Write;

use crate::{AgentId, Key, machine_of};

/// Prefix of agents' addresses over NATS.
const SCHEME: &str = "nats:";

/// Encodes a name as a token.
pub(super) fn token(name: &str) -> String {
    let mut token = String::with_capacity(name.len() + 8);
    for byte in name.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' => token.push(char::from(byte)),
            // Writing to a string cannot fail
            _ => _ = write!(token, "={byte:02x}"),
        }
    }
    // A token is never empty
    if token.is_empty() { "=".to_owned() } else { token }
}

/// Decodes a token; `None`: it is invalid.
pub(super) fn name(token: &str) -> Option<String> {
    if token == "=" {
        return Some(String::new());
    }
    let mut bytes = Vec::with_capacity(token.len());
    let mut rest = token.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        rest = after;
        if first != b'=' {
            bytes.push(first);
            continue;
        }
        let digits = std::str::from_utf8(rest.get(..2)?).ok()?;
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        rest = &rest[2..];
    }
    let name = String::from_utf8(bytes).ok()?;
    (self::token(&name) == token).then_some(name)
}

/// Returns the subject of a message.
pub(super) fn message(farm: &str, to: &str, from: &str) -> String {
    let [to_home, to, from_home, from] = [machine_of(to), to, machine_of(from), from].map(token);
    format!("bottega.{farm}.to.{to_home}.{to}.from.{from_home}.{from}")
}

/// Returns the address of an agent: the subject of messages to it, up to the sender.
pub(super) fn address(farm: &str, agent: &str) -> String {
    format!("{SCHEME}bottega.{farm}.to.{}.{}", token(machine_of(agent)), token(agent))
}

/// Returns the subject of a message to an agent, from its first address in this farm, or else from its name.
pub(super) fn message_to(farm: &str, to: &AgentId, from: &str) -> String {
    let ours = format!("bottega.{farm}.to.");
    let is_subject = |subject: &&str| {
        let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_=.".contains(&byte);
        subject.starts_with(&ours) && subject.bytes().all(plain) && subject.split('.').all(|token| !token.is_empty())
    };
    match to.addresses.iter().filter_map(|address| address.strip_prefix(SCHEME)).find(is_subject) {
        Some(subject) => format!("{subject}.from.{}.{}", token(machine_of(from)), token(from)),
        None => message(farm, &to.name, from),
    }
}

/// Returns the subject of all messages to an agent.
pub(super) fn messages_to(farm: &str, to: &str) -> String {
    format!("bottega.{farm}.to.{}.{}.from.*.*", token(machine_of(to)), token(to))
}

/// Returns the sender of a message by its subject; `None`: the name does not match the home that the server verified.
pub(super) fn sender(subject: &str) -> Option<String> {
    let mut tokens = subject.rsplit('.');
    let (name, home) = (self::name(tokens.next()?)?, self::name(tokens.next()?)?);
    (machine_of(&name) == home).then_some(name)
}

/// Returns the subjects of all messages from agents of a member.
pub(super) fn said_by(farm: &str, member: &str) -> String {
    format!("bottega.{farm}.to.*.*.from.{}.*", token(member))
}

/// Returns the subjects of all messages to agents of a member.
pub(super) fn said_to(farm: &str, member: &str) -> String {
    format!("bottega.{farm}.to.{}.>", token(member))
}

/// Returns the subject of enrolment requests.
pub(super) fn enrolment(group: &str) -> String {
    format!("bottega-enrol.{}", token(group))
}

/// Returns the inbox prefix of a member.
pub(super) fn inbox(member: &str) -> String {
    format!("_INBOX_{}", token(member))
}

/// Returns the bucket of rows.
pub(super) fn blackboard(farm: &str) -> String {
    format!("bottega-{farm}")
}

/// Returns the bucket of notices.
pub(super) fn notices(farm: &str) -> String {
    format!("bottega-{farm}-notices")
}

/// Returns the bucket of blobs.
pub(super) fn objects(farm: &str) -> String {
    format!("bottega-{farm}")
}

/// Returns the stream of payloads; its name on the wire says what they are to a farm.
pub(super) fn payloads(farm: &str) -> String {
    format!("bottega-{farm}-tiles")
}

/// Returns the prefix of that stream's subjects.
pub(super) fn payloads_prefix(farm: &str) -> String {
    format!("bottega.{farm}.tile.")
}

/// Returns the subject of the live messages of a channel, whose parts are separated by `/`.
pub(super) fn live(farm: &str, channel: &str) -> String {
    format!("bottega.{farm}.live.{}", key(&Key::from(channel.to_owned())))
}

/// Returns the encoded key of an entry: its parts are tokens.
pub(super) fn key(key: &Key) -> String {
    key.to_string().split('/').map(token).collect::<Vec<_>>().join(".")
}

/// Decodes the key of an entry.
pub(super) fn entry(key: &str) -> Option<Key> {
    let parts: Option<Vec<String>> = key.split('.').map(name).collect();
    parts.map(|parts| Key::from(parts.join("/")))
}

/// Returns the subject filter for all entries below a prefix that ends in `/`.
pub(super) fn below(prefix: &Key) -> String {
    let folder = prefix.to_string();
    match folder.rsplit_once('/') {
        Some((folder, _)) => format!("{}.>", key(&Key::from(folder))),
        None => ">".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_name_is_one_token_and_comes_back(text in "\\PC{0,20}") {
            let token = token(&text);
            prop_assert!(!token.contains(['.', '*', '>', ' ']));
            prop_assert_eq!(name(&token), Some(text));
        }

        #[test]
        fn no_token_makes_a_reader_panic(text in "\\PC{0,20}") {
            _ = name(&text);
            _ = entry(&text);
        }
    }

    #[test]
    fn a_subject_says_who_speaks_and_nobody_can_speak_from_anothers_home() {
        let subject = message("f", "master@work-7", "render-1@vm-3f.07");
        assert_eq!(subject, "bottega.f.to.work-7.master=40work-7.from.vm-3f.render-1=40vm-3f=2e07");
        assert_eq!(sender(&subject).as_deref(), Some("render-1@vm-3f.07"));
        assert_eq!(messages_to("f", "render-1@vm-3f.07"), "bottega.f.to.vm-3f.render-1=40vm-3f=2e07.from.*.*");
        let mut master = AgentId::new("master@work-7");
        assert_eq!(message_to("f", &master, "render-1@vm-3f.07"), subject);
        master.addresses = std::sync::Arc::new([address("f", "other@work-7")]);
        let elsewhere = subject.replace("master=40", "other=40");
        assert_eq!(message_to("f", &master, "render-1@vm-3f.07"), elsewhere, "its address says where it is");
        for bad in ["nats:bottega.g.to.x.y", "nats:bottega.f.to.>", "nats:bottega.f.to..x", "http://h/acc"] {
            master.addresses = std::sync::Arc::new([bad.to_owned()]);
            assert_eq!(message_to("f", &master, "render-1@vm-3f.07"), subject, "{bad}");
        }
        assert_eq!(sender("bottega.f.to.vm-3f.x.from.vm-3f.master=40work-7"), None);
        assert_eq!(sender("from"), None);
        assert_eq!((machine_of("render-1@vm-3f"), machine_of("vm-3f.07"), machine_of("")), ("vm-3f", "vm-3f", ""));
    }

    #[test]
    fn a_folder_is_watched_whole() {
        let row = Key::from("work/7/zone/12".to_owned());
        assert_eq!(key(&row), "work.7.zone.12");
        assert_eq!(entry("work.7.zone.12"), Some(row));
        assert_eq!(below(&Key::from("work/7/".to_owned())), "work.7.>");
        assert_eq!(below(&Key::from("work".to_owned())), ">");
        assert_eq!(key(&Key::from("agent/a@b c".to_owned())), "agent.a=40b=20c");
    }
}
