//! The subscribe protocol (FIPA00035): subscribers are informed of each change until they cancel.

use std::collections::BTreeMap;

use super::OutOfSequence;
use crate::{AclMessage, AgentId, Performative};

/// Maximum number of subscriptions at one publisher.
pub const SUBSCRIBERS_MAX: usize = 4096;

/// The error that a publisher has [`SUBSCRIBERS_MAX`] subscriptions already; refuse the new one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there are {SUBSCRIBERS_MAX} subscribers already")]
pub struct TooManySubscribers;

/// An event for the agent that publishes.
#[derive(Clone, Debug, PartialEq)]
pub enum PublisherEvent<C> {
    /// An agent wants to subscribe to what the content names. Accept the message by [`Subscriptions::accept`], or
    /// refuse it.
    Wanted(AclMessage<C>),
    /// The subscriber with this name has cancelled a subscription; the confirmation is appended to the messages to
    /// send.
    Cancelled(AgentId),
}

/// The publisher: the subscriptions at one agent.
#[derive(Clone, Debug)]
pub struct Subscriptions<C> {
    me: AgentId,
    subscribers: BTreeMap<(AgentId, u64), AclMessage<C>>,
}

impl<C: Clone> Subscriptions<C> {
    /// Makes a publisher without subscribers.
    pub fn new(me: AgentId) -> Self {
        Self { me, subscribers: BTreeMap::new() }
    }

    /// Handles a message of the protocol. Returns the event that it causes; the confirmation of a cancel is appended to
    /// `send`.
    ///
    /// # Errors
    /// The message is neither subscribe nor cancel, or cancels an unknown subscription.
    pub fn handle_message(
        &mut self,
        message: AclMessage<C>,
        send: &mut Vec<AclMessage<C>>,
    ) -> Result<PublisherEvent<C>, OutOfSequence> {
        let key = (message.sender.clone(), message.conversation_id);
        match message.performative {
            Performative::Subscribe => Ok(PublisherEvent::Wanted(message)),
            Performative::Cancel if self.subscribers.remove(&key).is_some() => {
                send.push(message.reply(Performative::Inform, self.me.clone(), message.content.clone()));
                Ok(PublisherEvent::Cancelled(message.sender))
            }
            got => Err(OutOfSequence { from: message.sender, got, state: "without a subscription" }),
        }
    }

    /// Adds a subscription. A second one of the same subscriber in the same conversation replaces the first.
    ///
    /// - `wish`: the message of [`PublisherEvent::Wanted`].
    ///
    /// # Errors
    /// There are [`SUBSCRIBERS_MAX`] subscriptions already.
    pub fn accept(&mut self, wish: AclMessage<C>) -> Result<(), TooManySubscribers> {
        let key = (wish.sender.clone(), wish.conversation_id);
        if self.subscribers.len() >= SUBSCRIBERS_MAX && !self.subscribers.contains_key(&key) {
            return Err(TooManySubscribers);
        }
        self.subscribers.insert(key, wish);
        Ok(())
    }

    /// Appends an inform message to `send` for each subscription, in order of the subscribers' names.
    ///
    /// - `update`: gets the content of the subscription, and returns that of the inform message; `None`: no message.
    pub fn tell(&self, mut update: impl FnMut(&C) -> Option<C>, send: &mut Vec<AclMessage<C>>) {
        for wish in self.subscribers.values() {
            if let Some(content) = update(&wish.content) {
                send.push(wish.reply(Performative::Inform, self.me.clone(), content));
            }
        }
    }

    /// Removes all subscriptions of an agent that is gone.
    pub fn forget(&mut self, agent: &AgentId) {
        self.subscribers.retain(|(subscriber, _), _| subscriber != agent);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subscriber_gets_its_updates_until_it_cancels() {
        let (a, b) = (AgentId::new("a"), AgentId::new("b"));
        let mut all = Subscriptions::new(b.clone());
        let mut send = Vec::new();
        let say =
            |performative| AclMessage { conversation_id: 1, ..AclMessage::new(performative, a.clone(), b.clone(), 10) };
        let Ok(PublisherEvent::Wanted(wish)) = all.handle_message(say(Performative::Subscribe), &mut send) else {
            panic!()
        };
        all.accept(wish).unwrap();
        all.tell(|wish| (*wish == 10).then_some(11), &mut send);
        all.tell(|wish| (*wish == 12).then_some(11), &mut send);
        assert_eq!(send.iter().map(|m| (m.performative, m.content)).collect::<Vec<_>>(), [(Performative::Inform, 11)]);
        assert_eq!(all.handle_message(say(Performative::Cancel), &mut send), Ok(PublisherEvent::Cancelled(a.clone())));
        assert!(all.handle_message(say(Performative::Cancel), &mut send).is_err());
        assert!(all.handle_message(say(Performative::Propose), &mut send).is_err());
    }
}
