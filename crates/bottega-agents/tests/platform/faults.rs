//! Faults that simulations once found.

use std::time::Duration;

use bottega_agents::{
    AclMessage, AgentId, Event, Performative, StoreRequest, Ticket, Time,
    platform::{
        Ams, AmsAgentDescription, AmsConfig, Df, DfAgentDescription, FailureReason, Function, LifeCycleState,
        ManagementContent as M, Outcome, SearchConstraints, ServiceEntry, StartService,
    },
    store::MemoryStore,
};

use super::{
    desk::{Desk, ask, failure, id, outcome, say},
    offer, offers,
};

fn at(seconds: u64) -> Time {
    Time::since_start(Duration::from_secs(seconds))
}

/// An AMS that enters the agents of its process, at an address.
fn ams() -> Desk<Ams> {
    Desk::new(
        "ams@here",
        Ams::new(AmsConfig {
            id: id("ams@here"),
            platform: "here".into(),
            services: vec![id("ams@here")],
            administrators: vec![id("root@here")],
            addresses: vec!["http://here/acc".into()],
            enters_residents: true,
            unlisted: Vec::new(),
        }),
    )
}

/// The same request once more, as another process may take it.
fn again<F: bottega_agents::platform::Functions>(desk: &mut Desk<F>, from: &str, function: Function) -> M {
    desk.conversation -= 1;
    ask(desk, Time::ZERO, from, function).1
}

#[test]
fn a_registration_that_is_taken_twice_is_answered_twice_alike() {
    let mut df = Desk::new("df@here", offers(None));
    let register = || Function::Register(offer("a", "smith"));
    outcome(&mut df, Time::ZERO, "a", register());
    assert!(matches!(again(&mut df, "a", register()), M::Done(_, Outcome::Entered(_))));
    // Another offer in the same conversation is another request, and so is the same one in another.
    let other = Function::Register(offer("a", "cook"));
    assert!(matches!(again(&mut df, "a", other), M::Failed(_, FailureReason::AlreadyRegistered)));
    assert_eq!(failure(&mut df, "a", register()), FailureReason::AlreadyRegistered);

    let mut ams = ams();
    let entry = || AmsAgentDescription { name: Some(id("a")), ..Default::default() };
    outcome(&mut ams, Time::ZERO, "a", Function::RegisterAgent(entry()));
    assert!(matches!(again(&mut ams, "a", Function::RegisterAgent(entry())), M::Done(..)));
    assert_eq!(failure(&mut ams, "a", Function::RegisterAgent(entry())), FailureReason::AlreadyRegistered);

    let mut start = Desk::new("start", StartService::new(Vec::new()));
    let entry = ServiceEntry { id: "s".into(), service_type: "t".into(), addresses: vec!["a".into()] };
    let supply = || Function::SupplyBasicService(entry.clone());
    outcome(&mut start, Time::ZERO, "a", supply());
    assert!(matches!(again(&mut start, "a", supply()), M::Done(..)));
    assert_eq!(failure(&mut start, "a", supply()), FailureReason::AlreadyRegistered);
}

#[test]
fn a_request_outside_of_conversations_is_a_new_one_each_time() {
    let mut df = Desk::new("df@here", offers(None));
    for expected in [true, false] {
        let content = M::Action(Function::Register(offer("a", "smith")));
        let message = AclMessage::new(Performative::Request, id("a"), id("df@here"), content);
        let answer = df.handle(Time::ZERO, Event::Message(message)).remove(0);
        assert_eq!(matches!(answer.content, M::Done(..)), expected, "{answer:?}");
    }
}

/// The entry of an agent in the white pages.
fn found(ams: &mut Desk<Ams>, now: Time, name: &str) -> Option<AmsAgentDescription> {
    let template = AmsAgentDescription { name: Some(id(name)), ..Default::default() };
    match outcome(ams, now, "x", Function::SearchAgents(template, SearchConstraints::default())) {
        Outcome::Agents(mut agents) => agents.pop(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_an_ams_writes_by_itself_it_writes_until_the_store_has_it() {
    let mut ams = ams();
    ams.deaf = 2;
    ams.handle(at(0), Event::Presence { agent: id("a@here"), present: true });
    assert_eq!(found(&mut ams, at(1), "a@here"), None);
    for second in [11, 14, 25, 28] {
        ams.handle(at(second), Event::Deadline);
    }
    assert!(found(&mut ams, at(30), "a@here").is_some(), "two writes were lost, the third was not");
    // The same for agents that are gone, or were ended by the platform.
    ams.deaf = 1;
    ams.handle(at(40), Event::Presence { agent: id("a@here"), present: false });
    assert!(found(&mut ams, at(41), "a@here").is_some());
    for second in [51, 54] {
        ams.handle(at(second), Event::Deadline);
    }
    assert_eq!(found(&mut ams, at(55), "a@here"), None);
    assert_eq!(ams.next_deadline(), None, "and then it rests");
}

#[test]
fn who_changes_an_entry_and_names_no_addresses_leaves_them_as_they_are() {
    let mut ams = ams();
    ams.handle(at(0), Event::Presence { agent: id("a@here"), present: true });
    let suspended =
        AmsAgentDescription { name: Some(id("a@here")), ownership: None, state: Some(LifeCycleState::Suspended) };
    outcome(&mut ams, at(1), "root@here", Function::ModifyAgent(suspended));
    let entry = found(&mut ams, at(2), "a@here").unwrap();
    assert_eq!(entry.state, Some(LifeCycleState::Suspended));
    assert_eq!(&*entry.name.unwrap().addresses, ["http://here/acc"]);
}

/// The updates for a subscriber in these messages: whether each agent is there.
fn updates_of(messages: &[AclMessage<M>]) -> Vec<(String, bool)> {
    let offer_lists = messages.iter().filter_map(|message| match &message.content {
        M::Updates(_, _, offers) => Some(offers),
        _ => None,
    });
    let name = |offer: &DfAgentDescription| offer.name.as_ref().map(ToString::to_string).unwrap_or_default();
    offer_lists.flatten().map(|offer| (name(offer), !offer.services.is_empty())).collect()
}

fn subscribe(df: &mut Desk<Df>, now: Time) -> Vec<AclMessage<M>> {
    let all = SearchConstraints { max_results: Some(-1), ..Default::default() };
    say(df, now, "s", Performative::Subscribe, M::Subscription(DfAgentDescription::default(), all))
}

fn there(name: &str) -> (String, bool) {
    (name.to_owned(), true)
}

#[test]
fn a_directory_that_starts_again_tells_what_was_not_sure_and_what_is_gone() {
    let mut df = Desk::new("df@here", offers(None));
    outcome(&mut df, at(0), "a", Function::Register(offer("a", "smith")));
    assert_eq!(updates_of(&subscribe(&mut df, at(0))), [there("a")]);
    let unsure = df.store.clone();
    df.handle(at(31), Event::Deadline);
    let sure = df.store.clone();
    let started =
        |store: &MemoryStore<String, ()>| updates_of(&Desk::over("df@here", offers(None), store.clone()).first);
    // A service that died at once does not know whether its write arrived.
    assert_eq!(started(&unsure), [there("a")]);
    assert_eq!(started(&sure), []);
    // While it was dead the offer was removed.
    let mut store = sure;
    let gone = StoreRequest::Put { key: "df/agent/a".into(), value: String::new() };
    store.handle((), Ticket(9), gone, &mut Vec::new());
    assert_eq!(started(&store), [("a".to_owned(), false)]);
}

#[test]
fn updates_that_did_not_arrive_are_repeated_until_the_subscriber_is_forgotten() {
    let mut df = Desk::new("df@here", offers(None));
    outcome(&mut df, at(0), "a", Function::Register(offer("a", "smith")));
    let mut said = subscribe(&mut df, at(0));
    let lost = |said: &[AclMessage<M>], subscriber: &AgentId| {
        let content = M::Undelivered { receiver: subscriber.clone(), reason: "no connection".into() };
        let inform = said.iter().find(|message| matches!(message.content, M::Updates(..))).expect("an update");
        Event::Message(inform.reply(Performative::Failure, id("ams@here"), content))
    };
    let is_over = |said: &[AclMessage<M>]| said.iter().any(|message| message.performative == Performative::Failure);
    let mut tries = 0;
    for second in (1..).step_by(6) {
        assert_eq!(updates_of(&said), [there("a")]);
        said = df.handle(at(second), lost(&said, &id("s")));
        if is_over(&said) {
            break;
        }
        assert!(said.is_empty(), "not at once: {said:?}");
        said = df.handle(at(second + 5), Event::Deadline);
        tries += 1;
        assert!(tries < 20, "for ever");
    }
    assert!(tries > 8, "{tries}");
    let entry = Function::Register(offer("b", "smith"));
    let message = AclMessage::new(Performative::Request, id("b"), id("df@here"), M::Action(entry));
    assert!(updates_of(&df.handle(at(200), Event::Message(message))).is_empty(), "nobody is informed any more");
}
