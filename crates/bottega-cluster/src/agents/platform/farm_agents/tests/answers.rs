//! Answers of a machine to agents of other platforms.

use super::*;

/// Returns a machine's answer to a request with this language, ontology and content.
fn said_to_a_request(language: Option<&str>, ontology: Option<&str>, content: Option<&str>) -> (P, String) {
    let mut agent = render_agent(machine(PresenceState::Active, PresenceState::Active));
    let text = |text: Option<&str>| text.map(str::to_owned);
    let wire = WireMessage {
        content: text(content),
        language: text(language),
        ontology: text(ontology),
        ..WireMessage::new(P::Request)
    };
    let mut message = says("boss@jade", "m-1@b", P::Request, "");
    message.content = PlainContent::Foreign(Arc::new(wire));
    let output = after(&mut agent, millis(1), Event::Message(message));
    assert!(output.effects.is_empty(), "{output:?}");
    let [(_, act, said)] = &output.messages[..] else { panic!("one answer: {output:?}") };
    (*act, said.clone())
}

#[test]
fn what_a_stranger_gets_wrong_is_answered_by_what_is_wrong() {
    let describe = request_content(&id("m-1@b"), "(describe-machine)");
    let (describe, ours) = (Some(&*describe), Some(ONTOLOGY));
    for (language, ontology) in [(Some("fipa-sl0"), ours), (Some("FIPA-SL"), Some("Bottega-Farm")), (None, None)] {
        assert_eq!(said_to_a_request(language, ontology, describe).0, P::Inform, "{language:?} {ontology:?}");
    }
    for (language, ontology, content, why) in [
        (Some("kif"), ours, describe, "((unsupported-value language))"),
        (Some("fipa-sl0"), Some("fipa-meeting"), describe, "((unsupported-value ontology))"),
        (Some("fipa-sl0"), ours, None, "((unrecognised-value content))"),
        (Some("fipa-sl0"), ours, Some(""), "((unrecognised-value content))"),
        (Some("fipa-sl0"), ours, Some("((a) (b))"), "((unrecognised-value content))"),
    ] {
        let said = said_to_a_request(language, ontology, content);
        assert_eq!(said, (P::NotUnderstood, why.to_owned()), "{language:?} {ontology:?} {content:?}");
    }
}

#[test]
fn a_machine_tells_what_it_paints_and_how_far_that_is() {
    let mut agent = render_agent(machine(PresenceState::Active, PresenceState::Active));
    let paints = |done| {
        let view = machine(PresenceState::Active, PresenceState::Active);
        Event::Completed(MachineReport::Seen(view, Some(Box::new(job(3, "active", done)))))
    };
    for done in [0.25, 0.5] {
        let output = after(&mut agent, millis(1), paints(done));
        assert!(output.requests.is_empty(), "progress does not change the directories: {output:?}");
        let output = after(&mut agent, millis(2), to_machine("probe@jade", "(describe-machine)"));
        let part = format!(
            ":job 3 :version \"{}\" :paints (job :number 3 :state active :done {done} ",
            crate::build::build().identity()
        );
        assert!(output.messages[0].2.contains(&part), "{output:?}");
    }
}
