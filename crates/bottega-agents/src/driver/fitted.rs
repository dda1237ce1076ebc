//! Adapters that give agents with different effect and report types a common type within a node.

use std::{any::Any, marker::PhantomData};

use super::local::Mailbox;
use crate::{Action, ActionOf, BoxedMachine, Event, EventOf, StateMachine, Time, gateway::PlainContent};

/// A type-erased effect or report of an agent. Only the agent and the performer of its effects know the concrete type.
pub type Anything = Box<dyn Any + Send>;

/// The state machine of an agent of a node; its effects and reports may have any type.
pub type NodeMachine = BoxedMachine<PlainContent, String, Anything, Anything>;

/// Converts an effect or report to the agent's own type; always succeeds for its own.
pub(super) fn own<T: 'static>(what: Anything) -> Option<T> {
    what.downcast().ok().map(|what| *what)
}

/// Adapts a machine with its own effects and reports to a node.
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

/// A channel of reports to an agent, about its effects and other events.
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
    /// Sends a report. Dropped if the agent has stopped.
    pub fn tell(&self, report: R) {
        self.mailbox.complete(Box::new(report));
    }
}

impl<R> Reports<R> {
    pub(super) fn new(mailbox: Mailbox<NodeMachine>) -> Self {
        Self { mailbox, report: PhantomData }
    }
}
