//! Agents of one node may have effects and reports of different types: here they are made alike.

use std::{any::Any, marker::PhantomData};

use super::local::Mailbox;
use crate::{Action, ActionOf, BoxedMachine, Event, EventOf, StateMachine, Time, gateway::PlainContent};

/// An effect or report of some agent of a node. Only that agent and its performer know what it is.
pub type Anything = Box<dyn Any + Send>;

/// An agent of a node, with effects and reports of its own.
pub type NodeMachine = BoxedMachine<PlainContent, String, Anything, Anything>;

/// What an agent made alike says, if it is of its type, which it always is.
pub(super) fn own<T: 'static>(what: Anything) -> Option<T> {
    what.downcast().ok().map(|what| *what)
}

/// A machine with effects and reports of its own as one of a node.
pub(super) struct Fitted<M>(pub(super) M);

impl<M> StateMachine for Fitted<M>
where
    M: StateMachine<Content = PlainContent, Value = String>,
    M::Effect: Send + 'static,
    M::Completion: Send + 'static,
{
    type Content = PlainContent;
    type Value = String;
    type Effect = Anything;
    type Completion = Anything;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        let event = match event {
            Event::Completed(report) => match own(report) {
                Some(report) => Event::Completed(report),
                None => return,
            },
            Event::Start => Event::Start,
            Event::Message(message) => Event::Message(message),
            Event::Store { ticket, reply } => Event::Store { ticket, reply },
            Event::Presence { agent, present } => Event::Presence { agent, present },
            Event::Deadline => Event::Deadline,
        };
        let mut wanted = Vec::new();
        self.0.handle(now, event, &mut wanted);
        actions.extend(wanted.into_iter().map(fit::<M>));
    }

    fn next_deadline(&self) -> Option<Time> {
        self.0.next_deadline()
    }
}

fn fit<M: StateMachine>(action: ActionOf<M>) -> Action<M::Content, M::Value, Anything>
where
    M::Effect: Send + 'static,
{
    match action {
        Action::Effect(effect) => Action::Effect(Box::new(effect)),
        Action::Send(message) => Action::Send(message),
        Action::Store { ticket, request } => Action::Store { ticket, request },
        Action::Enqueue { queue, message } => Action::Enqueue { queue, message },
        Action::JoinQueue(queue) => Action::JoinQueue(queue),
        Action::WatchPresence => Action::WatchPresence,
        Action::Stop => Action::Stop,
    }
}

/// The way to tell an agent what becomes of its effects, and what else it is to know of the world.
pub struct Reports<R> {
    mailbox: Mailbox<NodeMachine>,
    report: PhantomData<fn(R)>,
}

impl<R> Clone for Reports<R> {
    fn clone(&self) -> Self {
        Self::new(self.mailbox.clone())
    }
}

impl<R: Send + 'static> Reports<R> {
    /// Tells it. Dropped when the agent has stopped.
    pub fn tell(&self, report: R) {
        self.mailbox.complete(Box::new(report));
    }
}

impl<R> Reports<R> {
    pub(super) fn new(mailbox: Mailbox<NodeMachine>) -> Self {
        Self { mailbox, report: PhantomData }
    }
}
