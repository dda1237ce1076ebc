//! The standard agent: any state machine under the life cycle of the AMS.

use std::collections::VecDeque;

use super::management::{CarriesManagement, LifeCycleRequest, ManagementContent};
use crate::{AclMessage, Action, ActionOf, AgentId, Event, EventOf, Performative, StateMachine, Time};

/// Maximum number of events kept for a suspended agent; beyond it messages are lost, other events are kept.
pub const KEPT_MESSAGES_MAX: usize = 1 << 14;

/// A state machine as an agent of a platform that obeys its AMS; it refuses life-cycle requests of others.
///
/// While it is suspended, events are kept and deadlines are postponed.
pub struct StandardAgent<M: StateMachine> {
    id: AgentId,
    ams: AgentId,
    machine: M,
    suspended: bool,
    kept: VecDeque<EventOf<M>>,
}

impl<M: StateMachine> StandardAgent<M>
where
    M::Content: CarriesManagement,
{
    /// Wraps a machine as agent `id`, under this AMS; initially active.
    pub fn new(id: AgentId, ams: AgentId, machine: M) -> Self {
        Self { id, ams, machine, suspended: false, kept: VecDeque::new() }
    }

    /// Returns the wrapped machine.
    pub fn machine(&self) -> &M {
        &self.machine
    }

    /// Returns true if the agent is suspended.
    pub fn is_suspended(&self) -> bool {
        self.suspended
    }

    fn obey(
        &mut self,
        now: Time,
        request: LifeCycleRequest,
        message: &AclMessage<M::Content>,
        actions: &mut Vec<ActionOf<M>>,
    ) {
        let done = M::Content::from(ManagementContent::LifeCycleDone(request));
        actions.push(Action::Send(message.reply(Performative::Inform, self.id.clone(), done)));
        match request {
            LifeCycleRequest::Suspend => self.suspended = true,
            LifeCycleRequest::Resume => {
                self.suspended = false;
                for event in std::mem::take(&mut self.kept) {
                    self.machine.handle(now, event, actions);
                }
            }
            LifeCycleRequest::Quit | LifeCycleRequest::Destroy => actions.push(Action::Stop),
        }
    }
}

impl<M: StateMachine> StateMachine for StandardAgent<M>
where
    M::Content: CarriesManagement,
{
    type Content = M::Content;
    type Value = M::Value;
    type Effect = M::Effect;
    type Completion = M::Completion;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        if let Event::Message(message) = &event
            && message.performative == Performative::Request
            && let Some(ManagementContent::LifeCycle(request)) = message.content.management()
        {
            if message.sender == self.ams {
                let (request, message) = (*request, message.clone());
                self.obey(now, request, &message, actions);
            } else {
                let content = message.content.clone();
                actions.push(Action::Send(message.reply(Performative::Refuse, self.id.clone(), content)));
            }
            return;
        }
        if !self.suspended {
            self.machine.handle(now, event, actions);
        } else if self.kept.len() < KEPT_MESSAGES_MAX || !matches!(event, Event::Message(_)) {
            // The agent requested completions and replies of the store itself, so their number is bounded
            self.kept.push_back(event);
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        if self.suspended { None } else { self.machine.next_deadline() }
    }
}
