//! Several of our platforms: federation, replicas, the life cycle, and messages that strangers may send to agents.
#![allow(clippy::disallowed_methods, reason = "what goes over real sockets takes real time")]

use std::{
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use crate::nodes::support::{self, Jade, Line, TAKEN, WAIT, config, is, node, node_over, start};
use bottega_agents::{
    Action, ActionOf, AgentId, Event, EventOf, Performative as P, StateMachine, Time,
    driver::node::Node,
    entry_store::{EntryStore, SharedStore},
    file_store::FileStore,
    gateway::{ChannelEffect, ChannelReport, FirstForms, PlainContent},
    platform::{
        AmsAgentDescription, DfAgentDescription, Function, LifeCycleState, ManagementContent as M, Outcome,
        SearchConstraints, ServiceDescription,
    },
    wire::{DateTime, Form, WireMessage},
};

fn id(name: &str) -> AgentId {
    AgentId::new(name)
}

fn ask(node: &Node, from: &str, to: &AgentId, function: Function) -> (P, M) {
    let answer = node.ask(&id(from), to, M::Action(function), WAIT).unwrap();
    match answer {
        Some((act, PlainContent::Management(content))) => (act, content),
        other => panic!("{other:?}"),
    }
}

fn done(node: &Node, from: &str, to: &AgentId, function: Function) -> Outcome {
    match ask(node, from, to, function) {
        (P::Inform, M::Done(_, outcome)) => outcome,
        other => panic!("{other:?}"),
    }
}

fn offer(name: &str) -> DfAgentDescription {
    let service =
        ServiceDescription { name: Some("a".into()), service_type: Some("rendering".into()), ..Default::default() };
    DfAgentDescription { name: Some(id(name)), services: vec![service], ..Default::default() }
}

fn template() -> DfAgentDescription {
    let service = ServiceDescription { service_type: Some("rendering".into()), ..Default::default() };
    DfAgentDescription { services: vec![service], ..Default::default() }
}

/// The names of rendering agents, as a directory knows them.
fn renderers(node: &Node, asker: &str, depth: i64) -> Vec<String> {
    let constraints = SearchConstraints { max_results: Some(-1), max_depth: Some(depth), search_id: None };
    match done(node, asker, node.df(), Function::Search(template(), constraints)) {
        Outcome::Offers(offers) => offers.into_iter().map(|offer| offer.name.unwrap().name.to_string()).collect(),
        other => panic!("{other:?}"),
    }
}

/// Repeats a request, each time in another name, until the condition holds.
fn until(what: &str, mut so: impl FnMut(u32) -> bool) {
    let begun = Instant::now();
    for number in 0.. {
        if so(number) {
            return;
        }
        assert!(begun.elapsed() < WAIT, "{what}");
        thread::sleep(Duration::from_millis(30));
    }
}

#[test]
fn directories_search_together_and_not_in_circles() {
    let b = node("b");
    let mut of_a = config("a", Box::new(bottega_agents::store::MemoryStore::default()));
    of_a.federates = vec![b.df().clone()];
    let a = start(of_a);
    // Across platforms: an agent of A offers something at B.
    assert!(matches!(done(&a, "guest@a", b.df(), Function::Register(offer("guest@a"))), Outcome::Entered(_)));
    done(&a, "painter@a", a.df(), Function::Register(offer("painter@a")));
    done(&b, "painter@b", b.df(), Function::Register(offer("painter@b")));
    assert_eq!(renderers(&a, "x0@a", 0), ["painter@a"]);
    assert_eq!(renderers(&a, "x1@a", 1), ["painter@a", "guest@a", "painter@b"]);
    // A has registered itself with B, so B asks it, too. Without a limit each asks the other once.
    until("B knows A", |number| renderers(&b, &format!("y{number}@b"), 1).len() == 3);
    let begun = Instant::now();
    assert_eq!(renderers(&b, "z@b", -1).len(), 3);
    assert!(begun.elapsed() < Duration::from_secs(2));
    // Local entries are for the platform's own agents.
    let local = DfAgentDescription { scope: vec!["local".into()], ..offer("shy@b") };
    done(&b, "shy@b", b.df(), Function::Register(local));
    assert_eq!(renderers(&b, "w@b", 0).len(), 3);
    assert_eq!(renderers(&a, "w@a", 1), ["painter@a", "guest@a", "painter@b"]);
    // An unreachable platform does not delay the answer.
    drop(b);
    let begun = Instant::now();
    assert_eq!(renderers(&a, "x2@a", 3), ["painter@a"]);
    assert!(begun.elapsed() < Duration::from_secs(4));
}

#[test]
fn what_is_said_first_is_in_the_form_that_was_set_or_that_the_other_has_shown() {
    let jade = Jade::start();
    let mut config = config("a", Box::new(bottega_agents::store::MemoryStore::default()));
    let by_platform = std::collections::BTreeMap::from([("old".to_owned(), Form::String)]);
    config.first_forms = FirstForms { default: Form::Xml, by_platform };
    let a = start(config);
    let form_to = |from: &str, name: &str| {
        let to = AgentId { name: name.into(), addresses: vec![jade.address()].into() };
        a.say(&id(from), &to, M::Action(Function::GetDescription));
        Form::of_name(&jade.hear().envelope.acl_representation)
    };
    assert_eq!([form_to("x@a", "ams@old"), form_to("x@a", "ams@jade")], [Some(Form::String), Some(Form::Xml)]);
    // JADE asks in the string form, and gets this form from then on.
    assert_eq!(Line::to(&a).ask(&jade.says_else(1, &a, |text| text.replace("@bottega", "@a"))), TAKEN);
    jade.hear();
    assert_eq!(form_to("x@a", "ams@jade"), Some(Form::String));
}

#[test]
fn a_directory_that_ends_is_taken_out_of_others_unless_another_process_needs_it_there() {
    let b = node("b");
    let folder = tempfile::tempdir().unwrap();
    let federated = || {
        let store = FileStore::<String, usize>::open(&folder.path().join("state")).unwrap();
        let mut config = config("a", Box::new(store));
        // A missing platform does not delay the end.
        let nowhere =
            AgentId { name: "df@nowhere".into(), addresses: vec!["http://127.0.0.1:9/acc".to_owned()].into() };
        config.federates = vec![b.df().clone(), nowhere];
        start(config)
    };
    let directories = |name: &str| {
        let service = ServiceDescription { service_type: Some("fipa-df".into()), ..Default::default() };
        let template = DfAgentDescription { services: vec![service], ..Default::default() };
        match done(&b, name, b.df(), Function::Search(template, SearchConstraints::default())) {
            Outcome::Offers(offers) => offers,
            other => panic!("{other:?}"),
        }
    };
    let (one, two) = (federated(), federated());
    until("B knows A", |number| directories(&format!("x{number}@b")).len() == 1);
    // The entry of a killed process does not stay for ever.
    assert!(directories("lease@b")[0].lease_time.is_some());
    until("they know each other", |number| {
        match done(&one, &format!("x{number}@a"), one.ams(), Function::GetDescription) {
            Outcome::Platform(platform) => platform.services[0].addresses.len() == 2,
            other => panic!("{other:?}"),
        }
    });
    one.stop();
    assert_eq!(directories("first@b").len(), 1, "the other process is reached by it");
    let begun = Instant::now();
    two.stop();
    assert!(begun.elapsed() < Duration::from_secs(6));
    assert_eq!(directories("second@b").len(), 0);
    // Nor do the entries of the processes that removed it.
    let three = node_over("a", Box::new(FileStore::<String, usize>::open(&folder.path().join("state")).unwrap()));
    let all = SearchConstraints { max_results: Some(-1), ..Default::default() };
    match done(&three, "look@a", three.ams(), Function::SearchAgents(Default::default(), all)) {
        Outcome::Agents(agents) => {
            let named = |agent: &AmsAgentDescription| agent.name.as_ref().unwrap().to_string();
            assert!(!agents.iter().any(|agent| named(agent).starts_with("leaving")), "{agents:?}");
        }
        other => panic!("{other:?}"),
    }
}

fn two_over(stores: [Box<dyn EntryStore<String, usize> + Send>; 3]) {
    let [first, second, third] = stores;
    let (one, two) = (node_over("p", first), node_over("p", second));
    done(&one, "a@p", one.df(), Function::Register(offer("a@p")));
    until("the second knows what was registered at the first", |number| {
        renderers(&two, &format!("x{number}@p"), 0) == ["a@p"]
    });
    let platform = || match done(&two, "y@p", two.ams(), Function::GetDescription) {
        Outcome::Platform(platform) => platform.services[0].addresses.clone(),
        other => panic!("{other:?}"),
    };
    let mut both = [one.address().to_owned(), two.address().to_owned()];
    both.sort();
    assert_eq!(platform(), both);
    // A name is given only once, by any process of the platform.
    let again = ask(&two, "a@p", two.df(), Function::Register(offer("a@p")));
    assert!(matches!(again, (P::Failure, M::Failed(..))), "{again:?}");
    drop(one);
    done(&two, "b@p", two.df(), Function::Register(offer("b@p")));
    assert_eq!(renderers(&two, "z@p", 0), ["a@p", "b@p"]);
    let three = node_over("p", third);
    until("the third knows all", |number| renderers(&three, &format!("w{number}@p"), 0) == ["a@p", "b@p"]);
    done(&three, "a@p", three.df(), Function::Deregister(offer("a@p")));
    until("the second knows that it is gone", |number| renderers(&two, &format!("v{number}@p"), 0) == ["b@p"]);
}

#[test]
fn of_two_processes_over_one_file_either_may_die() {
    let folder = tempfile::tempdir().unwrap();
    let store = || -> Box<dyn EntryStore<String, usize> + Send> {
        Box::new(FileStore::<String, usize>::open(&folder.path().join("state")).unwrap())
    };
    two_over([store(), store(), store()]);
}

#[test]
fn of_two_over_one_store_in_memory_either_may_die() {
    let shared = SharedStore::default();
    two_over([Box::new(shared.member()), Box::new(shared.member()), Box::new(shared.member())]);
}

#[test]
fn a_subscriber_is_informed_once_by_a_live_process() {
    let shared = SharedStore::default();
    let (one, two) = (node_over("bottega", Box::new(shared.member())), node_over("bottega", Box::new(shared.member())));
    let jade = Jade::start();
    let subscribe = jade.says_else(9, &one, |text| {
        let begin = text.find("((action ( agent-identifier :name df@bottega").unwrap();
        let end = text.find("\" \n :reply-with").unwrap();
        let action = text[begin + 1..end - 1].to_owned();
        format!("{}((iota ?x (result {action} ?x))){}", &text[..begin], &text[end..]).replace("(REQUEST", "(SUBSCRIBE")
    });
    Line::to(&one).ask(&subscribe);
    assert!(jade.hears_nothing());
    done(&two, "a@bottega", two.df(), Function::Register(offer("a@bottega")));
    assert!(is(&jade.hear().message, P::Inform).contains(":name a@bottega"));
    assert!(jade.hears_nothing());
    drop(one);
    done(&two, "b@bottega", two.df(), Function::Register(offer("b@bottega")));
    let heard = jade.hear().message;
    assert!(is(&heard, P::Inform).contains(":name b@bottega"));
    assert_eq!(heard.conversation_id.as_deref(), Some("conv-probe@jade1795227948166-2"));
    assert!(jade.hears_nothing());
}

/// Repeats each message to strangers.
struct Echo(AgentId);

impl StateMachine for Echo {
    type Content = PlainContent;
    type Value = String;
    type Effect = ChannelEffect;
    type Completion = ChannelReport;

    fn handle(&mut self, _: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        let Event::Message(message) = event else { return };
        let PlainContent::Foreign(heard) = &message.content else { return };
        let said = WireMessage { content: heard.content.clone(), ..WireMessage::new(P::Inform) };
        let said = PlainContent::Foreign(Arc::new(said));
        actions.push(Action::Send(message.reply(P::Inform, self.0.clone(), said)));
    }

    fn next_deadline(&self) -> Option<Time> {
        None
    }
}

#[test]
fn an_agent_hears_strangers_and_a_suspended_one_takes_no_work() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    let echo = id("echo@bottega");
    bottega.add(&echo, Echo(echo.clone())).unwrap();
    let mut line = Line::to(&bottega);
    let mut say = |text: &str| {
        let message = jade.says_else(1, &bottega, |body| {
            let begin = body.find(":content  \"").unwrap() + 11;
            let end = body.find("\" \n :reply-with").unwrap();
            format!("{}{text}{}", &body[..begin], &body[end..])
                .replace("ams@bottega", "echo@bottega")
                .replace("fipa-agent-management", "weather")
                .replace("fipa-sl0", "plain-text")
        });
        assert_eq!(line.ask(&message), support::TAKEN);
    };
    say("(no SL at all");
    let heard = jade.hear().message;
    assert_eq!(is(&heard, P::Inform), "(no SL at all");
    assert_eq!((heard.ontology.as_deref(), heard.language.as_deref()), (Some("weather"), Some("plain-text")));
    assert_eq!(heard.in_reply_to.as_deref(), Some("rw-probe-1795227948100-1"));

    let root = "root@bottega";
    let state = |state| AmsAgentDescription { name: Some(echo.clone()), ownership: None, state: Some(state) };
    let change = |state_wanted| Function::ModifyAgent(state(state_wanted));
    // Only agents with the right: the platform's own.
    let (act, _) = ask(&bottega, "other@bottega", bottega.ams(), change(LifeCycleState::Suspended));
    assert_eq!(act, P::Refuse);
    done(&bottega, root, bottega.ams(), change(LifeCycleState::Suspended));
    say("while it sleeps");
    assert!(jade.hears_nothing());
    let found = done(
        &bottega,
        "s@bottega",
        bottega.ams(),
        Function::SearchAgents(state(LifeCycleState::Suspended), SearchConstraints::default()),
    );
    assert!(matches!(found, Outcome::Agents(agents) if agents.len() == 1));
    command(&bottega, change(LifeCycleState::Active));
    assert_eq!(is(&jade.hear().message, P::Inform), "while it sleeps");

    let end = || Function::TerminateAgent { agent: echo.clone(), graceful: false };
    let (act, _) = ask(&bottega, "u@bottega", bottega.ams(), end());
    assert_eq!(act, P::Refuse, "only the platform destroys");
    command(&bottega, end());
    until("it is gone", |number| {
        let template = AmsAgentDescription { name: Some(echo.clone()), ..Default::default() };
        let search = Function::SearchAgents(template, SearchConstraints::default());
        let found = done(&bottega, &format!("v{number}@bottega"), bottega.ams(), search);
        matches!(found, Outcome::Agents(agents) if agents.is_empty())
    });
    let (act, _) = ask(&bottega, "w@bottega", &echo, Function::GetDescription);
    assert_eq!(act, P::Failure);
    say("after its end");
    assert!(is(&jade.hear().message, P::Failure).contains("(MTS-error (agent-identifier :name echo@bottega"));
}

/// Sends a request in the name of the administrator, which exists once per process, so it is sent as a message.
fn command(node: &Node, function: Function) {
    node.say(&id("root@bottega"), node.ams(), M::Action(function));
}

#[test]
fn a_message_takes_the_next_address_and_in_the_end_its_sender_is_informed() {
    let (jade, bottega) = (Jade::start(), node("bottega"));
    // A port that was free a moment ago.
    let dead = {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        format!("http://{}/acc", listener.local_addr().unwrap())
    };
    let to = AgentId { name: "ams@jade".into(), addresses: vec![dead.clone(), jade.address()].into() };
    let wait = Duration::from_millis(500);
    let nothing = bottega.ask(&id("a@bottega"), &to, M::Action(Function::GetDescription), wait).unwrap();
    assert!(nothing.is_none());
    assert!(is(&jade.hear().message, P::Request).contains("(get-description)"));
    for (number, addresses) in [vec![dead], vec!["iiop://x".to_owned()], Vec::new()].into_iter().enumerate() {
        let to = AgentId { name: "ams@jade".into(), addresses: addresses.into() };
        let (act, content) = ask(&bottega, &format!("b{number}@bottega"), &to, Function::GetDescription);
        assert_eq!(act, P::Failure);
        assert!(matches!(content, M::Undelivered { receiver, .. } if receiver == to));
    }
}

#[test]
fn a_lease_ends_and_all_that_lasts_survives_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let store = || Box::new(FileStore::<String, usize>::open(&folder.path().join("state")).unwrap());
    let bottega = node_over("p", store());
    done(&bottega, "long@p", bottega.df(), Function::Register(offer("long@p")));
    let jade = Jade::start();
    let short = DateTime::parse("+00000000T000001500").unwrap();
    let register = jade.says_else(5, &bottega, |text| {
        text.replace("df@bottega", "df@p").replace(":protocols (set fipa-contract-net) :languages (set fipa-sl0) :ontologies (set bottega-rendering) :services", &format!(":lease-time {short} :services"))
    });
    Line::to(&bottega).ask(&register);
    let heard = jade.hear().message;
    let content = is(&heard, P::Inform);
    assert!(content.contains(":lease-time +00000000T000001500"), "granted as requested: {content}");
    assert_eq!(renderers(&bottega, "x@p", 0), ["long@p", "probe@jade"]);
    drop(bottega);
    let bottega = node_over("p", store());
    assert_eq!(renderers(&bottega, "x@p", 0), ["long@p", "probe@jade"]);
    until("the lease ends", |number| renderers(&bottega, &format!("y{number}@p"), 0) == ["long@p"]);
}

#[test]
fn the_service_root_names_the_basic_services_and_takes_more() {
    let bottega = node("bottega");
    let entry = bottega_agents::platform::ServiceEntry {
        id: "images".into(),
        service_type: "storage".into(),
        addresses: vec!["http://here/".into()],
    };
    let start = bottega.start_service().clone();
    done(&bottega, "a@bottega", &start, Function::SupplyBasicService(entry.clone()));
    let other = node("other");
    // A request from outside.
    match done(&other, "b@other", &start, Function::GetServiceRoot) {
        Outcome::ServiceRoot(entries) => {
            let types: Vec<&str> = entries.iter().map(|entry| entry.service_type.as_str()).collect();
            assert_eq!(types, ["fipa-mts", "fipa-ams", "fipa-df", "bottega-start-service", "storage"]);
            assert_eq!(entries.last(), Some(&entry));
        }
        unexpected => panic!("{unexpected:?}"),
    }
}
