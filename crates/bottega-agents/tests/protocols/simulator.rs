//! The simulator itself: one seed, one run; faults happen; what must arrive arrives.

use std::time::Duration;

use bottega_agents::{
    AclMessage, Action, ActionOf, AgentId, Event, EventOf, Faults, Performative, Revision, Simulator, StateMachine,
    StoreReply, StoreRequest, Ticket, Time,
};
use expect_test::expect;

/// Counts an entry of the store up to `goal`, and notifies another agent of each step.
struct Counter {
    id: AgentId,
    friend: AgentId,
    goal: u32,
    heard: u32,
    retry: Option<Time>,
    ticket: u64,
}

impl Counter {
    fn read(&mut self, now: Time, actions: &mut Vec<ActionOf<Self>>) {
        self.ticket += 1;
        self.retry = Some(now + Duration::from_secs(5));
        actions.push(Action::Store { ticket: Ticket(self.ticket), request: StoreRequest::Get { key: "count".into() } });
    }
}

impl StateMachine for Counter {
    type Content = u32;
    type Value = u32;
    type Effect = Duration;
    type Completion = ();

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Start => actions.push(Action::Effect(Duration::from_millis(3))),
            Event::Completed(()) | Event::Deadline => self.read(now, actions),
            Event::Store { ticket, reply } if ticket == Ticket(self.ticket) => match reply {
                StoreReply::Got { key, entry } => {
                    let (value, expected_revision) = entry.map_or((0, Revision::ABSENT), |e| (e.value, e.revision));
                    if value < self.goal {
                        let request = StoreRequest::CompareAndSet { key, expected_revision, value: value + 1 };
                        self.ticket += 1;
                        actions.push(Action::Store { ticket: Ticket(self.ticket), request });
                    } else {
                        self.retry = None;
                    }
                }
                StoreReply::Written { .. } => {
                    actions.push(Action::Send(AclMessage::new(
                        Performative::Inform,
                        self.id.clone(),
                        self.friend.clone(),
                        1,
                    )));
                    self.read(now, actions);
                }
                _ => self.read(now, actions),
            },
            Event::Message(message) => self.heard += message.content,
            Event::Store { .. } | Event::Presence { .. } => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.retry
    }
}

type World = fn(Time, &AgentId, Duration, &mut bottega_agents::Random, &mut Vec<(Duration, ())>);

fn run(seed: u64, faults: Faults, goal: u32) -> Simulator<Counter, World> {
    let world: World = |_, _, takes, _, reports| reports.push((takes, ()));
    let mut simulator = Simulator::new(seed, faults, world);
    simulator.record_trace();
    let (a, b) = (AgentId::new("a"), AgentId::new("b"));
    for (id, friend) in [(a.clone(), b.clone()), (b, a)] {
        simulator.add(&id.clone(), true, move || Counter {
            id: id.clone(),
            friend: friend.clone(),
            goal,
            heard: 0,
            retry: None,
            ticket: 0,
        });
    }
    simulator.run_until(Time::since_start(Duration::from_secs(600)));
    simulator
}

fn everything_wrong() -> Faults {
    Faults {
        latency_min: Duration::from_micros(200),
        latency_extra_mean: Duration::from_millis(5),
        store_latency: Duration::ZERO,
        loss: 0.1,
        duplication: 0.1,
        crash_every: Some(Duration::from_secs(10)),
        down_max: Duration::from_secs(10),
        partition_every: Some(Duration::from_secs(10)),
        partition_max: Duration::from_secs(10),
        until: Time::since_start(Duration::from_secs(300)),
    }
}

#[test]
fn without_faults_the_trace_is_what_it_is() {
    let simulator = run(1, Faults::NONE, 2);
    expect![[r#"
        [     0.000] a starts
        [     0.000] b starts
        [     8.000] a -> b  inform #0
        [    12.000] a -> b  inform #0"#]]
    .assert_eq(&simulator.trace());
}

#[test]
fn the_same_seed_gives_the_same_run_and_another_seed_another() {
    let trace = |seed| run(seed, everything_wrong(), 200).trace();
    let first = trace(7);
    for word in ["crashes", "cut off", "healed", "lost"] {
        assert!(first.contains(word), "no `{word}` in the trace");
    }
    assert_eq!(first, trace(7));
    assert_ne!(first, trace(8));
}

#[test]
fn compare_and_set_counts_right_whatever_goes_wrong() {
    for seed in 0..50 {
        let simulator = run(seed, everything_wrong(), 100);
        let entry = simulator.store().get(&"count".into()).unwrap();
        assert_eq!((entry.value, entry.revision), (100, Revision(100)), "seed {seed}");
    }
}

#[test]
fn ten_thousand_agents_are_no_burden() {
    let world: World = |_, _, takes, _, reports| reports.push((takes, ()));
    let mut simulator = Simulator::new(1, Faults { until: Time::ZERO, ..everything_wrong() }, world);
    for number in 0..10_000 {
        let id = AgentId::new(format!("a{number}"));
        let friend = AgentId::new(format!("a{}", (number + 1) % 10_000));
        simulator.add(&id.clone(), false, move || Counter {
            id: id.clone(),
            friend: friend.clone(),
            goal: 3,
            heard: 0,
            retry: None,
            ticket: 0,
        });
    }
    simulator.run_until(Time::since_start(Duration::from_secs(60)));
    assert_eq!(simulator.store().get(&"count".into()).unwrap().value, 3);
}

/// Records who is present, takes its turn in a queue, and asks others to count in it.
struct Watcher {
    id: AgentId,
    seen: Vec<(String, bool)>,
    jobs: u32,
}

impl StateMachine for Watcher {
    type Content = u32;
    type Value = u32;
    type Effect = ();
    type Completion = ();

    fn handle(&mut self, _: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Start => {
                actions.extend([Action::WatchPresence, Action::JoinQueue("jobs".into())]);
                let message = AclMessage::new(Performative::Request, self.id.clone(), self.id.clone(), 1);
                actions.extend([0; 4].map(|_| Action::Enqueue { queue: "jobs".into(), message: message.clone() }));
            }
            Event::Presence { agent, present } => self.seen.push((agent.to_string(), present)),
            Event::Message(message) => self.jobs += message.content,
            _ => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        None
    }
}

#[test]
fn who_crashes_or_is_cut_off_is_missed_after_a_while_and_welcomed_back() {
    type Silence = fn(Time, &AgentId, (), &mut bottega_agents::Random, &mut Vec<(Duration, ())>);
    let mut simulator: Simulator<Watcher, Silence> = Simulator::new(1, Faults::NONE, |_, _, (), _, _| {});
    let ids = ["a", "b"].map(AgentId::new);
    for id in ids.clone() {
        simulator.add(&id.clone(), false, move || Watcher { id: id.clone(), seen: Vec::new(), jobs: 0 });
    }
    let [a, b] = ids;
    let at = |seconds| Time::since_start(Duration::from_secs(seconds));
    simulator.run_until(at(1));
    // Four from a while it was alone, and four of b's for both in turn.
    assert_eq!([&a, &b].map(|id| simulator.machine(id).unwrap().jobs), [6, 2]);
    simulator.crash(&b);
    simulator.run_until(at(3));
    let seen = |simulator: &Simulator<Watcher, Silence>| {
        let seen = &simulator.machine(&a).unwrap().seen;
        seen.iter().map(|(who, present)| format!("{who}{}", if *present { '+' } else { '-' })).collect::<String>()
    };
    assert_eq!(seen(&simulator), "b+");
    simulator.run_until(at(5));
    assert_eq!(seen(&simulator), "b+b-");
    simulator.start(&b);
    simulator.run_until(at(6));
    assert_eq!(seen(&simulator), "b+b-b+");
    simulator.cut_off([b.clone()]);
    simulator.run_until(at(20));
    simulator.heal();
    simulator.run_until(at(21));
    assert_eq!(seen(&simulator), "b+b-b+b-b+");
}
