//! An agent of a job, with an observer of all its messages.

use std::sync::Arc;

use bottega_agents::{AclMessage, StateMachine, Time};

use crate::{FarmAction, FarmAgent, FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmValue};

/// An observer of the messages of one process's agents.
pub(super) trait JobWatch: Send + Sync {
    /// Called when an agent of this process has received a message.
    fn heard(&self, now: Time, message: &AclMessage<FarmContent>);

    /// Called when an agent of this process has sent a message.
    fn said(&self, now: Time, message: &AclMessage<FarmContent>);
}

/// An agent of a job whose messages are observed.
pub struct JobAgent {
    agent: FarmAgent,
    watch: Arc<dyn JobWatch>,
}

impl JobAgent {
    /// Returns an agent whose messages `watch` observes.
    pub(super) fn new(agent: FarmAgent, watch: Arc<dyn JobWatch>) -> Self {
        Self { agent, watch }
    }
}

impl StateMachine for JobAgent {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = FarmEffect;
    type Completion = FarmCompletion;

    fn handle(&mut self, now: Time, event: FarmEvent, actions: &mut Vec<FarmAction>) {
        if let FarmEvent::Message(message) = &event {
            self.watch.heard(now, message);
        }
        let before = actions.len();
        self.agent.handle(now, event, actions);
        for action in &actions[before..] {
            if let FarmAction::Send(message) = action {
                self.watch.said(now, message);
            }
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.agent.next_deadline()
    }
}
