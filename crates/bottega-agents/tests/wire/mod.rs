//! Messages and envelopes in text: our output reads back; foreign input is read or refused.

mod any;
mod document_type;

use std::collections::BTreeMap;

use any::{any_envelope, any_message};
use bottega_agents::{
    AgentId, Performative, Time,
    acc::{Acc, AccError, Letter, Outbound, Routed},
    sl,
    wire::{
        Calendar, DateTime, Envelope, STRING_FORM, TEXT_BYTES_MAX, WireError, WireMessage, XML_FORM, parse_envelope,
        parse_string, parse_xml, print_envelope, print_string, print_xml,
    },
};
use proptest::prelude::*;

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

    /// A damaged message can be read and written again, or is refused.
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

/// Envelope and message of a JADE platform, as it wrote them.
fn recorded_text(number: u32) -> (String, String) {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/wire_data");
    let read = |name: String| std::fs::read_to_string(folder.join(name)).unwrap();
    (read(format!("{number}.envelope.xml")), read(format!("{number}.message.txt")))
}

fn recorded(number: u32) -> (Envelope, String) {
    let (envelope, message) = recorded_text(number);
    (parse_envelope(&envelope).unwrap(), message)
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

/// A string as JADE 4.6.5 reads it, from where it begins: a quote behind a backslash belongs to the text, and lengths are
/// those of UTF-16.
fn read_by_jade(text: &str) -> Option<String> {
    if let Some(counted) = text.strip_prefix('#') {
        let (count, rest) = counted.split_once('"')?;
        let units: Vec<u16> = rest.encode_utf16().take(count.parse().ok()?).collect();
        return String::from_utf16(&units).ok();
    }
    let Some(quoted) = text.strip_prefix('"') else { return text.split([' ', ')']).next().map(str::to_owned) };
    let mut read = String::new();
    let mut characters = quoted.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '"' => return Some(read),
            '\\' if characters.peek() == Some(&'"') => read.extend(characters.next()),
            other => read.push(other),
        }
    }
    None
}

fn written_for_jade(content: &str) -> String {
    let message = WireMessage {
        content: Some(content.to_owned()),
        language: Some("a \"language\"".to_owned()),
        ..WireMessage::new(Performative::Inform)
    };
    print_string(&message).unwrap().split_once(" :content ").unwrap().1.to_owned()
}

#[test]
fn text_with_quotes_is_written_as_jade_writes_it() {
    let (envelope, payload) = recorded(7);
    assert_eq!(envelope.payload_length, Some(payload.len() as u64));
    let begin = payload.find(":content  ").unwrap() + ":content  ".len();
    let end = payload.find(" \n :reply-with").unwrap();
    let content = parse_string(&payload).unwrap().content.unwrap();
    assert!(content.contains(r#":name "“🎨” \"Bóttega\" 中文" :type text"#), "{content}");
    assert_eq!(read_by_jade(&payload[begin..]).as_deref(), Some(content.as_str()));
    assert!(written_for_jade(&content).starts_with(&payload[begin..end]));
    // The same through the types of SL, and with blanks in other places than JADE's.
    let again = sl::print(&sl::parse(&content).unwrap());
    assert_eq!(again, content.replace("( a", "(a").replace("  :", " :").replace(" )", ")"));
}

#[test]
fn any_text_is_written_as_jade_reads_it() {
    for text in [
        r#"a\"b"#,
        r#"“\"🎨"#,
        r#""“🎨” \"Bóttega\" 中文""#,
        r"C:\x\",
        r"中 \",
        r"🎨🎨\",
        r"éé \",
        r"\",
        r#"\""#,
        r#""#,
        r#"\"é\"#,
    ] {
        assert_eq!(read_by_jade(&written_for_jade(text)).as_deref(), Some(text), "{}", written_for_jade(text));
    }
    // One that is read as other text, in bytes or in units: the standard counts.
    assert!(written_for_jade(r"éa\\").starts_with(r#"#5"éa\\ :language"#));
}

#[test]
fn hostile_texts_are_refused_by_name() {
    let string = |text: &str| parse_string(text).unwrap_err().to_string();
    assert_eq!(string("(inform"), "byte 7: expected `:` and a parameter, or `)`");
    assert_eq!(string("(sing :content a)"), "`sing` is not a performative");
    assert_eq!(string("(inform :content a :content b)"), "`content` is given twice");
    assert_eq!(string("(inform) x"), "byte 9: expected the end of the message");
    assert_eq!(string("(inform :content \"a)"), "byte 17: expected a string that ends");
    assert_eq!(string("(inform :content #9\"a)"), "byte 17: expected as many bytes as were counted");
    assert_eq!(string("(inform :content #1\"é)"), "byte 17: expected as many bytes as were counted");
    // Units of UTF-16, of which one is half a character.
    assert_eq!(string("(inform :content #1\"🎨\\)"), "byte 17: expected as many bytes as were counted");
    assert_eq!(string("(inform :reply-by 2026-11-21T02:00:00Z)"), "`2026-11-21T02:00:00Z` is not a date-time");
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
    assert!(
        xml("<fipa-message act=\"inform\"><content>&a;</content></fipa-message>")
            .contains("entities are not supported")
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

/// A document with an entity `&a;` that makes a reader fetch or grow something.
const TRAPS: [&str; 7] = [
    "<!DOCTYPE ROOT [<!ENTITY a \"aaaa\">]>",
    // A billion laughs.
    "<!DOCTYPE ROOT [<!ENTITY z \"ha\"><!ENTITY y \"&z;&z;&z;&z;\"><!ENTITY a \"&y;&y;&y;&y;\">]>",
    "<!DOCTYPE ROOT [<!ENTITY a SYSTEM \"file:///etc/passwd\">]>",
    "<!DOCTYPE ROOT [<!ENTITY % b SYSTEM \"http://127.0.0.1:9/b\"> %b;]>",
    "<!DOCTYPE ROOT SYSTEM \"http://127.0.0.1:9/fipa.dtd\">",
    "<!DOCTYPE ROOT PUBLIC \"-//FIPA//DTD\" \"http://127.0.0.1:9/fipa.dtd\">",
    "<!DOCTYPE ROOT>",
];

#[test]
fn no_document_type_is_fetched_and_no_entity_expanded() {
    let envelope = "<envelope><params index=\"1\"><to><agent-identifier><name>a</name></agent-identifier></to>\
                    <acl-representation>x</acl-representation><comments>TEXT</comments></params></envelope>";
    let message = "<fipa-message act=\"inform\"><content>TEXT</content></fipa-message>";
    let envelope_says = |text: &str| parse_envelope(text).map(|envelope| envelope.comments);
    let message_says = |text: &str| parse_xml(text).map(|message| message.content);
    assert_eq!(envelope_says(envelope), Ok(Some("TEXT".to_owned())));
    assert_eq!(message_says(message), Ok(Some("TEXT".to_owned())));
    let refused = |read: Result<Option<String>, WireError>, why: &str, of: &str| {
        let error = read.expect_err(of).to_string();
        assert!(error.contains(why), "{of}: {error}");
    };
    for trap in TRAPS {
        for declaration in ["", "<?xml version=\"1.0\" standalone=\"no\"?>\n"] {
            for text in ["TEXT", "&a;"] {
                let set = |root, document: &str| {
                    format!("{declaration}{}{}", trap.replace("ROOT", root), document.replace("TEXT", text))
                };
                let set = [set("envelope", envelope), set("fipa-message", message)];
                refused(envelope_says(&set[0]), "document types are not supported", &set[0]);
                refused(message_says(&set[1]), "document types are not supported", &set[1]);
            }
        }
    }
    // Without a document type no entity is declared; the five of XML itself are letters.
    refused(envelope_says(&envelope.replace("TEXT", "&a;")), "entities are not supported", "an entity");
    refused(message_says(&message.replace("TEXT", "&a;")), "entities are not supported", "an entity");
    assert_eq!(
        message_says(&message.replace("TEXT", "&lt;&gt;&amp;&quot;&apos;&#65;&#x42;")),
        Ok(Some("<>&\"'AB".into()))
    );
    // Inclusions of other vocabularies are skipped.
    let include =
        "<xi:include xmlns:xi=\"http://www.w3.org/2001/XInclude\" href=\"file:///etc/passwd\" parse=\"text\"/>";
    assert_eq!(message_says(&message.replace("TEXT", include)), Ok(Some(String::new())));
    let style = format!("<?xml-stylesheet href=\"http://127.0.0.1:9/s.xsl\"?>{envelope}");
    assert_eq!(envelope_says(&style), Ok(Some("TEXT".to_owned())));
    assert!(parse_xml("<fipa-message act=\"inform\"><content href=\"&a;\"/></fipa-message>").is_err());
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

/// The channel's step for a message that arrives for the first time.
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
fn a_missing_receiver_is_reported_to_the_sender_and_a_failure_of_a_failure_is_not() {
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
    // A repeated message is dropped, too; without a date it cannot be recognized.
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
