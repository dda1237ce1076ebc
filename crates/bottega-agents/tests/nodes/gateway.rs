//! The border of a platform while its store is slow, or loses requests.

use std::time::Duration;

use bottega_agents::{
    AclMessage, Action, ActionOf, AgentId, Event, EventOf, Key, Performative, Revision, StateMachine, StoreReply,
    StoreRequest, Ticket, Time,
    acc::Letter,
    gateway::{ChannelEffect, ChannelReport, FirstForms, Gateway, GatewayConfig, PlainContent},
    platform::{Function, ManagementContent, ONTOLOGY, Outcome, PlatformDescription},
    wire::{Calendar, Envelope, STRING_FORM, WireMessage, print_string},
};

type Border = Gateway<PlainContent, String>;

fn at(seconds: u64) -> Time {
    Time::since_start(Duration::from_secs(seconds))
}

fn stranger() -> AgentId {
    AgentId { name: "s@there".into(), addresses: vec!["http://there/acc".to_owned()].into() }
}

/// The gateway of a platform with a directory, after it has requested its pages.
fn border() -> Border {
    let df = AgentId::new("df@here");
    let mut gateway = Border::new(GatewayConfig {
        id: AgentId::new("acc@here"),
        platform: "here".to_owned(),
        addresses: vec!["http://here/acc".to_owned()],
        calendar: Calendar::default(),
        services: vec![df.clone()],
        administrators: Vec::new(),
        salt: 1,
        first_forms: FirstForms::default(),
    });
    after(&mut gateway, 0, Event::Start);
    after(&mut gateway, 0, Event::Presence { agent: df, present: true });
    gateway
}

fn after(gateway: &mut Border, second: u64, event: EventOf<Border>) -> Vec<ActionOf<Border>> {
    let mut actions = Vec::new();
    gateway.handle(at(second), event, &mut actions);
    actions
}

fn caught_up(gateway: &mut Border, second: u64) -> Vec<ActionOf<Border>> {
    let say = |ticket| Event::Store { ticket: Ticket(ticket), reply: StoreReply::CaughtUp };
    let first = after(gateway, second, say(0));
    assert!(first.is_empty(), "half of the pages: {first:?}");
    after(gateway, second, say(1))
}

fn sent(actions: &[ActionOf<Border>]) -> usize {
    actions.iter().filter(|action| matches!(action, Action::Effect(ChannelEffect::Send(_)))).count()
}

/// The threads that are being written, with their tickets.
fn written(actions: &[ActionOf<Border>]) -> Vec<(Ticket, Key)> {
    let write = |action: &ActionOf<Border>| match action {
        Action::Store { ticket, request: StoreRequest::Put { key, .. } } => Some((*ticket, key.clone())),
        _ => None,
    };
    actions.iter().filter_map(write).collect()
}

#[test]
fn nothing_passes_before_the_pages_are_known_and_then_all_that_waited() {
    let mut gateway = border();
    let function = Function::GetDescription;
    let outcome = Outcome::Platform(PlatformDescription { name: "here".into(), services: Vec::new() });
    let content = PlainContent::Management(ManagementContent::Done(function, outcome));
    let message = AclMessage::new(Performative::Inform, AgentId::new("df@here"), stranger(), content);
    assert_eq!(sent(&after(&mut gateway, 1, Event::Message(message.clone()))), 0);
    assert_eq!(sent(&caught_up(&mut gateway, 2)), 1);
    assert_eq!(sent(&after(&mut gateway, 3, Event::Message(message))), 1);
    // A request without an answer is repeated.
    let mut gateway = border();
    assert_eq!(gateway.next_deadline(), Some(at(10)));
    let actions = after(&mut gateway, 10, Event::Deadline);
    let is_watch =
        |action: &ActionOf<Border>| matches!(action, Action::Store { request: StoreRequest::Watch { .. }, .. });
    assert_eq!(actions.iter().filter(|action| is_watch(action)).count(), 2);
}

#[test]
fn the_thread_of_a_subscription_is_written_until_the_store_has_it() {
    let mut gateway = border();
    caught_up(&mut gateway, 1);
    let df = AgentId::new("df@here");
    let wish = "((iota ?x (result (action (agent-identifier :name df@here) (search (df-agent-description) \
                (search-constraints :max-results -1))) ?x)))";
    let message = WireMessage {
        sender: Some(stranger()),
        receivers: vec![df.clone()],
        content: Some(wish.to_owned()),
        language: Some("fipa-sl".to_owned()),
        ontology: Some(ONTOLOGY.to_owned()),
        conversation_id: Some("c".to_owned()),
        ..WireMessage::new(Performative::Subscribe)
    };
    let envelope = Envelope { to: vec![df], acl_representation: STRING_FORM.to_owned(), ..Envelope::default() };
    let letter = Letter::open(envelope, print_string(&message).unwrap().as_bytes()).unwrap();
    let first = written(&after(&mut gateway, 1, Event::Completed(ChannelReport::Arrived(Box::new(letter)))));
    let [(ticket, key)] = &first[..] else { panic!("{first:?}") };
    assert_eq!(gateway.next_deadline(), Some(at(3)));
    let again = written(&after(&mut gateway, 3, Event::Deadline));
    assert!(matches!(&again[..], [(other, same)] if other != ticket && same == key), "{again:?}");
    // The store has got one of them.
    let confirmed = StoreReply::Written { key: key.clone(), revision: Revision(1) };
    after(&mut gateway, 3, Event::Store { ticket: again[0].0, reply: confirmed });
    assert_eq!(gateway.next_deadline(), None);
}
