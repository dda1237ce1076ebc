//! Damaged and malicious bytes: they are refused, or they are harmless.

use bottega_agents::{
    Performative, Time,
    driver::http::{
        client::parse_address,
        head::{parse_head, parse_status},
        multipart,
    },
    platform::{ManagementContent, print_content, read_content},
    sl::{self, Term},
    wire::Calendar,
};
use proptest::prelude::*;

fn any_recorded() -> impl Strategy<Value = Vec<u8>> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/jade_data");
    let files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|file| file.unwrap().path())
        .filter(|path| path.extension().is_some_and(|end| end == "http"))
        .map(|path| std::fs::read(path).unwrap())
        .collect();
    assert!(files.len() > 10);
    prop::sample::select(files)
}

/// Cuts, changes and doubles some bytes.
fn damage(mut bytes: Vec<u8>, blows: &[(prop::sample::Index, u8, u8)]) -> Vec<u8> {
    for (at, kind, byte) in blows {
        if bytes.is_empty() {
            break;
        }
        let at = at.index(bytes.len());
        match kind % 5 {
            0 => bytes[at] = *byte,
            1 => drop(bytes.remove(at)),
            2 => bytes.insert(at, *byte),
            3 => bytes.truncate(at),
            _ => bytes.extend_from_within(at..),
        }
    }
    bytes
}

fn any_blows() -> impl Strategy<Value = Vec<(prop::sample::Index, u8, u8)>> {
    let byte = prop_oneof![any::<u8>(), prop::sample::select(b"()\"\\<>&-:?# \r\n0".to_vec())];
    prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), byte), 1..6)
}

/// Handles the bytes of a request as a server does, up to the mailbox.
fn take(bytes: &[u8]) -> Option<(Performative, Vec<Term>)> {
    let (head, taken) = parse_head(bytes).ok()??;
    let body = &bytes[taken..];
    let body = &body[..head.content_length.min(body.len())];
    let letter = multipart::open(&head.content_type, body).ok()?;
    let content = sl::parse(letter.message.content.as_deref().unwrap_or_default()).ok()?;
    Some((letter.message.performative, content))
}

fn any_term() -> impl Strategy<Value = Term> {
    let leaf = prop_oneof![
        "[a-z?:@+.0-9-]{0,8}".prop_map(Term::Text),
        r#"[ "\\()#&é中\r\n]{0,8}"#.prop_map(Term::Text),
        "[0-9][0-9.]{0,6}".prop_map(Term::Bare),
        "[?:][a-z]{1,6}".prop_map(Term::Bare),
        Just(Term::Bare("true".to_owned())),
    ];
    leaf.prop_recursive(6, 64, 6, |inner| prop::collection::vec(inner, 0..6).prop_map(Term::List))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn damaged_messages_are_refused_or_say_something_that_can_be_said_again(bytes in any_recorded(), blows in any_blows()) {
        let bytes = damage(bytes, &blows);
        _ = parse_status(&bytes);
        let Some((act, content)) = take(&bytes) else { return Ok(()) };
        prop_assert_eq!(sl::parse(&sl::print(&content)).unwrap(), content.clone());
        if let Ok(said) = read_content(Calendar::default(), Time::ZERO, act, &content) {
            let me = bottega_agents::AgentId::new("me@here");
            let text = print_content(Calendar::default(), &me, &said);
            let again = sl::parse(&text).ok().and_then(|terms| read_content(Calendar::default(), Time::ZERO, act, &terms).ok());
            // Cancelled parts are not written again; everything else reads back.
            if said != ManagementContent::Cancel {
                prop_assert_eq!(again, Some(said), "{}", text);
            }
        }
    }

    #[test]
    fn terms_read_back(term in any_term()) {
        prop_assert_eq!(sl::parse_term(&sl::print_term(&term)).unwrap(), term);
    }

    #[test]
    fn no_text_makes_a_reader_panic(text in "\\PC{0,80}", soup in r#"[()"\\#: a-z0-9?-]{0,80}"#, bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        for text in [text, soup] {
            if let Ok(terms) = sl::parse(&text) {
                prop_assert_eq!(sl::parse(&sl::print(&terms)).unwrap(), terms);
            }
            _ = (parse_address(&text).is_ok(), multipart::open(&text, &bytes).is_ok());
        }
        _ = (parse_head(&bytes).is_ok(), parse_status(&bytes).is_ok());
    }
}

#[test]
fn recorded_messages_are_all_read() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/jade_data");
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let bytes = std::fs::read(&path).unwrap();
        if bytes.starts_with(b"POST") {
            let (act, content) = take(&bytes).unwrap_or_else(|| panic!("{path:?}"));
            let read = read_content(Calendar::default(), Time::ZERO, act, &content);
            assert!(read.is_ok(), "{path:?}: {read:?}");
        }
    }
}

#[test]
fn addresses_are_read_whole() {
    assert_eq!(parse_address("http://h:80/acc").unwrap(), ("h:80".to_owned(), "/acc"));
    assert_eq!(parse_address("HTTP://h").unwrap(), ("h:80".to_owned(), "/"));
    assert_eq!(parse_address("http://[::1]:7/x").unwrap(), ("[::1]:7".to_owned(), "/x"));
    assert_eq!(parse_address("http://[::1]/x").unwrap(), ("[::1]:80".to_owned(), "/x"));
    for bad in ["", "https://h/", "http:///acc", "http://h /", "http://u@h/", "http://h/a b", "http://h/\r\nX: y"] {
        assert!(parse_address(bad).is_err(), "{bad}");
    }
}
