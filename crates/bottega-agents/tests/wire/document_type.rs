//! Envelopes and messages in XML against their document types: our output is valid by an independent validator, and
//! valid input is read.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use bottega_agents::{
    AgentId,
    wire::{WireMessage, parse_envelope, parse_xml, print_envelope, print_xml},
};
use proptest::{prelude::*, strategy::ValueTree, test_runner::TestRunner};

use super::{
    any::{any_envelope, any_message},
    assert_same, recorded_text,
};

/// Documents for each claim.
const DOCUMENTS: usize = 400;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/wire_data").join(name)
}

/// Returns the documents that xmllint finds invalid, with its messages. `None`: xmllint is not installed.
fn invalid(document_type: &str, documents: &[String]) -> Option<Vec<String>> {
    let folder = tempfile::tempdir().unwrap();
    let name = |number: usize| folder.path().join(format!("{number}.xml"));
    for (number, document) in documents.iter().enumerate() {
        fs::write(name(number), document).unwrap();
    }
    let mut command = Command::new("xmllint");
    command.args(["--noout", "--nonet", "--dtdvalid"]).arg(data(document_type)).args((0..documents.len()).map(name));
    let Ok(judged) = command.output() else {
        eprintln!("SKIPPED: there is no xmllint; `cargo xtask test` installs one");
        return None;
    };
    let said = String::from_utf8_lossy(&judged.stderr).into_owned();
    let complaints = documents.iter().enumerate().filter_map(|(number, document)| {
        let of_it: Vec<&str> = said.lines().filter(|line| line.contains(&*name(number).to_string_lossy())).collect();
        (!of_it.is_empty()).then(|| format!("{}\n{document}", of_it.join("\n")))
    });
    let complaints: Vec<String> = complaints.collect();
    assert_eq!(judged.status.success(), complaints.is_empty(), "{said}");
    Some(complaints)
}

/// The same values at each run.
fn some_of<T: std::fmt::Debug>(strategy: impl Strategy<Value = T>) -> Vec<T> {
    let mut runner = TestRunner::deterministic();
    (0..DOCUMENTS).map(|_| strategy.new_tree(&mut runner).unwrap().current()).collect()
}

fn assert_valid(document_type: &str, documents: &[String]) {
    if let Some(complaints) = invalid(document_type, documents) {
        assert!(complaints.is_empty(), "{} of {}; first {}", complaints.len(), documents.len(), complaints[0]);
    }
}

#[test]
fn all_that_is_written_is_valid() {
    let messages: Vec<String> = some_of(any_message()).iter().map(|message| print_xml(message).unwrap()).collect();
    assert_valid("message.dtd", &messages);
    let envelopes: Vec<String> =
        some_of(any_envelope()).iter().map(|envelope| print_envelope(envelope).unwrap()).collect();
    assert_valid("envelope.dtd", &envelopes);
}

#[test]
fn the_judge_finds_what_is_wrong() {
    let envelope = |inner: &str| format!("<envelope><params index=\"1\">{inner}</params></envelope>");
    let aid = "<agent-identifier><name>a</name></agent-identifier>";
    let envelopes = [
        envelope(&format!("<to>{aid}</to>")),
        envelope(&format!("<to>{aid}</to><to>{aid}</to>")),
        envelope(&format!("<from>{aid}</from><to>{aid}</to>")),
        envelope("<received><received-by value=\"b\"/><received-date value=\"d\"/></received>"),
        envelope("<to><agent-identifier><name>a</name><addresses/></agent-identifier></to>"),
        "<envelope><params/></envelope>".to_owned(),
    ];
    let messages = [
        "<fipa-message act=\"inform\"/>",
        "<fipa-message act=\"INFORM\"/>",
        "<fipa-message/>",
        "<fipa-message act=\"inform\"><reply-by/></fipa-message>",
        "<fipa-message act=\"inform\"><sender/></fipa-message>",
    ];
    for (document_type, documents) in
        [("envelope.dtd", envelopes.to_vec()), ("message.dtd", messages.map(str::to_owned).to_vec())]
    {
        if let Some(complaints) = invalid(document_type, &documents) {
            assert_eq!(complaints.len(), documents.len() - 1, "the first of each is valid: {complaints:#?}");
        }
    }
}

/// The envelope in a request over HTTP.
fn envelope_in(request: &str) -> Option<String> {
    let from = request.find("<?xml version=\"1.0\"?>\n<envelope>")?;
    let length = request[from..].find("</envelope>")? + "</envelope>".len();
    Some(request[from..from + length].to_owned())
}

#[test]
fn what_jade_writes_is_valid() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/jade_data");
    let requests = fs::read_dir(folder).unwrap().map(|file| fs::read_to_string(file.unwrap().path()).unwrap());
    let mut envelopes: Vec<String> = requests.filter_map(|request| envelope_in(&request)).collect();
    assert_eq!(envelopes.len(), 15);
    envelopes.extend((1..=6).map(|number| recorded_text(number).0));
    assert_valid("envelope.dtd", &envelopes);
    assert_valid("message.dtd", &[recorded_text(5).1]);
}

/// Some of all that a document type allows for a parameter of a message.
fn any_parameter() -> impl Strategy<Value = String> {
    let aid = any_valid_agent;
    let text = prop::sample::select(&["", "a", "a &lt;b&gt; &amp; c", "<![CDATA[<b>&]]>", "\n x <!-- y --> z\n"][..]);
    let name = prop::sample::select(&["content", "language", "encoding", "ontology", "protocol", "reply-with"][..]);
    let other = prop::sample::select(&["in-reply-to", "conversation-id", "user-defined"][..]);
    let href = prop::sample::select(&["", " href=\"X-a\"", " href=''"][..]);
    prop_oneof![
        (prop_oneof![name, other], href, text).prop_map(|(name, href, text)| format!("<{name}{href}>{text}</{name}>")),
        aid().prop_map(|aid| format!("<sender>{aid}</sender>")),
        aid().prop_map(|aid| format!("<receiver>\n {aid}</receiver>")),
        prop::collection::vec(aid(), 1..3).prop_map(|agents| format!("<reply-to>{}</reply-to>", agents.concat())),
        prop::sample::select(&["", " href='h'"][..])
            .prop_map(|href| format!("<reply-by time=\"20261121T022548103Z\"{href}></reply-by>")),
    ]
}

/// An agent in a message with all that may be in it.
fn any_valid_agent() -> impl Strategy<Value = String> {
    let name = prop::sample::select(&["<name id=\"a@h\"/>", "<name id='b@h'></name>", "<name refid=\"a@h\"/>"][..]);
    let addresses =
        ["", "<addresses><url href=\"http://a\"/></addresses>", "<addresses><url/><url href='u'/></addresses>"];
    let resolver = "<resolvers><agent-identifier><name id=\"r@h\"/></agent-identifier></resolvers>";
    let user = ["", "<user-defined href=\"X-a\">x</user-defined>", "<user-defined/><user-defined>y</user-defined>"];
    let of = |all: &[&'static str]| prop::sample::select(all.to_vec());
    (name, of(&addresses), of(&["", resolver]), of(&user)).prop_map(|(name, addresses, resolvers, user)| {
        format!("<agent-identifier>\n\t{name}{addresses}{resolvers}{user} </agent-identifier>")
    })
}

/// The name of the element with which a parameter begins.
fn element_of(parameter: &str) -> &str {
    parameter[1..].split([' ', '>']).next().unwrap()
}

/// A message in which parameters come in any order, each once but for the receivers, which the standard says in a comment, and
/// user-defined ones.
fn any_valid_message() -> impl Strategy<Value = (String, Vec<String>)> {
    let heads = ["<fipa-message act=\"cfp\">", "<fipa-message conversation-id=\"c\" act='request-whenever'>"];
    (prop::sample::select(heads.to_vec()), prop::collection::vec(any_parameter(), 0..12)).prop_map(
        |(head, parameters)| {
            let mut taken: Vec<String> = Vec::new();
            for parameter in parameters {
                let name = element_of(&parameter);
                let again = taken.iter().any(|other| match name {
                    "receiver" => false,
                    // Two with one name are one parameter given twice.
                    "user-defined" => *other == parameter || element_of(other) == name && other.contains("href"),
                    _ => element_of(other) == name,
                });
                if !again {
                    taken.push(parameter);
                }
            }
            let text =
                format!("<?xml version='1.0'?>\n<!-- from afar -->{head}\n  {}</fipa-message>\n", taken.join(" "));
            (text, taken)
        },
    )
}

#[test]
fn every_valid_message_is_read() {
    let (documents, parameters): (Vec<String>, Vec<Vec<String>>) = some_of(any_valid_message()).into_iter().unzip();
    assert_valid("message.dtd", &documents);
    for (document, parameters) in documents.iter().zip(parameters) {
        let message = parse_xml(document).unwrap_or_else(|error| panic!("{error}:\n{document}"));
        let has = |name: &str| parameters.iter().any(|parameter| element_of(parameter) == name);
        let receivers = parameters.iter().filter(|parameter| element_of(parameter) == "receiver").count();
        assert_eq!(message.receivers.len(), receivers, "{document}");
        for (name, is_there) in [
            ("sender", message.sender.is_some()),
            ("reply-to", !message.reply_to.is_empty()),
            ("content", message.content.is_some()),
            ("ontology", message.ontology.is_some()),
            ("reply-by", message.reply_by.is_some()),
            ("in-reply-to", message.in_reply_to.is_some()),
        ] {
            assert_eq!(is_there, has(name), "{name}: {document}");
        }
        let by_attribute = document.contains("conversation-id=\"c\"");
        assert_eq!(message.conversation_id.is_some(), by_attribute || has("conversation-id"), "{document}");
        // Written again it is the same, and valid.
        assert_same(&parse_xml(&print_xml(&message).unwrap()).unwrap(), &message);
    }
}

/// An envelope with all that may be in it, in the order that the document type wants.
fn any_valid_envelope() -> impl Strategy<Value = String> {
    let aid = || {
        let of = |all: &[&'static str]| prop::sample::select(all.to_vec());
        let addresses = ["", "<addresses><url>http://a</url><url/></addresses>", "<addresses><url>u</url></addresses>"];
        let more =
            "<resolvers><agent-identifier><name>r</name></agent-identifier></resolvers><user-defined>x</user-defined>";
        (of(&addresses), of(&["", more, "<user-defined href='X-a'/>"])).prop_map(|(addresses, more)| {
            format!("<agent-identifier> <name>\n a@h </name>{addresses}{more}</agent-identifier>")
        })
    };
    let agents = move |name: &'static str| {
        prop::collection::vec(aid(), 1..3).prop_map(move |agents| format!("<{name}>{}</{name}>", agents.concat()))
    };
    let maybe = |text: &'static str| prop::sample::select(vec![String::new(), text.to_owned()]);
    let stamp = |inner: &str| format!("<received><received-by><url>http://b</url></received-by>{inner}</received>");
    let stamps = vec![
        String::new(),
        stamp("<received-date/>"),
        stamp("<received-from><url/></received-from><received-date value='20261121T022548103'/><received-id/>"),
        stamp("<received-date value=\"20261121T022548103Z\"/><received-via value='v'/><user-defined>x</user-defined>"),
    ];
    let users = ["", "<user-defined/>", "<user-defined href='X-a'>1</user-defined><user-defined>2</user-defined>"];
    (
        (agents("to"), prop_oneof![Just(String::new()), aid().prop_map(|from| format!("<from>{from}</from>"))]),
        maybe("<comments/>"),
        maybe("<payload-length> 12 </payload-length><payload-encoding>UTF-8</payload-encoding>"),
        maybe("<date>20261121T022548103</date>"),
        prop_oneof![Just(String::new()), agents("intended-receiver")],
        prop::sample::select(stamps),
        prop::sample::select(users.to_vec()),
        maybe("<params index=\"2\"/><params index='3'><comments>later</comments></params>"),
    )
        .prop_map(|((to, from), comments, payload, date, intended, stamp, user, later)| {
            let form = "<acl-representation>\nfipa.acl.rep.string.std</acl-representation>";
            format!(
                "<envelope>\n<params index=\"1\">{to}{from}{comments}{form}{payload}{date}{intended}{stamp}{user}\
                 </params>{later}</envelope>"
            )
        })
}

#[test]
fn every_valid_envelope_with_what_an_envelope_must_have_is_read() {
    let documents = some_of(any_valid_envelope());
    assert_valid("envelope.dtd", &documents);
    for document in &documents {
        let envelope = parse_envelope(document).unwrap_or_else(|error| panic!("{error}:\n{document}"));
        assert!(envelope.to.iter().all(|agent| *agent == AgentId::new("a@h")), "{document}");
        let names = document.matches("\n a@h ").count();
        let found = envelope.to.len() + usize::from(envelope.from.is_some()) + envelope.intended_receivers.len();
        assert_eq!(found, names, "{document}");
        assert_eq!(envelope.received.len(), document.matches("<received>").count());
        assert_eq!(envelope.received.first().map(|stamp| stamp.by.as_str()).unwrap_or("http://b"), "http://b");
        assert_same(&parse_envelope(&print_envelope(&envelope).unwrap()).unwrap(), &envelope);
    }
}

#[test]
fn a_name_that_stands_for_another_has_its_addresses_and_the_element_of_the_conversation_counts() {
    let text = "<fipa-message act=\"inform\" conversation-id=\"_7\">\
        <reply-to><agent-identifier><name refid=\"a@h\"/></agent-identifier></reply-to>\
        <sender><agent-identifier><name id=\"a@h\"/><addresses><url href=\"http://h\"/></addresses></agent-identifier></sender>\
        <receiver><agent-identifier><name refid=\"a@h\"/><addresses><url href=\"http://k\"/></addresses></agent-identifier></receiver>\
        <receiver><agent-identifier><name> b@h </name><addresses><url> http://b </url></addresses></agent-identifier></receiver>\
        <conversation-id>7</conversation-id></fipa-message>";
    let message: WireMessage = parse_xml(text).unwrap();
    assert_eq!(message.conversation_id.as_deref(), Some("7"));
    let addresses: Vec<_> =
        message.reply_to.iter().chain(&message.receivers).map(|agent| agent.addresses.concat()).collect();
    assert_eq!(addresses, ["http://h", "http://k", "http://b"]);
    assert_eq!(message.receivers[1], AgentId::new("b@h"));
    assert!(parse_xml(&text.replace("> b@h <", "> <")).is_err(), "an agent without a name");
}
