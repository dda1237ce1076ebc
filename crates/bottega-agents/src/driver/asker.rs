//! An agent that sends one request.

use std::{sync::mpsc, time::Duration};

use crate::{
    AclMessage, Action, ActionOf, AgentId, Event, EventOf, Performative, StateMachine, Time,
    gateway::PlainContent,
    platform::{ManagementContent, ONTOLOGY},
};

/// An agent that sends one request, passes the answer on, and ends.
pub(super) struct Asker {
    pub(super) me: AgentId,
    pub(super) to: AgentId,
    pub(super) content: ManagementContent,
    pub(super) heard: mpsc::Sender<(Performative, PlainContent)>,
    pub(super) until: Option<Time>,
    pub(super) wait: Duration,
    /// A conversation id unique to the request.
    pub(super) conversation: u64,
}

impl StateMachine for Asker {
    type Content = PlainContent;
    type Value = String;
    type Effect = ();
    type Completion = ();

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        match event {
            Event::Start => {
                let until = now + self.wait;
                self.until = Some(until);
                let content = PlainContent::Management(self.content.clone());
                actions.push(Action::Send(AclMessage {
                    language: "fipa-sl0",
                    ontology: ONTOLOGY,
                    protocol: "fipa-request",
                    conversation_id: self.conversation,
                    reply_with: self.conversation,
                    reply_by: Some(until),
                    ..AclMessage::new(Performative::Request, self.me.clone(), self.to.clone(), content)
                }));
            }
            Event::Message(message)
                if message.in_reply_to == self.conversation && message.performative != Performative::Agree =>
            {
                // The receiver may be gone
                _ = self.heard.send((message.performative, message.content));
                actions.push(Action::Stop);
            }
            Event::Deadline if self.until.is_some_and(|until| until <= now) => actions.push(Action::Stop),
            _ => {}
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.until
    }
}
