//! Two managers award tasks by contract net to contractors, while messages are lost, doubled and late, agents crash
//! and the network is cut. The store is the judge: an award is a compare-and-set, and a result must carry its revision.

use std::{cell::RefCell, collections::BTreeMap, rc::Rc, time::Duration};

use bottega_agents::{
    AclMessage, Action, ActionOf, AgentId, Event, EventOf, Faults, Key, Performative, Random, Revision, Simulator,
    StateMachine, StoreReply, StoreRequest, Ticket, Time,
    protocol::{Call, ContractNetInitiator, ContractNetResponder, Conversation, InitiatorEvent, ResponderEvent},
};
use expect_test::expect;

const TASKS: u32 = 12;
const CONTRACTORS: usize = 6;
const LEASE: Duration = Duration::from_secs(8);

#[derive(Clone, Debug, PartialEq)]
enum Say {
    Task(u32),
    Bid(u32),
    Award { task: u32, token: Revision },
    Nothing,
}

/// An entry `task/N`.
#[derive(Clone, Debug, PartialEq)]
enum TaskState {
    Open,
    Awarded { to: AgentId, lease_until: Time },
    Done { by: AgentId },
}

/// "Work at this task"; reported when it is done.
type Effect = u32;

fn key(task: u32) -> Key {
    format!("task/{task:02}").into()
}

fn task_of(key: &Key) -> u32 {
    key.to_string()["task/".len()..].parse().unwrap()
}

type Actions = Vec<Action<Say, TaskState, Effect>>;

fn send_all(messages: Vec<AclMessage<Say>>, actions: &mut Actions) {
    actions.extend(messages.into_iter().map(Action::Send));
}

/// A manager that awards open tasks, and tasks of contractors whose lease is over.
struct Manager {
    id: AgentId,
    contractors: Vec<AgentId>,
    tasks: BTreeMap<u32, (TaskState, Revision)>,
    /// The auction, its task, and the revision of the task at the call, on which the award depends.
    auction: Option<(ContractNetInitiator<Say>, u32, Revision)>,
    /// The agent that gets the task of the auction once the store has confirmed.
    winner: Option<AgentId>,
    tick: Time,
}

impl Manager {
    fn call(&mut self, now: Time, actions: &mut Actions) {
        self.tick = now + Duration::from_millis(700);
        if self.auction.is_some() {
            return;
        }
        let open = self.tasks.iter().find(|(_, (state, _))| match state {
            TaskState::Open => true,
            TaskState::Awarded { lease_until, .. } => *lease_until <= now,
            TaskState::Done { .. } => false,
        });
        let Some((&task, &(_, revision))) = open else { return };
        let call = Call {
            initiator: self.id.clone(),
            participants: self.contractors.clone(),
            content: Say::Task(task),
            language: "test",
            ontology: "test",
            // Never a ticket of an earlier life.
            conversation_id: u64::try_from(now.elapsed().as_micros()).unwrap(),
            reply_by: now + Duration::from_millis(300),
        };
        let mut send = Vec::new();
        self.auction = Some((ContractNetInitiator::call(call, &mut send), task, revision));
        send_all(send, actions);
    }

    fn learn(&mut self, now: Time, events: impl IntoIterator<Item = InitiatorEvent<Say>>, actions: &mut Actions) {
        for event in events {
            let InitiatorEvent::Collected(proposals) = event else { continue };
            let Some((_, task, revision)) = self.auction else { continue };
            let best = proposals.into_iter().min_by_key(|proposal| match proposal.content {
                Say::Bid(bid) => bid,
                _ => u32::MAX,
            });
            let Some(best) = best else {
                self.auction = None;
                continue;
            };
            self.winner = Some(best.from.clone());
            let request = StoreRequest::CompareAndSet {
                key: key(task),
                expected_revision: revision,
                value: TaskState::Awarded { to: best.from, lease_until: now + LEASE },
            };
            actions.push(Action::Store { ticket: Ticket(1), request });
        }
        self.forget_finished();
    }

    fn forget_finished(&mut self) {
        if self.winner.is_none() && self.auction.as_ref().is_some_and(|(auction, ..)| auction.is_finished()) {
            self.auction = None;
        }
    }

    /// Takes in the store's answer to an award.
    fn award(&mut self, now: Time, token: Option<Revision>, actions: &mut Actions) {
        let (Some(winner), Some((auction, task, _))) = (self.winner.take(), &mut self.auction) else { return };
        let mut send = Vec::new();
        let accepted: Vec<_> = token.map(|token| (winner, Say::Award { task: *task, token })).into_iter().collect();
        auction.award(&accepted, now + LEASE, &mut send);
        send_all(send, actions);
        // One task after the other may be awarded; their state is in the store.
        self.auction = None;
    }
}

impl StateMachine for Manager {
    type Content = Say;
    type Value = TaskState;
    type Effect = Effect;
    type Completion = u32;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Start => {
                actions
                    .push(Action::Store { ticket: Ticket(0), request: StoreRequest::Watch { prefix: "task/".into() } });
                self.tick = now + Duration::from_millis(500);
            }
            Event::Store { reply: StoreReply::Changed(entry), .. } => {
                self.tasks.insert(task_of(&entry.key), (entry.value, entry.revision));
            }
            Event::Store { ticket: Ticket(1), reply } => {
                let token = match reply {
                    StoreReply::Written { revision, .. } => Some(revision),
                    _ => None,
                };
                self.award(now, token, actions);
            }
            Event::Message(message) => {
                let mut send = Vec::new();
                let ours =
                    self.auction.as_mut().filter(|(a, ..)| a.the_call().conversation_id == message.conversation_id);
                match ours.map(|(auction, ..)| auction.handle_message(now, &message, &mut send)) {
                    Some(Ok(event)) => self.learn(now, event, actions),
                    Some(Err(_)) => send.extend(message.not_understood(self.id.clone())),
                    None if message.performative == Performative::Propose => {
                        send.push(message.reply(Performative::RejectProposal, self.id.clone(), Say::Nothing));
                    }
                    None => {}
                }
                send_all(send, actions);
            }
            Event::Deadline => {
                if let Some((auction, ..)) = &mut self.auction
                    && self.winner.is_none()
                {
                    let events = auction.handle_time(now);
                    self.learn(now, events, actions);
                }
                if self.tick <= now {
                    self.call(now, actions);
                }
            }
            Event::Store { .. } | Event::Completed(_) | Event::Presence { .. } => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        let auction = self.auction.as_ref().filter(|_| self.winner.is_none());
        auction.and_then(|(auction, ..)| auction.next_deadline()).into_iter().chain([self.tick]).min()
    }
}

/// A contractor that bids when it is idle.
struct Contractor {
    id: AgentId,
    speed: u32,
    net: ContractNetResponder<Say>,
    job: Option<(Conversation, u32, Revision)>,
}

impl Contractor {
    fn finish(&mut self, actions: &mut Actions) {
        let Some((_, task, token)) = &self.job else { return };
        let request = StoreRequest::CompareAndSet {
            key: key(*task),
            expected_revision: *token,
            value: TaskState::Done { by: self.id.clone() },
        };
        actions.push(Action::Store { ticket: Ticket(u64::from(*task)), request });
    }

    fn report(&mut self, done: bool, send: &mut Vec<AclMessage<Say>>) {
        let Some((conversation, ..)) = self.job.take() else { return };
        if done {
            self.net.done(&conversation, Say::Nothing, send);
        } else {
            self.net.fail(&conversation, Say::Nothing, send);
        }
    }

    fn learn(&mut self, event: ResponderEvent<Say>, send: &mut Vec<AclMessage<Say>>, actions: &mut Actions) {
        match event {
            ResponderEvent::Called(call) => {
                let conversation = (call.sender, call.conversation_id);
                if self.job.is_none() && self.net.proposed_count() == 0 {
                    let until = call.reply_by.unwrap() + Duration::from_secs(3);
                    self.net.propose(&conversation, Say::Bid(self.speed), until, send);
                } else {
                    self.net.refuse(&conversation, Say::Nothing, send);
                }
            }
            ResponderEvent::Accepted(award) => {
                let Say::Award { task, token } = award.content else { panic!("managers are of one mind") };
                assert!(self.job.is_none(), "{} has work already", self.id);
                self.job = Some(((award.sender, award.conversation_id), task, token));
                actions.push(Action::Effect(task));
            }
            ResponderEvent::Rejected(_) | ResponderEvent::Cancelled(_) | ResponderEvent::Expired { .. } => {}
        }
    }
}

impl StateMachine for Contractor {
    type Content = Say;
    type Value = TaskState;
    type Effect = Effect;
    type Completion = u32;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        let mut send = Vec::new();
        match event {
            Event::Message(message) => match self.net.handle_message(now, message.clone(), &mut send) {
                Ok(Some(event)) => self.learn(event, &mut send, actions),
                Ok(None) => {}
                Err(_) => send.extend(message.not_understood(self.id.clone())),
            },
            Event::Deadline => {
                for event in self.net.handle_time(now) {
                    self.learn(event, &mut send, actions);
                }
            }
            Event::Completed(_) => self.finish(actions),
            Event::Store { ticket, reply } if self.job.as_ref().is_some_and(|job| u64::from(job.1) == ticket.0) => {
                match reply {
                    StoreReply::Written { .. } => self.report(true, &mut send),
                    // Our lease ran out; or an earlier attempt of ours, whose answer was lost, succeeded.
                    StoreReply::Conflict { entry, .. } => {
                        let ours = entry.is_some_and(|entry| entry.value == TaskState::Done { by: self.id.clone() });
                        self.report(ours, &mut send);
                    }
                    _ => self.finish(actions),
                }
            }
            Event::Start | Event::Store { .. } | Event::Presence { .. } => {}
        }
        send_all(send, actions);
    }

    fn next_deadline(&self) -> Option<Time> {
        self.net.next_deadline()
    }
}

/// An observer that writes the tasks, and then records their changes.
struct Observer {
    seen: Rc<RefCell<Vec<Step>>>,
}

impl StateMachine for Observer {
    type Content = Say;
    type Value = TaskState;
    type Effect = Effect;
    type Completion = u32;

    fn handle(&mut self, _: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        let create = |task: u32| {
            let request = StoreRequest::CompareAndSet {
                key: key(task),
                expected_revision: Revision::ABSENT,
                value: TaskState::Open,
            };
            Action::Store { ticket: Ticket(u64::from(task) + 1), request }
        };
        match event {
            Event::Start => {
                actions
                    .push(Action::Store { ticket: Ticket(0), request: StoreRequest::Watch { prefix: "task/".into() } });
            }
            // Only now: of writes before its start, a watch reports only the last state.
            Event::Store { reply: StoreReply::CaughtUp, .. } => actions.extend((0..TASKS).map(create)),
            Event::Store { reply: StoreReply::Changed(entry), .. } => {
                self.seen.borrow_mut().push((task_of(&entry.key), entry.revision, entry.value));
            }
            Event::Store { ticket, reply: StoreReply::Unavailable } => {
                actions.push(create(u32::try_from(ticket.0 - 1).unwrap()));
            }
            _ => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        None
    }
}

/// The result of each task, with the write that decided it.
type Step = (u32, Revision, TaskState);
type World = fn(Time, &AgentId, Effect, &mut Random, &mut Vec<(Duration, u32)>);

/// The history of the tasks, and the simulation.
fn run(seed: u64, faults: Faults, trace: bool) -> (Vec<Step>, Simulator<Box<dyn Role>, World>) {
    let work: World = |_, _, task, random, reports| {
        let takes = Duration::from_millis(500).mul_f64(1.0 + 6.0 * random.unit());
        reports.push((takes, task));
    };
    let mut simulator = Simulator::new(seed, faults, work);
    if trace {
        simulator.record_trace();
    }
    let contractors: Vec<_> = (0..CONTRACTORS).map(|n| AgentId::new(format!("c{n}"))).collect();
    let seen = Rc::new(RefCell::new(Vec::new()));
    let writes = Rc::clone(&seen);
    simulator.add(&AgentId::new("observer"), false, move || Box::new(Observer { seen: Rc::clone(&writes) }) as _);
    for name in ["m0", "m1"] {
        let contractors = contractors.clone();
        simulator.add(&AgentId::new(name), true, move || {
            Box::new(Manager {
                id: AgentId::new(name),
                contractors: contractors.clone(),
                tasks: BTreeMap::new(),
                auction: None,
                winner: None,
                tick: Time::ZERO,
            }) as _
        });
    }
    for (speed, id) in (0..).zip(contractors) {
        simulator.add(&id.clone(), true, move || {
            Box::new(Contractor { id: id.clone(), speed, net: ContractNetResponder::new(id.clone()), job: None }) as _
        });
    }
    let done = |simulator: &Simulator<Box<dyn Role>, World>| {
        let tasks = Key::from("task/");
        let done = simulator.store().with_prefix(&tasks).filter(|entry| matches!(entry.value, TaskState::Done { .. }));
        done.count() == TASKS as usize
    };
    let end = Time::since_start(Duration::from_secs(900));
    assert!(simulator.run_while(end, |simulator| !done(simulator)), "seed {seed}: a task is lost");
    // The last reports reach the observer.
    simulator.run_until(simulator.now() + Duration::from_secs(40));
    let seen = seen.borrow().clone();
    (seen, simulator)
}

/// The machines of this test are not `Send`: the observer shares what it saw with the test.
trait Role: StateMachine<Content = Say, Value = TaskState, Effect = Effect, Completion = u32> {}
impl<M: StateMachine<Content = Say, Value = TaskState, Effect = Effect, Completion = u32>> Role for M {}

/// Every step of a task must be one that the rules allow.
fn check(seed: u64, seen: &[Step]) {
    let mut tasks: BTreeMap<u32, (Revision, &TaskState)> = BTreeMap::new();
    for (task, revision, state) in seen {
        match (tasks.get(task), state) {
            (None, TaskState::Open) => {}
            (Some((before, TaskState::Open | TaskState::Awarded { .. })), TaskState::Awarded { .. }) => {
                assert!(before < revision, "seed {seed}: tokens grow");
            }
            (Some((_, TaskState::Awarded { to, .. })), TaskState::Done { by }) => {
                assert_eq!(to, by, "seed {seed}: only who holds the award may finish task {task}");
            }
            (before, _) => panic!("seed {seed}: task {task} changed from {before:?} to {state:?}"),
        }
        tasks.insert(*task, (*revision, state));
    }
    assert_eq!(tasks.len(), TASKS as usize, "seed {seed}");
    assert!(tasks.values().all(|(_, state)| matches!(state, TaskState::Done { .. })), "seed {seed}");
}

fn faults() -> Faults {
    Faults {
        latency_min: Duration::from_millis(1),
        latency_extra_mean: Duration::from_millis(20),
        store_latency: Duration::ZERO,
        loss: 0.05,
        duplication: 0.05,
        crash_every: Some(Duration::from_secs(4)),
        down_max: Duration::from_secs(6),
        partition_every: Some(Duration::from_secs(6)),
        partition_max: Duration::from_secs(4),
        until: Time::since_start(Duration::from_secs(60)),
    }
}

#[test]
fn in_a_thousand_bad_worlds_no_task_is_lost_and_none_is_done_or_awarded_twice() {
    let mut awards = 0;
    for seed in 0..1000 {
        let (seen, _) = run(seed, faults(), false);
        check(seed, &seen);
        awards += seen.iter().filter(|(_, _, state)| matches!(state, TaskState::Awarded { .. })).count();
    }
    // The faults did something: many awards had to be repeated.
    assert!(awards > 1000 * TASKS as usize * 11 / 10, "{awards} awards");
}

#[test]
fn in_a_good_world_every_task_is_awarded_once() {
    let (seen, simulator) = run(1, Faults::NONE, true);
    check(1, &seen);
    assert_eq!(seen.len(), 3 * TASKS as usize);
    let first_lines: Vec<_> = simulator.trace().lines().skip(9).take(18).map(str::to_owned).collect();
    expect![[r#"
        [   501.000] m0 -> c0  cfp #500000
        [   501.000] m0 -> c1  cfp #500000
        [   501.000] m0 -> c2  cfp #500000
        [   501.000] m0 -> c3  cfp #500000
        [   501.000] m0 -> c4  cfp #500000
        [   501.000] m0 -> c5  cfp #500000
        [   501.000] m1 -> c0  cfp #500000
        [   501.000] m1 -> c1  cfp #500000
        [   501.000] m1 -> c2  cfp #500000
        [   501.000] m1 -> c3  cfp #500000
        [   501.000] m1 -> c4  cfp #500000
        [   501.000] m1 -> c5  cfp #500000
        [   502.000] c0 -> m0  propose #500000
        [   502.000] c1 -> m0  propose #500000
        [   502.000] c2 -> m0  propose #500000
        [   502.000] c3 -> m0  propose #500000
        [   502.000] c4 -> m0  propose #500000
        [   502.000] c5 -> m0  propose #500000"#]]
    .assert_eq(&first_lines.join("\n"));
}
