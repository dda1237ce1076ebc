//! Two directories over one store, with many faults: an entry is made once, and in the end both know it.

use std::{collections::BTreeSet, time::Duration};

use bottega_agents::{
    AclMessage, Action, ActionOf, AgentId, Event, EventOf, Faults, Performative as P, Random, Simulator, StateMachine,
    Time,
    platform::{
        Df, DfAgentDescription, DfConfig, FailureReason, Function, ManagementContent as M, SearchConstraints, Service,
    },
    wire::Calendar,
};

const CLIENTS: usize = 4;
const ROUNDS: u32 = 4;

fn directory(number: usize) -> AgentId {
    AgentId::new(format!("df{number}@p"))
}

/// A client that registers with both directories at once, deregisters, and so on; in the end it stays registered.
struct Client {
    me: AgentId,
    round: u32,
    leaving: bool,
    /// The replicas that confirmed an entry in this round. Answers may arrive twice.
    entered: BTreeSet<AgentId>,
    known: bool,
    until: Time,
    wait: Duration,
}

impl Client {
    fn ask(&self, directory_number: usize, actions: &mut Vec<ActionOf<Self>>) {
        let offer = DfAgentDescription { name: Some(self.me.clone()), ..Default::default() };
        let function = if self.leaving { Function::Deregister(offer) } else { Function::Register(offer) };
        let message = AclMessage::new(P::Request, self.me.clone(), directory(directory_number), M::Action(function));
        // The same request to both counts as one that was taken twice.
        let conversation_id = self.conversation() + 1 + directory_number as u64;
        actions.push(Action::Send(AclMessage { conversation_id, reply_with: conversation_id, ..message }));
    }

    /// The last request before those of this round.
    fn conversation(&self) -> u64 {
        u64::from(self.round) * 4 + u64::from(self.leaving) * 2
    }

    fn begin(&mut self, now: Time, actions: &mut Vec<ActionOf<Self>>) {
        self.until = now + self.wait;
        self.ask(0, actions);
        self.ask(1, actions);
    }

    /// Returns true if no message of this round is under way.
    fn go_on(&mut self, now: Time, actions: &mut Vec<ActionOf<Self>>) {
        if self.known {
            self.known = false;
            if self.leaving {
                self.round += 1;
                self.entered.clear();
            } else if self.round == ROUNDS {
                self.known = true;
                self.until = now + Duration::from_secs(1 << 30);
                return;
            }
            self.leaving = !self.leaving;
        }
        self.begin(now, actions);
    }
}

impl StateMachine for Client {
    type Content = M;
    type Value = String;
    type Effect = ();
    type Completion = ();

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Start => self.begin(now, actions),
            Event::Message(message) => {
                let of_now = self.conversation() + 1..=self.conversation() + 2;
                match &message.content {
                    // A directory that lost the store's answer does not know; others do.
                    M::Failed(_, FailureReason::InternalError(_)) => {}
                    M::Done(..) | M::Failed(..) if of_now.contains(&message.conversation_id) => {
                        self.known = true;
                        if matches!(message.content, M::Done(..)) && !self.leaving {
                            self.entered.insert(message.sender.clone());
                            assert!(self.entered.len() <= 1, "{} was entered twice in round {}", self.me, self.round);
                        }
                    }
                    M::Done(..) | M::Failed(..) => {}
                    other => panic!("{other:?}"),
                }
            }
            Event::Deadline if self.until <= now => self.go_on(now, actions),
            _ => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        Some(self.until)
    }
}

enum Any {
    Df(Box<Service<Df, M, String, (), ()>>),
    Client(Client),
}

impl StateMachine for Any {
    type Content = M;
    type Value = String;
    type Effect = ();
    type Completion = ();

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match self {
            Self::Df(df) => df.handle(now, event, actions),
            Self::Client(client) => client.handle(now, event, actions),
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        match self {
            Self::Df(df) => df.next_deadline(),
            Self::Client(client) => client.next_deadline(),
        }
    }
}

fn faults(seed: u64) -> Faults {
    let seconds = Duration::from_secs;
    Faults {
        latency_min: Duration::from_millis(1),
        latency_extra_mean: Duration::from_millis(5 * (seed % 4)),
        store_latency: Duration::ZERO,
        loss: 0.15 * (seed % 3) as f64,
        duplication: 0.05 * (seed % 2) as f64,
        crash_every: (!seed.is_multiple_of(5)).then_some(seconds(20)),
        down_max: seconds(10),
        partition_every: (seed % 7 > 1).then_some(seconds(15)),
        partition_max: seconds(60),
        until: Time::since_start(seconds(100 + seed % 400)),
    }
}

fn run(seed: u64) {
    let mut world =
        Simulator::new(seed, faults(seed), |_: Time, _: &AgentId, (): (), _: &mut Random, _: &mut Vec<_>| {});
    for number in 0..2 {
        let id = directory(number);
        let config = DfConfig {
            id: id.clone(),
            calendar: Calendar::default(),
            lease_max: None,
            administrators: Vec::new(),
            federates: Vec::new(),
            salt: number as u64,
        };
        world.add(&id.clone(), true, move || Any::Df(Box::new(Service::new(id.clone(), Df::new(config.clone())))));
    }
    for number in 0..CLIENTS {
        let me = AgentId::new(format!("client{number}@p"));
        world.add(&me.clone(), false, move || {
            let (me, until, wait) = (me.clone(), Time::ZERO, Duration::from_secs(25));
            Any::Client(Client { me, round: 0, leaving: false, entered: BTreeSet::new(), known: false, until, wait })
        });
    }
    world.run_until(Time::since_start(Duration::from_secs(1200)));
    let all = Function::Search(
        DfAgentDescription::default(),
        SearchConstraints { max_results: Some(-1), ..Default::default() },
    );
    for number in 0..CLIENTS {
        let me = AgentId::new(format!("client{number}@p"));
        let Some(Any::Client(client)) = world.machine(&me) else { panic!("{me} is gone") };
        assert_eq!((client.round, client.known), (ROUNDS, true), "{me}, seed {seed}");
    }
    let live = world.store().with_prefix(&"df/agent/".into()).filter(|entry| !entry.value.is_empty()).count();
    assert_eq!(live, CLIENTS, "seed {seed}");
    for number in 0..2 {
        let Some(Any::Df(df)) = world.machine(&directory(number)) else { panic!("a directory is gone") };
        assert!(df.is_ready(), "seed {seed}");
        let request = AclMessage::new(P::Request, AgentId::new("x@p"), directory(number), M::Action(all.clone()));
        let mut copy = df.functions().clone();
        let mut todo = bottega_agents::platform::ServiceOutbox::default();
        let step = bottega_agents::platform::Functions::perform(&mut copy, world.now(), &request, &all, &mut todo);
        let Ok(bottega_agents::platform::Step::Done(bottega_agents::platform::Outcome::Offers(offers))) = step else {
            panic!("{step:?}")
        };
        assert_eq!(offers.len(), CLIENTS, "directory {number}, seed {seed}");
    }
}

#[test]
fn in_a_thousand_bad_worlds_every_agent_is_entered_once_and_both_directories_know_it() {
    for seed in 0..1000 {
        run(seed);
    }
}
