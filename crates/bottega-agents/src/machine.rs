//! State machines: the common form of every agent, service and protocol role. An event and the time go in, actions come
//! out.

use crate::{
    AclMessage, AgentId, Time,
    store::{Key, StoreReply, StoreRequest, Ticket},
};

/// An event for an agent.
///
/// `C` is the content of messages, `V` the value type of the store, `R` the type of completions.
#[derive(Clone, Debug, PartialEq)]
pub enum Event<C, V, R> {
    /// The first event after creation, or after a restart without memory.
    Start,
    /// A message arrived.
    Message(AclMessage<C>),
    /// The store answers, or reports a change of what is watched.
    Store {
        /// The ticket of the request that is answered.
        ticket: Ticket,
        /// The reply. A watch has many.
        reply: StoreReply<V>,
    },
    /// A completion of an effect: success, failure, or progress.
    Completed(R),
    /// An agent arrived, or was silent for so long that it counts as gone. This may be wrong: only a compare-and-set
    /// decides ownership. Sent to agents that requested it by [`Action::WatchPresence`].
    Presence {
        /// The agent that arrived or is gone.
        agent: AgentId,
        /// True if the agent is present.
        present: bool,
    },
    /// [`StateMachine::next_deadline`] is reached. It may arrive when the machine has just set a later one, so compare
    /// with `now`.
    Deadline,
}

/// An action requested by an agent. Nothing has happened when `handle` returns. The driver carries actions out in
/// order, but on a network messages may overtake each other.
#[derive(Clone, Debug, PartialEq)]
pub enum Action<C, V, E> {
    /// Sends a message to each of its receivers. It may be lost: set a deadline if a reply is needed.
    Send(AclMessage<C>),
    /// Sends a request to the store. The reply has the same ticket; it may never arrive.
    Store {
        /// The ticket, chosen by the agent.
        ticket: Ticket,
        /// The request to the store.
        request: StoreRequest<V>,
    },
    /// Begins an effect outside the platform; its completion arrives as [`Event::Completed`].
    Effect(E),
    /// Puts a message into a queue: one of the agents that joined it gets the message. Its receivers are ignored.
    Enqueue {
        /// The name of the queue.
        queue: Key,
        /// The message, with its content.
        message: AclMessage<C>,
    },
    /// Joins a queue, to receive messages from it in turn.
    JoinQueue(Key),
    /// Requests [`Event::Presence`] events: now for all agents present, and then for changes.
    WatchPresence,
    /// Ends the agent: it gets no more events.
    Stop,
}

/// An agent, a service or a protocol role without I/O: it reads no clock, opens no socket and starts no thread.
pub trait StateMachine {
    /// The content of messages.
    type Content;
    /// The values in the store.
    type Value;
    /// The effects that it can request.
    type Effect;
    /// The completions of effects.
    type Completion;

    /// Handles one event. Appends the requested actions, in order.
    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>);

    /// Returns the time of the next [`Event::Deadline`]; `None`: none. After such an event was handled it must be later
    /// than `now`: otherwise the simulator panics, and the local platform sends the event again every millisecond.
    fn next_deadline(&self) -> Option<Time>;
}

/// The event type of a machine.
pub type EventOf<M> = Event<<M as StateMachine>::Content, <M as StateMachine>::Value, <M as StateMachine>::Completion>;

/// The action type of a machine.
pub type ActionOf<M> = Action<<M as StateMachine>::Content, <M as StateMachine>::Value, <M as StateMachine>::Effect>;

/// A boxed machine, for agents of several kinds with the same types of contents, values, effects and completions.
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
