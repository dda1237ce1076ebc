//! Any message, any envelope.

use bottega_agents::{
    AgentId, Performative,
    wire::{DateTime, Envelope, Received, STRING_FORM, WireMessage},
};
use proptest::prelude::*;

/// Text that XML can hold, with all special characters.
pub(crate) fn any_text() -> impl Strategy<Value = String> {
    prop_oneof![
        "[a-z0-9:@#.+/-]{0,12}",
        r#"[ "\\()#&<>'=;\r\n\té中🎨a]{0,16}"#,
        "\\PC{0,12}".prop_filter("XML cannot hold it", |text| !text.contains(['\u{fffe}', '\u{ffff}'])),
    ]
}

pub(crate) fn any_agent() -> impl Strategy<Value = AgentId> {
    (any_text(), prop::collection::vec(any_text(), 0..3))
        .prop_map(|(name, addresses)| AgentId { name: name.into(), addresses: addresses.into() })
}

pub(crate) fn any_date() -> impl Strategy<Value = DateTime> {
    "[+]?2026112[0-9][TZ]1[0-9][0-5][0-9][0-5][0-9]{4}[A-Z]?".prop_map(|text| DateTime::parse(&text).unwrap())
}

pub(crate) fn any_message() -> impl Strategy<Value = WireMessage> {
    let optional = || prop::option::of(any_text());
    let agents = || prop::collection::vec(any_agent(), 0..3);
    (
        (prop::sample::select(Performative::ALL.to_vec()), prop::option::of(any_agent()), agents(), agents()),
        (optional(), optional(), optional(), optional(), optional(), optional(), optional(), optional()),
        prop::option::of(any_date()),
        prop::collection::btree_map("X-[a-zA-Z-]{1,8}", any_text(), 0..3),
    )
        .prop_map(|((performative, sender, receivers, reply_to), texts, reply_by, user)| {
            let (content, language, encoding, ontology, protocol, conversation_id, reply_with, in_reply_to) = texts;
            WireMessage {
                performative,
                sender,
                receivers,
                reply_to,
                content,
                language,
                encoding,
                ontology,
                protocol,
                conversation_id,
                reply_with,
                in_reply_to,
                reply_by,
                user,
            }
        })
}

pub(crate) fn any_envelope() -> impl Strategy<Value = Envelope> {
    // Blanks at the ends of names and addresses are layout in an envelope.
    let plain = || "[a-z&<>\"é][a-z&<>\"é:/@. ]{0,8}[a-z]";
    let agent = move || {
        (plain(), prop::collection::vec(plain(), 0..3))
            .prop_map(|(name, addresses)| AgentId { name: name.into(), addresses: addresses.into() })
    };
    let optional = move || prop::option::of(plain());
    let stamp = (plain(), prop::option::of(any_date()), optional(), optional(), optional())
        .prop_map(|(by, date, from, id, via)| Received { by, date, from, id, via });
    (
        prop::collection::vec(agent(), 1..3),
        prop::option::of(agent()),
        prop::option::of(any_text()),
        prop::option::of(any::<u64>()),
        prop::option::of(any_date()),
        prop::collection::vec(agent(), 0..3),
        prop::collection::vec(stamp, 0..3),
        prop::collection::btree_map(any_text(), any_text(), 0..3),
    )
        .prop_map(|(to, from, comments, payload_length, date, intended_receivers, received, user)| Envelope {
            to,
            from,
            comments,
            acl_representation: STRING_FORM.to_owned(),
            payload_length,
            payload_encoding: Some("UTF-8".to_owned()),
            date,
            intended_receivers,
            received,
            user,
        })
}
