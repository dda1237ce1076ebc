//! Messages and envelopes in text: what is written reads back, what strangers write is read or refused.

use std::collections::BTreeMap;

use bottega_agents::{
    AgentId, Performative, Time,
    acc::{Acc, AccError, Letter, Outbound, Routed},
    wire::{
        Calendar, DateTime, Envelope, Received, STRING_FORM, TEXT_BYTES_MAX, WireError, WireMessage, XML_FORM,
        parse_envelope, parse_string, parse_xml, print_envelope, print_string, print_xml,
    },
};
use proptest::prelude::*;

/// Text as XML can hold it, with all that needs care.
fn any_text() -> impl Strategy<Value = String> {
    prop_oneof![
        "[a-z0-9:@#.+/-]{0,12}",
        r#"[ "\\()#&<>'=;\r\n\té中🎨a]{0,16}"#,
        "\\PC{0,12}".prop_filter("XML cannot hold it", |text| !text.contains(['\u{fffe}', '\u{ffff}'])),
    ]
}

fn any_agent() -> impl Strategy<Value = AgentId> {
    (any_text(), prop::collection::vec(any_text(), 0..3))
        .prop_map(|(name, addresses)| AgentId { name: name.into(), addresses: addresses.into() })
}

fn any_date() -> impl Strategy<Value = DateTime> {
    "[+]?2026112[0-9][TZ]1[0-9][0-5][0-9][0-5][0-9]{4}[A-Z]?".prop_map(|text| DateTime::parse(&text).unwrap())
}

fn any_message() -> impl Strategy<Value = WireMessage> {
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

fn any_envelope() -> impl Strategy<Value = Envelope> {
    // Blanks at the ends of names and addresses are layout in an envelope.
    let plain = || "[a-z&<>\"é][a-z&<>\"é:/@. ]{0,8}[a-z]";
    let agent = move || {
        (plain(), prop::collection::vec(plain(), 0..3))
            .prop_map(|(name, addresses)| AgentId { name: name.into(), addresses: addresses.into() })
    };
    let stamp = (plain(), any_date(), prop::option::of(plain())).prop_map(|(by, date, via)| Received {
        by,
        date,
        from: None,
        id: None,
        via,
    });
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

/// Two are equal in every letter, addresses included, which the equality of identifiers passes over.
fn assert_same<T: std::fmt::Debug>(a: &T, b: &T) {
    assert_eq!(format!("{a:?}"), format!("{b:?}"));
}

proptest! {
    #[test]
    fn a_message_reads_back_from_the_string_form(message in any_message()) {
        let text = print_string(&message).unwrap();
        assert_same(&parse_string(&text).unwrap(), &message);
    }

    #[test]
    fn a_message_reads_back_from_xml(message in any_message()) {
        let text = print_xml(&message).unwrap();
        assert_same(&parse_xml(&text).unwrap(), &message);
    }

    #[test]
    fn an_envelope_reads_back(envelope in any_envelope()) {
        let text = print_envelope(&envelope).unwrap();
        assert_same(&parse_envelope(&text).unwrap(), &envelope);
    }

    #[test]
    fn no_text_makes_a_reader_panic(text in "\\PC{0,200}", soup in r#"[()"\\#: a-z0-9<>/&;=!\[-]{0,120}"#) {
        for text in [text, soup] {
            _ = (parse_string(&text), parse_xml(&text), parse_envelope(&text), DateTime::parse(&text));
        }
    }

    /// What was damaged on its way reads as a message that can be written again, or not at all.
    #[test]
    fn damage_is_found_or_harmless(message in any_message(), at in any::<prop::sample::Index>(), cut in 0..9_usize, put in r#"[()"\\#: <>&;0-9é]{0,3}"#) {
        let damage = |text: &str| {
            let mut start = at.index(text.len());
            while !text.is_char_boundary(start) {
                start -= 1;
            }
            let mut end = (start + cut).min(text.len());
            while !text.is_char_boundary(end) {
                end += 1;
            }
            format!("{}{put}{}", &text[..start], &text[end..])
        };
        if let Ok(read) = parse_string(&damage(&print_string(&message).unwrap())) {
            assert_same(&parse_string(&print_string(&read).unwrap()).unwrap(), &read);
        }
        if let Ok(read) = parse_xml(&damage(&print_xml(&message).unwrap())) {
            assert_same(&parse_xml(&print_xml(&read).unwrap()).unwrap(), &read);
        }
    }
}

/// Envelope and message of a JADE platform.
fn recorded(number: u32) -> (Envelope, String) {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/wire_data");
    let read = |name: String| std::fs::read_to_string(folder.join(name)).unwrap();
    (parse_envelope(&read(format!("{number}.envelope.xml"))).unwrap(), read(format!("{number}.message.txt")))
}

#[test]
fn what_jade_writes_is_read() {
    for number in 1..=6 {
        let (envelope, payload) = recorded(number);
        let message = if number == 5 { parse_xml(&payload) } else { parse_string(&payload) }.unwrap();
        assert_eq!(envelope.acl_representation, if number == 5 { XML_FORM } else { STRING_FORM });
        assert_eq!(envelope.to, message.receivers);
        assert_eq!(envelope.intended_receivers, message.receivers);
        let sender = message.sender.unwrap();
        assert_eq!(&*sender.addresses, ["http://127.0.0.1:7778/acc"]);
        assert_eq!(envelope.from, Some(sender));
        assert_eq!(message.protocol.as_deref(), Some("fipa-request"));
        assert_eq!(message.performative, if number == 6 { Performative::Inform } else { Performative::Request });
    }
    let (_, payload) = recorded(6);
    let content = parse_string(&payload).unwrap().content.unwrap();
    assert!(content.contains(r#":name "\"jade\"" :ap-services"#), "{content}");
    let (_, payload) = recorded(4);
    assert!(parse_string(&payload).unwrap().content.unwrap().contains("réndering 中文 🎨"));
}

#[test]
fn hostile_texts_are_refused_by_name() {
    let string = |text: &str| parse_string(text).unwrap_err().to_string();
    assert_eq!(string("(inform"), "byte 7: expected `:` and a parameter, or `)`");
    assert_eq!(string("(sing :content a)"), "`sing` is no performative");
    assert_eq!(string("(inform :content a :content b)"), "`content` is given twice");
    assert_eq!(string("(inform) x"), "byte 9: expected the end of the message");
    assert_eq!(string("(inform :content \"a)"), "byte 17: expected a string that ends");
    assert_eq!(string("(inform :content #9\"a)"), "byte 17: expected as many bytes as were counted");
    assert_eq!(string("(inform :content #1\"é)"), "byte 17: expected as many bytes as were counted");
    assert_eq!(string("(inform :reply-by 2026-11-21T02:00:00Z)"), "`2026-11-21T02:00:00Z` is no date-time");
    assert_eq!(string("(inform :sender (agent-identifier))"), "`agent-identifier` has no `name`");
    // As deep as it likes: what is unknown is passed over without a stack.
    let deep = format!("(inform :other {}{} :content a)", "(x ".repeat(100_000), ")".repeat(100_000));
    assert_eq!(parse_string(&deep).unwrap().content.as_deref(), Some("a"));
    let long = "x".repeat(TEXT_BYTES_MAX + 1);
    assert_eq!(parse_string(&long), Err(WireError::TooMany { what: "bytes", max: TEXT_BYTES_MAX }));
    assert_eq!(parse_xml(&long), Err(WireError::TooMany { what: "bytes", max: TEXT_BYTES_MAX }));
    let many = format!("(inform :receiver (set {}))", "(agent-identifier :name a) ".repeat(2000));
    assert!(matches!(parse_string(&many), Err(WireError::TooMany { what: "agents", .. })));

    let xml = |text: &str| parse_xml(text).unwrap_err().to_string();
    let bomb = "<!DOCTYPE m [<!ENTITY a \"aaaa\">]><fipa-message act=\"inform\"><content>&a;</content></fipa-message>";
    assert!(xml(bomb).contains("document types are not taken"), "{}", xml(bomb));
    assert!(
        xml("<fipa-message act=\"inform\"><content>&a;</content></fipa-message>").contains("entities are not taken")
    );
    assert!(parse_xml("<fipa-message act=\"&a;\"/>").is_err());
    assert!(xml("<fipa-message act=\"inform\"><content>&#1;</content></fipa-message>").contains("is not allowed"));
    assert!(xml("<fipa-message act=\"inform\">\u{1}</fipa-message>").contains("is not allowed"));
    assert!(xml("<fipa-message act=\"inform\"/><x/>").contains("one element"));
    assert!(parse_xml("<fipa-message act=\"inform\">").is_err());
    assert!(parse_xml("</fipa-message>").is_err());
    assert!(xml(&"<a>".repeat(100_000)).contains("too many elements within elements"));
    assert!(xml(&format!("<a>{}</a>", "<b/>".repeat(100_000))).contains("too many elements"));
    assert!(parse_envelope("<envelope><params index=\"1\"/></envelope>").is_err());
}

#[test]
fn the_parameter_with_the_greatest_index_counts_and_stamps_are_read_in_both_ways() {
    let text = r#"<envelope>
        <params index="2"><comments>new</comments>
            <received><received-by><url>http://b</url></received-by><received-date value="20261121T000000000"/></received>
        </params>
        <params index="1"><to><agent-identifier><name> a@x </name></agent-identifier></to>
            <acl-representation>fipa.acl.rep.string.std</acl-representation><comments>old</comments></params>
    </envelope>"#;
    let envelope = parse_envelope(text).unwrap();
    assert_eq!(envelope.comments.as_deref(), Some("new"));
    assert_eq!(envelope.to, [AgentId::new("a@x")]);
    assert_eq!(envelope.received[0].by, "http://b");
}

fn channel() -> Acc {
    let mut acc = Acc::new("bottega", vec!["http://127.0.0.1:7779/acc".to_owned()], Calendar::default(), 1);
    acc.add(AgentId::new("ams@bottega"));
    acc
}

/// What a channel does with a message that comes for the first time.
fn receive(envelope: &Envelope, payload: &str) -> Result<Vec<Routed>, AccError> {
    let letter = Letter::open(envelope.clone(), payload.as_bytes())?;
    channel().receive(Time::ZERO, &letter)
}

#[test]
fn a_message_reaches_the_mailboxes_that_its_envelope_names() {
    let (envelope, payload) = recorded(1);
    let routed = receive(&envelope, &payload).unwrap();
    match &routed[..] {
        [Routed::Deliver { to, message }] => {
            assert_eq!(*to, AgentId::new("ams@bottega"));
            assert_eq!(message.performative, Performative::Request);
        }
        other => panic!("{other:?}"),
    }
    // Intended receivers stand for all of `to`.
    let mut twice = envelope.clone();
    twice.to.push(AgentId::new("ams@bottega"));
    assert_eq!(receive(&twice, &payload).unwrap().len(), 1);
}

#[test]
fn the_sender_is_told_of_an_agent_that_is_not_there_and_never_of_a_failure_of_a_failure() {
    let (mut envelope, payload) = recorded(5);
    envelope.intended_receivers = vec![AgentId::new("nobody@bottega")];
    let routed = receive(&envelope, &payload).unwrap();
    let [Routed::Forward(Outbound { addresses, envelope: back, payload: answer, .. })] = &routed[..] else {
        panic!("{routed:?}")
    };
    assert_eq!(*addresses, ["http://127.0.0.1:7778/acc"]);
    assert_eq!((back.acl_representation.as_str(), back.received.len()), (XML_FORM, 0));
    assert_eq!(back.payload_length, Some(answer.len() as u64));
    let failure = parse_xml(answer).unwrap();
    assert_eq!(failure.performative, Performative::Failure);
    assert_eq!(failure.in_reply_to, parse_xml(&payload).unwrap().reply_with);
    let content = failure.content.unwrap();
    assert!(content.contains("(MTS-error (agent-identifier :name nobody@bottega) (internal-error"), "{content}");
    let failed = payload.replace("act=\"request\"", "act=\"failure\"");
    assert_eq!(receive(&envelope, &failed).unwrap(), []);
}

#[test]
fn what_is_for_another_platform_goes_on_with_a_stamp_and_does_not_come_round_again() {
    let (mut envelope, payload) = recorded(1);
    let there = AgentId { name: "a@there".into(), addresses: vec!["http://there/acc".to_owned()].into() };
    envelope.intended_receivers.push(there.clone());
    let routed = receive(&envelope, &payload).unwrap();
    let forward = routed.iter().find_map(|one| match one {
        Routed::Forward(Outbound { addresses, envelope, .. }) => Some((addresses, envelope)),
        Routed::Deliver { .. } => None,
    });
    let (addresses, onward) = forward.unwrap();
    assert_eq!((routed.len(), addresses.as_slice()), (2, &["http://there/acc".to_owned()][..]));
    assert_eq!(onward.intended_receivers, [there]);
    assert_eq!(receive(onward, &payload), Err(AccError::Loop));
    // The same once more is dropped, too; without a date nobody can tell.
    let mut letter = Letter::open(envelope.clone(), payload.as_bytes()).unwrap();
    let mut acc = channel();
    assert!(acc.receive(Time::ZERO, &letter).is_ok());
    assert_eq!(acc.receive(Time::ZERO, &letter), Err(AccError::Loop));
    letter.envelope.date = None;
    assert!(acc.receive(Time::ZERO, &letter).is_ok() && acc.receive(Time::ZERO, &letter).is_ok());
    let unknown = Envelope { acl_representation: "fipa.acl.rep.bitefficient.std".into(), ..envelope };
    assert!(matches!(receive(&unknown, &payload), Err(AccError::UnknownForm(_))));
}

#[test]
fn an_answer_is_threaded_and_goes_where_it_was_wanted() {
    let ask = WireMessage {
        sender: Some(AgentId::new("a")),
        reply_to: vec![AgentId::new("b")],
        conversation_id: Some("7abc-9".into()),
        reply_with: Some("r".into()),
        user: BTreeMap::from([("X-odd".to_owned(), "1".to_owned())]),
        ..WireMessage::new(Performative::QueryRef)
    };
    let answer = ask.reply(Performative::Inform, AgentId::new("c"), "yes".into());
    assert_eq!(answer.receivers, [AgentId::new("b")]);
    assert_eq!((answer.in_reply_to.as_deref(), answer.reply_with.as_deref()), (Some("r"), None));
    let text = print_string(&answer).unwrap();
    assert!(text.contains(":conversation-id \"7abc-9\""), "a reader may lose it without quotes: {text}");
    let odd = WireMessage { user: BTreeMap::from([("X-a b".to_owned(), String::new())]), ..ask };
    assert!(print_string(&odd).is_err());
}
