//! All agents of a siege: the farm's own agents, visitors and hostile agents, as one machine that a simulator runs.

use bottega_agents::{Action, ActionOf, Event, EventOf, StateMachine, Time};
use bottega_farm::{
    FarmAgent, FarmCompletion, FarmContent, FarmEffect, FarmValue, Visitor, VisitorEffect, VisitorReport,
};

use super::agent::HostileAgent;

/// Any agent of a hostile platform.
pub(super) enum AnyAgent {
    Farm(FarmAgent),
    Visitor(Box<Visitor>),
    Hostile(Box<HostileAgent>),
}

/// The effects that an agent of the cast can ask for.
pub(super) enum AnyEffect {
    Farm(FarmEffect),
    Visitor(VisitorEffect),
}

/// The events that an agent of the cast can get.
pub(super) enum AnyCompletion {
    Farm(FarmCompletion),
    Visitor(VisitorReport),
}

impl StateMachine for AnyAgent {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = AnyEffect;
    type Completion = AnyCompletion;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match self {
            Self::Farm(agent) => feed(agent, now, event, actions, of_farm, AnyEffect::Farm),
            Self::Hostile(agent) => feed(&mut **agent, now, event, actions, of_farm, AnyEffect::Farm),
            Self::Visitor(visitor) => feed(&mut **visitor, now, event, actions, of_visitor, AnyEffect::Visitor),
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        match self {
            Self::Farm(agent) => agent.next_deadline(),
            Self::Visitor(visitor) => visitor.next_deadline(),
            Self::Hostile(agent) => agent.next_deadline(),
        }
    }
}

fn of_farm(completion: AnyCompletion) -> Option<FarmCompletion> {
    match completion {
        AnyCompletion::Farm(completion) => Some(completion),
        AnyCompletion::Visitor(_) => None,
    }
}

fn of_visitor(completion: AnyCompletion) -> Option<VisitorReport> {
    match completion {
        AnyCompletion::Visitor(report) => Some(report),
        AnyCompletion::Farm(_) => None,
    }
}

/// Passes an event of the platform to a machine, and the machine's actions to the platform.
fn feed<M>(
    machine: &mut M,
    now: Time,
    event: EventOf<AnyAgent>,
    actions: &mut Vec<ActionOf<AnyAgent>>,
    report: impl Fn(AnyCompletion) -> Option<M::Completion>,
    effect: impl Fn(M::Effect) -> AnyEffect,
) where
    M: StateMachine<Content = FarmContent, Value = FarmValue>,
{
    let event = match event {
        Event::Completed(completion) => Event::Completed(report(completion).expect("a report of its own world")),
        Event::Start => Event::Start,
        Event::Message(message) => Event::Message(message),
        Event::Store { ticket, reply } => Event::Store { ticket, reply },
        Event::Presence { agent, present } => Event::Presence { agent, present },
        Event::Deadline => Event::Deadline,
    };
    let mut wanted = Vec::new();
    machine.handle(now, event, &mut wanted);
    actions.extend(wanted.into_iter().map(|action| match action {
        Action::Effect(what) => Action::Effect(effect(what)),
        Action::Send(message) => Action::Send(message),
        Action::Store { ticket, request } => Action::Store { ticket, request },
        Action::Enqueue { queue, message } => Action::Enqueue { queue, message },
        Action::JoinQueue(queue) => Action::JoinQueue(queue),
        Action::WatchPresence => Action::WatchPresence,
        Action::Stop => Action::Stop,
    }));
}
