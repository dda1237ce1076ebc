//! The platform's services, by messages as agents send them.

mod desk;
mod faults;

use std::time::Duration;

use bottega_agents::{
    AclMessage, ActionOf, AgentId, Event, EventOf, Faults, Performative, Random, Simulator, StateMachine, StoreRequest,
    Ticket, Time,
    platform::{
        Ams, AmsAgentDescription, AmsConfig, DESCRIPTION_BYTES_MAX, Df, DfAgentDescription, DfConfig, FailureReason,
        Function, LifeCycleRequest, LifeCycleState, ManagementContent as M, NotUnderstoodReason, Outcome, RefuseReason,
        SearchConstraints, Service, ServiceDescription, ServiceEntry, StandardAgent, StartService,
    },
    wire::Calendar,
};
use desk::{Desk, Vocabulary, failure, id, outcome, refusal, say};

fn agent(name: &str, state: Option<LifeCycleState>) -> AmsAgentDescription {
    AmsAgentDescription { name: Some(id(name)), ownership: None, state }
}

fn pages() -> Ams {
    pages_at(Vec::new())
}

fn pages_at(addresses: Vec<String>) -> Ams {
    Ams::new(AmsConfig {
        id: id("ams@here"),
        platform: "here".into(),
        services: vec![id("ams@here")],
        administrators: vec![id("root@here")],
        addresses,
        enters_residents: false,
        unlisted: Vec::new(),
    })
}

#[test]
fn it_knows_its_own_address_before_that_is_entered() {
    assert!(pages().platform().services.is_empty());
    let address = "http://127.0.0.1:7778/acc".to_owned();
    assert_eq!(pages_at(vec![address.clone()]).platform().services[0].addresses, [address]);
}

fn ams() -> Desk<Ams> {
    Desk::new("ams@here", pages())
}

fn offers(lease_max: Option<Duration>) -> Df {
    Df::new(DfConfig {
        id: id("df@here"),
        calendar: Calendar::default(),
        lease_max,
        administrators: Vec::new(),
        federates: Vec::new(),
        salt: 1,
    })
}

#[test]
fn white_pages_enter_find_change_and_forget_agents() {
    let mut ams = ams();
    let now = Time::ZERO;
    for name in ["a", "b", "c"] {
        assert_eq!(outcome(&mut ams, now, name, Function::RegisterAgent(agent(name, None))), Outcome::Done);
    }
    assert_eq!(failure(&mut ams, "a", Function::RegisterAgent(agent("a", None))), FailureReason::AlreadyRegistered);
    assert_eq!(refusal(&mut ams, "a", Function::RegisterAgent(agent("d", None))), RefuseReason::Unauthorised);
    assert_eq!(
        refusal(&mut ams, "a", Function::RegisterAgent(AmsAgentDescription::default())),
        RefuseReason::MissingParameter("ams-agent-description".into(), "name".into())
    );
    let mut found = |max_results| {
        let template = AmsAgentDescription { state: Some(LifeCycleState::Active), ..Default::default() };
        let constraints = SearchConstraints { max_results, ..Default::default() };
        match outcome(&mut ams, now, "x", Function::SearchAgents(template, constraints)) {
            Outcome::Agents(agents) => agents.len(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!([found(None), found(Some(2)), found(Some(-1)), found(Some(0))], [1, 2, 4, 0], "with the AMS itself");
    assert_eq!(outcome(&mut ams, now, "a", Function::DeregisterAgent(agent("a", None))), Outcome::Done);
    assert_eq!(failure(&mut ams, "a", Function::DeregisterAgent(agent("a", None))), FailureReason::NotRegistered);
    assert_eq!(failure(&mut ams, "a", Function::ModifyAgent(agent("a", None))), FailureReason::NotRegistered);
    assert!(matches!(outcome(&mut ams, now, "x", Function::GetDescription), Outcome::Platform(p) if p.name == "here"));
    assert_eq!(
        refusal(&mut ams, "x", Function::GetServiceRoot),
        RefuseReason::UnsupportedFunction("getServiceRoot".into())
    );
}

#[test]
fn transitions_of_life_are_begun_by_whom_the_standard_allows() {
    use LifeCycleState::{Active, Suspended, Transit, Waiting};
    let mut ams = ams();
    outcome(&mut ams, Time::ZERO, "a", Function::RegisterAgent(agent("a", None)));
    let change = |state| Function::ModifyAgent(agent("a", Some(state)));
    // The agent suspends itself, and only the platform resumes it.
    outcome(&mut ams, Time::ZERO, "a", change(Suspended));
    assert_eq!(refusal(&mut ams, "a", change(Active)), RefuseReason::Unauthorised);
    let forbidden = RefuseReason::UnrecognisedParameterValue("ams-agent-description".into(), "state".into());
    assert_eq!(refusal(&mut ams, "root@here", change(Transit)), forbidden);
    // The agent lives in this process, so it is notified.
    ams.handle(Time::ZERO, Event::Presence { agent: id("a"), present: true });
    let sent = say(&mut ams, Time::ZERO, "root@here", Performative::Request, M::Action(change(Active)));
    assert_eq!(sent[0].content, M::LifeCycle(LifeCycleRequest::Resume));
    assert_eq!(sent[0].receivers, [id("a")]);
    assert_eq!(ams.functions().state(&id("a")), Some(Active));
    assert_eq!(refusal(&mut ams, "root@here", change(Waiting)), RefuseReason::Unauthorised);
    outcome(&mut ams, Time::ZERO, "a", change(Waiting));
    // An agent may not request its destruction.
    let end = |graceful| Function::TerminateAgent { agent: id("a"), graceful };
    assert_eq!(refusal(&mut ams, "a", end(false)), RefuseReason::Unauthorised);
    outcome(&mut ams, Time::ZERO, "root@here", end(false));
    assert_eq!(ams.functions().state(&id("a")), None);
}

#[test]
fn what_makes_no_sense_is_not_understood_and_never_twice() {
    let mut ams = ams();
    let mut heard = |performative, content| say(&mut ams, Time::ZERO, "x", performative, content);
    let function = || M::Action(Function::GetDescription);
    let answer = heard(Performative::Propose, function()).remove(0);
    assert_eq!(answer.performative, Performative::NotUnderstood);
    assert_eq!(answer.content, M::NotUnderstood(NotUnderstoodReason::UnsupportedAct(Performative::Propose)));
    let answer = heard(Performative::Request, M::LifeCycle(LifeCycleRequest::Quit)).remove(0);
    assert_eq!(answer.content, M::NotUnderstood(NotUnderstoodReason::UnrecognisedValue("content".into())));
    assert!(heard(Performative::NotUnderstood, function()).is_empty());
    assert!(heard(Performative::Failure, function()).is_empty());
}

fn offer(name: &str, kind: &str) -> DfAgentDescription {
    let service = ServiceDescription {
        name: Some(format!("{name}'s")),
        service_type: Some(kind.into()),
        languages: vec!["x".into(), "y".into()],
        ..Default::default()
    };
    DfAgentDescription { name: Some(id(name)), services: vec![service], ..Default::default() }
}

#[test]
fn yellow_pages_match_templates_and_leases_end() {
    let at = |seconds| Time::since_start(Duration::from_secs(seconds));
    let mut df = Desk::new("df@here", offers(Some(Duration::from_secs(60))));
    for (name, lease) in [("a", Some(at(10))), ("b", None), ("c", Some(at(999)))] {
        let description =
            DfAgentDescription { lease_time: lease, ..offer(name, if name == "b" { "cook" } else { "smith" }) };
        let granted = outcome(&mut df, at(0), name, Function::Register(description));
        let Outcome::Entered(granted) = granted else { panic!("{granted:?}") };
        assert_eq!(granted.lease_time, Some(if name == "a" { at(10) } else { at(60) }));
    }
    let find = |df: &mut Desk<Df>, now, kind: Option<&str>, language: &str| {
        let service = ServiceDescription {
            service_type: kind.map(str::to_owned),
            languages: vec![language.into()],
            ..Default::default()
        };
        let template = DfAgentDescription { services: vec![service], ..Default::default() };
        let all = SearchConstraints { max_results: Some(-1), ..Default::default() };
        match outcome(df, now, "x", Function::Search(template, all)) {
            Outcome::Offers(found) => {
                found.iter().map(|offer| offer.name.as_ref().unwrap().to_string()).collect::<String>()
            }
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(find(&mut df, at(9), Some("smith"), "y"), "ac");
    assert_eq!(find(&mut df, at(9), Some("smith"), "z"), "");
    assert_eq!(find(&mut df, at(9), None, "x"), "abc");
    assert_eq!(df.next_deadline(), Some(at(10)));
    assert_eq!(find(&mut df, at(10), None, "x"), "bc");
    // Only the agent itself renews its lease, by `modify`.
    outcome(&mut df, at(50), "c", Function::Modify(offer("c", "smith")));
    assert_eq!(find(&mut df, at(61), None, "x"), "c");
    assert_eq!(refusal(&mut df, "b", Function::Modify(offer("c", "smith"))), RefuseReason::Unauthorised);
    let nameless = DfAgentDescription { services: vec![ServiceDescription::default()], ..offer("q", "x") };
    assert_eq!(
        refusal(&mut df, "q", Function::Register(nameless)),
        RefuseReason::MissingParameter("service-description".into(), "name".into())
    );
    df.handle(at(200), Event::Deadline);
    // It checks once more that the entry is gone.
    df.handle(at(202), Event::Deadline);
    assert_eq!(df.next_deadline(), None);
}

#[test]
fn what_is_too_large_for_an_entry_is_refused_by_the_parameter_that_is() {
    let bad = |object: &'static str, parameter: &'static str| {
        RefuseReason::UnrecognisedParameterValue(object.into(), parameter.into())
    };
    let mut df = Desk::new("df@here", offers(None));
    let large = |bytes| large_of("a", bytes);
    let refused = bad("df-agent-description", "scope");
    assert_eq!(refusal(&mut df, "a", Function::Register(large(DESCRIPTION_BYTES_MAX))), refused);
    outcome(&mut df, Time::ZERO, "a", Function::Register(large(1_000_000)));
    assert_eq!(refusal(&mut df, "a", Function::Modify(large(DESCRIPTION_BYTES_MAX))), refused);
    let service = ServiceDescription { ownership: Some("y".repeat(DESCRIPTION_BYTES_MAX)), ..Default::default() };
    let service = ServiceDescription { name: Some("n".into()), service_type: Some("t".into()), ..service };
    let offered = DfAgentDescription { services: vec![service], ..offer("b", "smith") };
    assert_eq!(refusal(&mut df, "b", Function::Register(offered)), bad("df-agent-description", "services"));
    // A search returns only as much as fits into a message.
    outcome(&mut df, Time::ZERO, "b", Function::Register(large_of("b", 600_000)));
    outcome(&mut df, Time::ZERO, "c", Function::Register(offer("c", "smith")));
    let all = SearchConstraints { max_results: Some(-1), ..Default::default() };
    let found = outcome(&mut df, Time::ZERO, "x", Function::Search(DfAgentDescription::default(), all));
    let Outcome::Offers(found) = found else { panic!("{found:?}") };
    let names: Vec<String> = found.iter().map(|offer| offer.name.as_ref().unwrap().to_string()).collect();
    assert_eq!(names, ["a", "c"]);

    let mut ams = ams();
    let owned = AmsAgentDescription { ownership: Some("x".repeat(1 << 16)), ..agent("a", None) };
    assert_eq!(refusal(&mut ams, "a", Function::RegisterAgent(owned)), bad("ams-agent-description", "ownership"));
    let mut start = Desk::new("start", StartService::new(Vec::new()));
    let entry = ServiceEntry { id: "i".into(), service_type: "t".into(), addresses: vec!["x".repeat(1 << 16)] };
    let refused = bad("service-directory-entry", "service-locator");
    assert_eq!(refusal(&mut start, "x", Function::SupplyBasicService(entry)), refused);
}

fn large_of(name: &str, bytes: usize) -> DfAgentDescription {
    DfAgentDescription { scope: vec!["x".repeat(bytes)], ..offer(name, "smith") }
}

#[test]
fn the_start_service_knows_every_basic_service_once() {
    let entry = |id: &str| ServiceEntry { id: id.into(), service_type: "t".into(), addresses: vec!["a".into()] };
    let mut start = Desk::new("start", StartService::new(vec![entry("ams")]));
    outcome(&mut start, Time::ZERO, "x", Function::SupplyBasicService(entry("df")));
    assert_eq!(failure(&mut start, "x", Function::SupplyBasicService(entry("ams"))), FailureReason::AlreadyRegistered);
    let nowhere = ServiceEntry { addresses: Vec::new(), ..entry("q") };
    assert!(matches!(
        refusal(&mut start, "x", Function::SupplyBasicService(nowhere)),
        RefuseReason::MissingParameter(_, parameter) if parameter == "service-locator"
    ));
    let root = outcome(&mut start, Time::ZERO, "x", Function::GetServiceRoot);
    assert_eq!(root, Outcome::ServiceRoot(vec![entry("ams"), entry("df")]));
}

/// An agent that counts seconds and the messages that it gets.
struct Clock {
    ticks: u32,
    messages: u32,
    next: Time,
}

impl StateMachine for Clock {
    type Content = M;
    type Value = String;
    type Effect = ();
    type Completion = ();

    fn handle(&mut self, now: Time, event: EventOf<Self>, _: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Message(_) => self.messages += 1,
            Event::Deadline if self.next <= now => {
                self.ticks += 1;
                self.next = now + Duration::from_secs(1);
            }
            Event::Start => self.next = now + Duration::from_secs(1),
            _ => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        Some(self.next)
    }
}

enum Any {
    Ams(Box<Vocabulary<Ams>>),
    Clock(StandardAgent<Clock>),
}

impl StateMachine for Any {
    type Content = M;
    type Value = String;
    type Effect = ();
    type Completion = ();

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match self {
            Self::Ams(ams) => ams.handle(now, event, actions),
            Self::Clock(clock) => clock.handle(now, event, actions),
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        match self {
            Self::Ams(ams) => ams.next_deadline(),
            Self::Clock(clock) => clock.next_deadline(),
        }
    }
}

#[test]
fn a_suspended_agent_keeps_its_messages_and_goes_on_when_resumed() {
    use bottega_agents::Bus;
    let mut world = Simulator::new(1, Faults::NONE, |_: Time, _: &AgentId, (): (), _: &mut Random, _: &mut Vec<_>| {});
    world.add(&id("ams@here"), false, || Any::Ams(Box::new(Service::new(id("ams@here"), pages()))));
    world.add(&id("clock"), false, || {
        let clock = Clock { ticks: 0, messages: 0, next: Time::ZERO };
        Any::Clock(StandardAgent::new(id("clock"), id("ams@here"), clock))
    });
    let at = |millis| Time::since_start(Duration::from_millis(millis));
    let request = |from: &str, to: &str, content| AclMessage::new(Performative::Request, id(from), id(to), content);
    let modify = |state| M::Action(Function::ModifyAgent(agent("clock", Some(state))));
    let enter = M::Action(Function::RegisterAgent(agent("clock", None)));
    world.bus().publish(request("root@here", "ams@here", enter));
    world.run_until(at(3500));
    world.bus().publish(request("root@here", "ams@here", modify(LifeCycleState::Suspended)));
    // Only the AMS can stop an agent.
    world.bus().publish(request("rogue", "clock", M::LifeCycle(LifeCycleRequest::Destroy)));
    world.run_until(at(9000));
    world.bus().publish(request("x", "clock", M::Action(Function::GetDescription)));
    world.run_until(at(10500));
    let look = |world: &Simulator<Any, _>| match world.machine(&id("clock")) {
        Some(Any::Clock(clock)) => Some((clock.is_suspended(), clock.machine().ticks, clock.machine().messages)),
        _ => None,
    };
    assert_eq!(look(&world), Some((true, 3, 0)));
    world.bus().publish(request("root@here", "ams@here", modify(LifeCycleState::Active)));
    world.run_until(at(11000));
    // The deadline that passed meanwhile fires at once, and the kept message is delivered.
    assert_eq!(look(&world), Some((false, 4, 1)));
    let end = M::Action(Function::TerminateAgent { agent: id("clock"), graceful: true });
    world.bus().publish(request("root@here", "ams@here", end));
    world.run_until(at(12000));
    assert_eq!(look(&world), None);
}

#[test]
fn a_directory_that_has_not_heard_of_the_last_writes_does_not_answer_from_memory() {
    let mut df = Desk::new("df@here", offers(None));
    outcome(&mut df, Time::ZERO, "a", Function::Register(offer("a", "smith")));
    let key = bottega_agents::Key::from("df/agent/a");
    let text = df.store.get(&key).unwrap().value.clone();
    // Another process writes, and the change has not arrived yet.
    let write = |df: &mut Desk<Df>, value: String| {
        let request = StoreRequest::Put { key: key.clone(), value };
        df.store.handle((), Ticket(u64::MAX), request, &mut Vec::new());
    };
    write(&mut df, String::new());
    outcome(&mut df, Time::ZERO, "a", Function::Register(offer("a", "smith")));
    outcome(&mut df, Time::ZERO, "a", Function::Deregister(offer("a", "smith")));
    write(&mut df, text);
    outcome(&mut df, Time::ZERO, "a", Function::Deregister(offer("a", "smith")));
    assert_eq!(failure(&mut df, "a", Function::Deregister(offer("a", "smith"))), FailureReason::NotRegistered);
}
