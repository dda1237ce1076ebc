//! The one shape that every agent, service and protocol role has: an event and the time go in, actions come out.

use crate::{
    AclMessage, AgentId, Time,
    store::{Key, StoreReply, StoreRequest, Ticket},
};

/// An event of an agent.
///
/// `C` is the content of messages, `V` the value type of the store, `R` what the world reports about effects.
#[derive(Clone, Debug, PartialEq)]
pub enum Event<C, V, R> {
    /// The first event after creation, and after a restart with all memory lost.
    Start,
    /// A message arrived.
    Message(AclMessage<C>),
    /// The store answers, or reports a change of what is watched.
    Store {
        /// The ticket of the request.
        ticket: Ticket,
        /// The answer. A watch has many.
        reply: StoreReply<V>,
    },
    /// The world reports on an effect that was begun: finished, failed, part of the way.
    Completed(R),
    /// An agent came, or has not been heard of for so long that it counts as gone. It may be wrong: only a
    /// compare-and-set decides who owns what. Goes to agents that asked by [`Action::WatchPresence`].
    Presence {
        /// Who.
        agent: AgentId,
        /// Whether it is here.
        present: bool,
    },
    /// [`StateMachine::next_deadline`] is reached. It may come when the machine has just named a later one: compare
    /// with `now`.
    Deadline,
}

/// An action that an agent wants. Nothing of it has happened when `handle` returns; order is kept for each receiver.
#[derive(Clone, Debug, PartialEq)]
pub enum Action<C, V, E> {
    /// Sends a message to each of its receivers. It may be lost: who needs an answer sets a deadline.
    Send(AclMessage<C>),
    /// Asks the store. The answer carries the same ticket; it may never come.
    Store {
        /// Chosen by the asker.
        ticket: Ticket,
        /// What to do.
        request: StoreRequest<V>,
    },
    /// Begins something in the world outside of the platform; its end comes as [`Event::Completed`].
    Effect(E),
    /// Puts a message into a queue: exactly one of those who joined it gets it. Its receivers are ignored.
    Enqueue {
        /// Which queue.
        queue: Key,
        /// What is said.
        message: AclMessage<C>,
    },
    /// From now on takes its turn at a queue.
    JoinQueue(Key),
    /// From now on tells who comes and goes, and at once who is here.
    WatchPresence,
    /// The agent is finished: it gets no more events.
    Stop,
}

/// An agent, a service or a role in a protocol, without I/O: it reads no clock, opens no socket, starts no thread.
pub trait StateMachine {
    /// What messages say.
    type Content;
    /// What the store holds.
    type Value;
    /// What the machine can have done in the world.
    type Effect;
    /// What the world says of it.
    type Completion;

    /// Takes one event. What must happen in the world is appended to `actions`, in order.
    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>);

    /// When to call again with [`Event::Deadline`] even if nothing arrives. A deadline that is not later than `now`
    /// after it was answered must not be named again, or the driver would turn in place.
    fn next_deadline(&self) -> Option<Time>;
}

/// The events of a machine.
pub type EventOf<M> = Event<<M as StateMachine>::Content, <M as StateMachine>::Value, <M as StateMachine>::Completion>;

/// The actions of a machine.
pub type ActionOf<M> = Action<<M as StateMachine>::Content, <M as StateMachine>::Value, <M as StateMachine>::Effect>;

/// Any machine of a platform, where several kinds of agents share one vocabulary.
pub type BoxedMachine<C, V, E, R> =
    Box<dyn StateMachine<Content = C, Value = V, Effect = E, Completion = R> + Send + 'static>;

impl<M: StateMachine + ?Sized> StateMachine for Box<M> {
    type Content = M::Content;
    type Value = M::Value;
    type Effect = M::Effect;
    type Completion = M::Completion;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        (**self).handle(now, event, actions);
    }

    fn next_deadline(&self) -> Option<Time> {
        (**self).next_deadline()
    }
}
