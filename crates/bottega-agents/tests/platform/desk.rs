//! A service over a store, for tests that talk to it.

use std::collections::VecDeque;

use bottega_agents::{
    AclMessage, Action, AgentId, Event, Performative, StateMachine, StoreRequest, Time,
    platform::{FailureReason, Function, Functions, ManagementContent as M, Outcome, RefuseReason, Service},
    store::{AddressedStore, MemoryStore},
};

pub(crate) type Vocabulary<F> = Service<F, M, String, (), ()>;

pub(crate) fn id(name: &str) -> AgentId {
    AgentId::new(name)
}

/// A service over a store in memory.
pub(crate) struct Desk<F> {
    service: Vocabulary<F>,
    pub(crate) store: MemoryStore<String, ()>,
    /// The last conversation.
    pub(crate) conversation: u64,
    /// Number of the next writes that do not reach the store.
    pub(crate) deaf: u32,
    /// The lines that it printed at its start.
    pub(crate) first: Vec<AclMessage<M>>,
}

impl<F: Functions> Desk<F> {
    pub(crate) fn new(name: &str, functions: F) -> Self {
        Self::over(name, functions, MemoryStore::default())
    }

    pub(crate) fn over(name: &str, functions: F, store: MemoryStore<String, ()>) -> Self {
        let mut desk =
            Self { service: Service::new(id(name), functions), store, conversation: 0, deaf: 0, first: Vec::new() };
        desk.store.forget(&());
        desk.first = desk.handle(Time::ZERO, Event::Start);
        desk
    }

    /// Passes an event to the service, and lets the store answer until the service has no more requests.
    pub(crate) fn handle(&mut self, now: Time, event: Event<M, String, ()>) -> Vec<AclMessage<M>> {
        let (mut said, mut events) = (Vec::new(), VecDeque::from([event]));
        while let Some(event) = events.pop_front() {
            let mut actions = Vec::new();
            self.service.handle(now, event, &mut actions);
            for action in actions {
                match action {
                    Action::Send(message) => said.push(message),
                    Action::Store { request: StoreRequest::CompareAndSet { .. }, .. } if self.deaf > 0 => {
                        self.deaf -= 1;
                    }
                    Action::Store { ticket, request } => {
                        let mut replies = Vec::new();
                        self.store.handle((), ticket, request, &mut replies);
                        events.extend(
                            replies
                                .into_iter()
                                .map(|AddressedStore { ticket, reply, .. }| Event::Store { ticket, reply }),
                        );
                    }
                    Action::WatchPresence => {}
                    other => panic!("{other:?}"),
                }
            }
        }
        said
    }

    pub(crate) fn functions(&self) -> &F {
        self.service.functions()
    }

    pub(crate) fn next_deadline(&self) -> Option<Time> {
        self.service.next_deadline()
    }
}

/// Sends a message to a service. Returns all messages that it sends.
pub(crate) fn say<F: Functions>(
    service: &mut Desk<F>,
    now: Time,
    from: &str,
    performative: Performative,
    content: M,
) -> Vec<AclMessage<M>> {
    service.conversation += 1;
    let message = AclMessage {
        conversation_id: service.conversation,
        reply_with: 5,
        ..AclMessage::new(performative, id(from), id("service"), content)
    };
    service.handle(now, Event::Message(message))
}

/// Requests a function; returns the performative and the content of the answer.
pub(crate) fn ask<F: Functions>(service: &mut Desk<F>, now: Time, from: &str, function: Function) -> (Performative, M) {
    let answer = say(service, now, from, Performative::Request, M::Action(function)).pop().unwrap();
    assert_eq!((answer.conversation_id, answer.in_reply_to), (service.conversation, 5));
    assert_eq!(answer.receivers, [id(from)]);
    (answer.performative, answer.content)
}

pub(crate) fn outcome<F: Functions>(service: &mut Desk<F>, now: Time, from: &str, function: Function) -> Outcome {
    match ask(service, now, from, function) {
        (Performative::Inform, M::Done(_, outcome)) => outcome,
        other => panic!("{other:?}"),
    }
}

pub(crate) fn refusal<F: Functions>(service: &mut Desk<F>, from: &str, function: Function) -> RefuseReason {
    match ask(service, Time::ZERO, from, function) {
        (Performative::Refuse, M::Refused(_, reason)) => reason,
        other => panic!("{other:?}"),
    }
}

pub(crate) fn failure<F: Functions>(service: &mut Desk<F>, from: &str, function: Function) -> FailureReason {
    match ask(service, Time::ZERO, from, function) {
        (Performative::Failure, M::Failed(_, reason)) => reason,
        other => panic!("{other:?}"),
    }
}
