//! Agents on threads, in real time.

use std::{panic, sync::mpsc, thread, time::Duration};

use bottega_agents::{
    AclMessage, Action, ActionOf, AgentId, Event, EventOf, LocalPlatform, Performative, Performer, Revision,
    StateMachine, StoreReply, StoreRequest, Ticket, Time, driver::local::NameTaken,
};

/// Two players pass a number to and fro until it is zero.
struct Player {
    id: AgentId,
    other: AgentId,
    serve: Option<u32>,
    wake: Option<Time>,
}

impl StateMachine for Player {
    type Content = u32;
    type Value = u32;
    type Effect = u32;
    type Completion = u32;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        let mut pass = |left: u32| {
            actions.push(Action::Send(AclMessage::new(
                Performative::Inform,
                self.id.clone(),
                self.other.clone(),
                left,
            )));
        };
        match event {
            Event::Start => {
                if self.serve.is_some() {
                    self.wake = Some(now + Duration::from_millis(5));
                }
            }
            Event::Deadline => {
                if self.wake.take().is_some() {
                    pass(self.serve.expect("only who serves wakes"));
                }
            }
            Event::Message(message) if message.content == 0 => actions.push(Action::Stop),
            Event::Message(message) => {
                pass(message.content - 1);
                if message.content == 1 {
                    actions.push(Action::Effect(7));
                }
            }
            Event::Completed(seven) => {
                let request = StoreRequest::CompareAndSet {
                    key: "end".into(),
                    expected_revision: Revision::ABSENT,
                    value: seven,
                };
                actions.push(Action::Store { ticket: Ticket(1), request });
            }
            Event::Store { reply, .. } => {
                assert!(matches!(reply, StoreReply::Written { revision: Revision(1), .. }));
                actions.push(Action::Stop);
            }
            Event::Presence { .. } => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.wake
    }
}

fn play(threads: usize) {
    let platform = LocalPlatform::new(threads).unwrap();
    let (a, b) = (AgentId::new("a@here"), AgentId::new("b@here"));
    for (id, other, serve) in [(&a, &b, Some(1001)), (&b, &a, None)] {
        let player = Player { id: id.clone(), other: other.clone(), serve, wake: None };
        // The effect runs for a while on its own thread, as an engine does.
        let performer: Performer<Player> = Box::new(|effect, mailbox| {
            let mailbox = mailbox.clone();
            thread::spawn(move || mailbox.complete(effect));
        });
        platform.add(id, player, performer).unwrap();
    }
    assert!(matches!(
        platform.add(&a, Player { id: a.clone(), other: b, serve: None, wake: None }, Box::new(|_, _| {})),
        Err(NameTaken(_))
    ));
    platform.wait();
}

#[test]
fn two_agents_talk_wait_ask_the_store_and_stop_on_one_thread_and_on_three() {
    play(1);
    play(3);
}

#[test]
fn a_panic_in_a_machine_reaches_who_waits() {
    struct Bad;
    impl StateMachine for Bad {
        type Content = ();
        type Value = ();
        type Effect = ();
        type Completion = ();
        fn handle(&mut self, _: Time, _: EventOf<Self>, _: &mut Vec<ActionOf<Self>>) {
            panic!("a bug");
        }
        fn next_deadline(&self) -> Option<Time> {
            None
        }
    }
    let platform = LocalPlatform::new(1).unwrap();
    platform.add(&AgentId::new("bad@here"), Bad, Box::new(|_, _| {})).unwrap();
    let caught = panic::catch_unwind(panic::AssertUnwindSafe(|| platform.wait()));
    assert_eq!(caught.unwrap_err().downcast_ref::<&str>(), Some(&"a bug"));
}

#[test]
fn an_idle_platform_sleeps_and_a_late_completion_wakes_it() {
    struct Sleeper(mpsc::Sender<u32>);
    impl StateMachine for Sleeper {
        type Content = ();
        type Value = ();
        type Effect = ();
        type Completion = u32;
        fn handle(&mut self, _: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
            match event {
                Event::Completed(number) => {
                    self.0.send(number).unwrap();
                    actions.push(Action::Stop);
                }
                other => assert!(matches!(other, Event::Start), "nothing else happens: {other:?}"),
            }
        }
        fn next_deadline(&self) -> Option<Time> {
            None
        }
    }
    let platform = LocalPlatform::new(2).unwrap();
    let (sender, receiver) = mpsc::channel();
    let mailbox = platform.add(&AgentId::new("s@here"), Sleeper(sender), Box::new(|_, _| {})).unwrap();
    thread::sleep(Duration::from_millis(10));
    mailbox.complete(3);
    assert_eq!(receiver.recv().unwrap(), 3);
    platform.wait();
    mailbox.complete(4);
}
