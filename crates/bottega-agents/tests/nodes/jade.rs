//! A JADE platform talks to ours over a real socket: recorded bytes go in, answers that it can read come out.

use std::thread;

use crate::nodes::support::{self, Jade, Line, TAKEN, is, node};
use bottega_agents::{
    AgentId, Performative as P,
    driver::node::Node,
    gateway::PlainContent,
    platform::{
        AmsAgentDescription, DfAgentDescription, FailureReason, Function, ManagementContent, Outcome, RefuseReason,
        SearchConstraints, ServiceDescription,
    },
    wire::XML_FORM,
};

#[test]
fn it_asks_the_ams_what_the_platform_is() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    let mut line = Line::to(&bottega);
    assert_eq!(line.ask(&jade.says(1, &bottega)), TAKEN);
    let heard = jade.hear();
    assert!(heard.head.starts_with("POST /acc HTTP/1.1\r\n") && heard.head.contains("\r\nConnection: close"));
    let content = is(&heard.message, P::Inform);
    let address = bottega.address();
    assert_eq!(
        content,
        format!(
            "((result (action (agent-identifier :name ams@bottega :addresses (sequence {address})) (get-description)) \
             (sequence (ap-description :name bottega :ap-services (set (ap-service :name fipa.mts.mtp.http.std :type \
             fipa.mts.mtp.http.std :addresses (sequence {address})))))))"
        )
    );
    assert_eq!(heard.message.in_reply_to.as_deref(), Some("rw-probe-1795227948100-1"));
    assert_eq!(heard.message.conversation_id.as_deref(), Some("probe-1795227948100-1"));
}

#[test]
fn it_registers_and_searches_and_a_second_registration_is_refused() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    let mut line = Line::to(&bottega);
    // After each body JADE sends a line end too many, on a connection that it keeps.
    assert_eq!(line.ask(&format!("{}\r\n", jade.says(5, &bottega))), TAKEN);
    let done = jade.hear().message;
    let content = is(&done, P::Inform);
    assert!(content.starts_with("((done (action (agent-identifier :name df@bottega"), "{content}");
    assert!(content.contains(":properties (set (property :name vcp :value \"1.5\"))"), "{content}");
    assert_eq!(done.ontology.as_deref(), Some("FIPA-Agent-Management"));

    assert_eq!(line.ask(&jade.says(9, &bottega)), TAKEN);
    let found = jade.hear().message;
    let content = is(&found, P::Inform);
    assert!(content.contains("(sequence (df-agent-description :name (agent-identifier :name probe@jade"), "{content}");
    assert!(content.contains(":type rendering :ownership probe"), "{content}");

    // The same message again is a repetition; the same wish in a new one fails.
    line.ask(&jade.says(5, &bottega));
    assert!(jade.hears_nothing());
    line.ask(&jade.says_else(5, &bottega, |text| text.replace("948162", "948163")));
    let failed = jade.hear().message;
    assert!(is(&failed, P::Failure).ends_with("(already-registered))"), "{failed:?}");

    // Another agent of JADE's, with text beyond ASCII.
    line.ask(&jade.says_else(15, &bottega, |text| text.replace("probe@jade", "paint@jade")));
    assert!(is(&jade.hear().message, P::Inform).contains("Bóttega — réndering 中文 🎨"));

    // Quotes in a text beyond ASCII come back in the bytes in which JADE writes them.
    line.ask(&jade.says(31, &bottega));
    let heard = jade.hear();
    assert!(is(&heard.message, P::Inform).contains(r#":name "“🎨” \"Bóttega\" 中文""#), "{heard:?}");
    assert!(heard.payload.contains(r#":name \"“🎨” \\"Bóttega\\" 中文\""#), "{}", heard.payload);
}

#[test]
fn it_is_answered_in_the_form_in_which_it_asks() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    Line::to(&bottega).ask(&jade.says(16, &bottega));
    let heard = jade.hear();
    assert_eq!(heard.envelope.acl_representation, XML_FORM);
    assert!(is(&heard.message, P::Inform).contains("(ap-description :name bottega"));
}

/// A message of JADE's own DFService, with another content and act.
fn says(jade: &Jade, node: &Node, act: &str, content: &str, number: u32) -> String {
    jade.says_else(9, node, |text| {
        let begin = text.find(":content  \"").unwrap() + 11;
        let end = text.find("\" \n :reply-with").unwrap();
        let content = content.replace('"', "\\\"").replace("DF", "(agent-identifier :name df@bottega)");
        format!("{}{content}{}", &text[..begin], &text[end..])
            .replace("(REQUEST", &format!("({act}"))
            .replace("1795227948166-2", &format!("{number}"))
    })
}

#[test]
fn what_is_wrong_is_answered_as_the_standard_wants_it() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    let mut line = Line::to(&bottega);
    let register = |what: &str| format!("((action DF (register (df-agent-description {what}))))");
    let me = ":name (agent-identifier :name probe@jade)";
    for (number, (act, content, answer, end)) in (0..).zip([
        ("REQUEST", "((action DF (fly 1)))".to_owned(), P::Refuse, "(fly 1)) (unsupported-function fly))"),
        ("REQUEST", register(""), P::Refuse, "(missing-parameter df-agent-description name))"),
        ("REQUEST", register(":name (agent-identifier :name other@jade)"), P::Refuse, "(unauthorised))"),
        (
            "REQUEST",
            register(&format!("{me} :lease-time tomorrow")),
            P::Refuse,
            "(unrecognised-parameter-value df-agent-description lease-time))",
        ),
        (
            "REQUEST",
            register(&format!("{me} :services (set (service-description :name x))")),
            P::Refuse,
            "(missing-parameter service-description type))",
        ),
        ("REQUEST", "((action DF (register)))".to_owned(), P::Refuse, "(missing-argument agent-description))"),
        ("REQUEST", "((action DF (register (x))))".to_owned(), P::Refuse, "(unexpected-argument x))"),
        (
            "REQUEST",
            "((action DF (search (df-agent-description) (search-constraints) 3)))".to_owned(),
            P::Refuse,
            "(unexpected-argument-count))",
        ),
        ("REQUEST", "((action DF (get-description)))".to_owned(), P::Refuse, "(unsupported-function get-description))"),
        (
            "REQUEST",
            "((action DF (deregister (df-agent-description :name (agent-identifier :name probe@jade)))))".to_owned(),
            P::Failure,
            "(not-registered))",
        ),
        (
            "REQUEST",
            register(&format!("{me} :languages (set fipa-sl) :scope (set {})", "x".repeat(1 << 20))),
            P::Refuse,
            "(unrecognised-parameter-value df-agent-description scope))",
        ),
        ("REQUEST", "((action DF (quit)))".to_owned(), P::NotUnderstood, "(unrecognised-value content))"),
        ("REQUEST", "((action".to_owned(), P::NotUnderstood, "((unrecognised-value content))"),
        ("PROPOSE", "((action DF (search)))".to_owned(), P::NotUnderstood, "(unsupported-act propose))"),
        ("SUBSCRIBE", "((all-of-it))".to_owned(), P::NotUnderstood, "(unrecognised-value content))"),
        ("CANCEL", "((done))".to_owned(), P::NotUnderstood, "(unexpected-act cancel))"),
    ]) {
        assert_eq!(line.ask(&says(&jade, &bottega, act, &content, number)), TAKEN);
        let heard = jade.hear().message;
        let said = is(&heard, answer);
        assert!(said.ends_with(end), "{content}: {said}");
    }
    // An unknown language, and an unknown ontology.
    for (from, to, answer) in [
        ("fipa-sl0", "KIF", "((unsupported-value language))"),
        ("FIPA-Agent-Management", "weather", "(unsupported-value ontology))"),
    ] {
        line.ask(&jade.says_else(9, &bottega, |text| text.replace(from, to)));
        let heard = jade.hear().message;
        assert!(is(&heard, P::NotUnderstood).ends_with(answer), "{heard:?}");
    }
    // An answer is not answered.
    for act in ["NOT-UNDERSTOOD", "FAILURE", "INFORM", "REFUSE", "AGREE"] {
        line.ask(&says(&jade, &bottega, act, "((what))", 99));
    }
    assert!(jade.hears_nothing());
}

#[test]
fn an_entry_of_a_megabyte_is_entered_and_found() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    let mut line = Line::to(&bottega);
    let large = "é".repeat(500_000);
    let register = format!(
        "((action DF (register (df-agent-description :name (agent-identifier :name probe@jade) :scope (set {large})))))"
    );
    assert_eq!(line.ask(&says(&jade, &bottega, "REQUEST", &register, 1)), TAKEN);
    is(&jade.hear().message, P::Inform);
    let search = "((action DF (search (df-agent-description) (search-constraints :max-results -1))))";
    assert_eq!(line.ask(&says(&jade, &bottega, "REQUEST", search, 2)), TAKEN);
    assert!(is(&jade.hear().message, P::Inform).contains(&large));
}

#[test]
fn what_is_no_message_is_turned_away_at_the_door() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    let good = jade.says(1, &bottega);
    let cut = |text: &str| jade.says_else(1, &bottega, |body| body.replace(text, ""));
    let put = |from: &str, to: &str| jade.says_else(1, &bottega, |body| body.replace(from, to));
    let xxe = "<?xml version=\"1.0\"?><!DOCTYPE envelope [<!ENTITY x SYSTEM \"file:///etc/passwd\">]>";
    for (text, status) in [
        (good.replace("/acc HTTP", "/other HTTP"), "404"),
        (good.replace("POST ", "PUT "), "405"),
        (good.replace("Content-Length: 1", "Content-Length: 999999"), "413"),
        (good.replace("Content-Length", "X-Length"), "411"),
        (good.replace("boundary=\"46", "boundary=\"47"), "400"),
        (good.replace("multipart/mixed", "text/plain"), "400"),
        (cut("</envelope>"), "400"),
        (cut("<acl-representation>fipa.acl.rep.string.std</acl-representation>"), "400"),
        (put("string.std</acl", "bitefficient.std</acl"), "400"),
        (put("<date>20261121Z022548103", "<date>2026-11-21T02:00:00Z"), "400"),
        (put("<?xml version=\"1.0\"?>", xxe), "400"),
        (put("(REQUEST", "(ORDER"), "400"),
        (put(":content", ":content :content"), "400"),
        (put(" :conversation-id", ") :conversation-id"), "400"),
    ] {
        assert_ne!(text, good);
        let answer = Line::to(&bottega).ask(&text);
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{status}: {answer}\n{text}");
    }
    // Old platforms write this form, which is accepted.
    let boundary = "boundary=\"46b5fe9d1933f67e3c2d44c03abe5ba\"";
    let folded = good.replace(
        &format!("multipart/mixed ; {boundary}"),
        &format!("multipart-mixed;\r\n {}", boundary.replace('"', "")),
    );
    assert_eq!(Line::to(&bottega).ask(&folded), TAKEN);
    jade.hear();
    assert!(jade.hears_nothing());
}

#[test]
fn nobody_outside_speaks_in_the_name_of_those_within_and_nothing_runs_in_circles() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    let mut line = Line::to(&bottega);
    for name in ["root@bottega", "ams@bottega", "DF@bottega", "anybody@Bottega"] {
        assert_eq!(line.ask(&jade.says_else(1, &bottega, |text| text.replace("probe@jade", name))), TAKEN);
    }
    let stamp = format!(
        "<received><received-by value=\"{}\"/><received-date value=\"20261121Z022548103\"/></received></params>",
        bottega.address()
    );
    line.ask(&jade.says_else(1, &bottega, |text| text.replace("</params>", &stamp)));
    assert!(jade.hears_nothing());
    // The AMS reports an agent that does not exist.
    line.ask(&jade.says_else(1, &bottega, |text| text.replace("ams@bottega", "ghost@bottega")));
    let failed = jade.hear().message;
    let content = is(&failed, P::Failure);
    assert!(content.starts_with("((action (agent-identifier :name probe@jade"), "{content}");
    assert!(content.contains("(MTS-error (agent-identifier :name ghost@bottega"), "{content}");
    assert_eq!(failed.sender.unwrap().name.as_ref(), "ams@bottega");
}

const SUBSCRIBE: &str = "((iota ?x (result (action DF (search (df-agent-description :services (set (service-description :type \
                         rendering))) (search-constraints :max-results -1))) ?x)))";

#[test]
fn it_subscribes_to_the_df_and_is_informed_of_each_change_until_it_cancels() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    let mut line = Line::to(&bottega);
    line.ask(&says(&jade, &bottega, "SUBSCRIBE", SUBSCRIBE, 1));
    // Nothing matches yet, so there is neither a notification nor an agree.
    assert!(jade.hears_nothing());
    let offer = |kind: &str, number| {
        let content = format!(
            "((action DF (register (df-agent-description :name (agent-identifier :name probe@jade) :services (set \
             (service-description :name a :type {kind}))))))"
        );
        says(&jade, &bottega, "REQUEST", &content, number)
    };
    line.ask(&offer("rendering", 2));
    let mut heard = [jade.hear().message, jade.hear().message];
    heard.sort_by_key(|message| message.conversation_id.clone());
    let inform = is(&heard[0], P::Inform);
    assert_eq!(heard[0].conversation_id.as_deref(), Some("conv-probe@jade1"));
    assert!(inform.starts_with("((= (iota ?x (result (action (agent-identifier :name df@bottega)"), "{inform}");
    assert!(
        inform.contains(" ?x)) (sequence (df-agent-description :name (agent-identifier :name probe@jade)"),
        "{inform}"
    );
    // The agent is gone: only its name is left.
    let gone = "((action DF (deregister (df-agent-description :name (agent-identifier :name probe@jade)))))";
    line.ask(&says(&jade, &bottega, "REQUEST", gone, 3));
    let mut heard = [jade.hear().message, jade.hear().message];
    heard.sort_by_key(|message| message.conversation_id.clone());
    let inform = is(&heard[0], P::Inform);
    assert!(
        inform.ends_with("(sequence (df-agent-description :name (agent-identifier :name probe@jade)))))"),
        "{inform}"
    );
    line.ask(&says(&jade, &bottega, "CANCEL", SUBSCRIBE, 1));
    let done = jade.hear().message;
    assert_eq!(done.conversation_id.as_deref(), Some("conv-probe@jade1"));
    assert!(is(&done, P::Inform).starts_with("((done (iota"));
    line.ask(&offer("rendering", 4));
    assert_eq!(jade.hear().message.conversation_id.as_deref(), Some("conv-probe@jade4"));
    assert!(jade.hears_nothing());
}

/// Our platform asks; JADE answers with recorded messages.
fn answer_of(number: u32, to: &str, content: ManagementContent) -> (P, PlainContent) {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    let to = jade.agent(to);
    thread::scope(|scope| {
        let bottega = &bottega;
        scope.spawn(move || {
            let heard = jade.hear().message;
            let (reply_with, conversation) = (heard.reply_with.unwrap(), heard.conversation_id.unwrap());
            let answer = jade.says_else(number, bottega, |text| {
                let word = |text: String, key: &str, value: &str| {
                    let begin = text.find(key).unwrap() + key.len();
                    let end = begin + text[begin..].find(' ').unwrap();
                    format!("{}{value}{}", &text[..begin], &text[end..])
                };
                word(word(text, ":in-reply-to  ", &reply_with), ":conversation-id  ", &conversation)
            });
            assert_eq!(Line::to(bottega).ask(&answer), TAKEN);
        });
        let from = AgentId::new("tester@bottega");
        bottega.ask(&from, &to, content, support::WAIT).unwrap().expect("an answer")
    })
}

#[test]
fn we_ask_its_services_and_read_its_answers() {
    let template = AmsAgentDescription::default();
    let all = SearchConstraints { max_results: Some(-1), ..Default::default() };
    let service = ServiceDescription {
        name: Some("cornell".into()),
        service_type: Some("rendering".into()),
        ..Default::default()
    };
    let offer = DfAgentDescription {
        name: Some(AgentId::new("tester@bottega")),
        services: vec![service],
        ..Default::default()
    };
    let done = |number, to, function| match answer_of(number, to, ManagementContent::Action(function)) {
        (P::Inform, PlainContent::Management(ManagementContent::Done(_, outcome))) => outcome,
        other => panic!("{number}: {other:?}"),
    };
    assert!(matches!(done(21, "ams", Function::GetDescription), Outcome::Platform(platform)
        if platform.name == "jade" && platform.services[0].addresses.len() == 1));
    let Outcome::Agents(agents) = done(22, "ams", Function::SearchAgents(template, all.clone())) else { panic!() };
    let names: Vec<&str> = agents.iter().map(|agent| &*agent.name.as_ref().unwrap().name).collect();
    assert_eq!(names, ["df@jade", "echo@jade", "ams@jade"]);
    assert!(matches!(done(23, "df", Function::Register(offer.clone())), Outcome::Entered(_)));
    let Outcome::Offers(offers) = done(24, "df", Function::Search(offer.clone(), all)) else { panic!() };
    assert_eq!(offers[0].services[0].properties[0].value, bottega_agents::sl::Term::Bare("1.5".into()));
    for (number, function, act) in [
        (25, Function::Register(offer.clone()), P::Failure),
        (26, Function::Deregister(offer.clone()), P::Failure),
        (27, Function::Register(offer.clone()), P::Refuse),
        (28, Function::Register(offer), P::NotUnderstood),
    ] {
        let (said, PlainContent::Management(content)) = answer_of(number, "df", ManagementContent::Action(function))
        else {
            panic!("{number}")
        };
        assert_eq!(said, act);
        let fits = match number {
            25 => matches!(content, ManagementContent::Failed(_, FailureReason::AlreadyRegistered)),
            26 => matches!(content, ManagementContent::Failed(_, FailureReason::NotRegistered)),
            27 => {
                matches!(content, ManagementContent::Refused(_, RefuseReason::MissingParameter(_, name)) if name == "name")
            }
            _ => matches!(content, ManagementContent::NotUnderstood(_)),
        };
        assert!(fits, "{number}");
    }
    // Its AMS reports that no agent has that name.
    let (act, content) = answer_of(30, "ghost", ManagementContent::Action(Function::GetDescription));
    assert_eq!(act, P::Failure);
    assert!(matches!(content, PlainContent::Management(ManagementContent::Undelivered { receiver, .. })
        if receiver.name.as_ref() == "ghost@jade"));
}
