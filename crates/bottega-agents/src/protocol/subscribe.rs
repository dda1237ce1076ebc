//! The subscribe protocol (FIPA00035): who asked to be told is told at each change, until it cancels.

use std::collections::BTreeMap;

use super::OutOfSequence;
use crate::{AclMessage, AgentId, Performative};

/// The most subscribers at a time.
pub const SUBSCRIBERS_MAX: usize = 4096;

/// There is no room for one more; answer by a refusal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there are {SUBSCRIBERS_MAX} subscribers already")]
pub struct TooManySubscribers;

/// The news of a message.
#[derive(Clone, Debug, PartialEq)]
pub enum SubscribeNews<C> {
    /// Somebody wants to be told of what the content names. Accept by [`Subscriptions::accept`] or refuse.
    Wanted(AclMessage<C>),
    /// Somebody cancelled, and was told that it is done.
    Cancelled(AgentId),
}

/// The side that tells.
#[derive(Clone, Debug)]
pub struct Subscriptions<C> {
    me: AgentId,
    subscribers: BTreeMap<(AgentId, u64), AclMessage<C>>,
}

impl<C: Clone> Subscriptions<C> {
    /// Nobody is told yet.
    pub fn new(me: AgentId) -> Self {
        Self { me, subscribers: BTreeMap::new() }
    }

    /// Takes a message of the protocol.
    ///
    /// # Errors
    /// It is neither subscribe nor cancel, or cancels what is not there.
    pub fn handle_message(
        &mut self,
        message: AclMessage<C>,
        send: &mut Vec<AclMessage<C>>,
    ) -> Result<SubscribeNews<C>, OutOfSequence> {
        let key = (message.sender.clone(), message.conversation_id);
        match message.performative {
            Performative::Subscribe => Ok(SubscribeNews::Wanted(message)),
            Performative::Cancel if self.subscribers.remove(&key).is_some() => {
                send.push(message.reply(Performative::Inform, self.me.clone(), message.content.clone()));
                Ok(SubscribeNews::Cancelled(message.sender))
            }
            got => Err(OutOfSequence { from: message.sender, got, state: "without a subscription" }),
        }
    }

    /// Takes a subscriber in. Who subscribes again in the same conversation has its wish replaced.
    ///
    /// # Errors
    /// There is no room.
    pub fn accept(&mut self, wish: AclMessage<C>) -> Result<(), TooManySubscribers> {
        let key = (wish.sender.clone(), wish.conversation_id);
        if self.subscribers.len() >= SUBSCRIBERS_MAX && !self.subscribers.contains_key(&key) {
            return Err(TooManySubscribers);
        }
        self.subscribers.insert(key, wish);
        Ok(())
    }

    /// Tells each subscriber what `news` says of its wish, if anything; in order of names.
    pub fn tell(&self, mut news: impl FnMut(&C) -> Option<C>, send: &mut Vec<AclMessage<C>>) {
        for wish in self.subscribers.values() {
            if let Some(content) = news(&wish.content) {
                send.push(wish.reply(Performative::Inform, self.me.clone(), content));
            }
        }
    }

    /// Forgets an agent that is gone.
    pub fn forget(&mut self, agent: &AgentId) {
        self.subscribers.retain(|(subscriber, _), _| subscriber != agent);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subscriber_is_told_what_concerns_it_until_it_cancels() {
        let (a, b) = (AgentId::new("a"), AgentId::new("b"));
        let mut all = Subscriptions::new(b.clone());
        let mut send = Vec::new();
        let say =
            |performative| AclMessage { conversation_id: 1, ..AclMessage::new(performative, a.clone(), b.clone(), 10) };
        let Ok(SubscribeNews::Wanted(wish)) = all.handle_message(say(Performative::Subscribe), &mut send) else {
            panic!()
        };
        all.accept(wish).unwrap();
        all.tell(|wish| (*wish == 10).then_some(11), &mut send);
        all.tell(|wish| (*wish == 12).then_some(11), &mut send);
        assert_eq!(send.iter().map(|m| (m.performative, m.content)).collect::<Vec<_>>(), [(Performative::Inform, 11)]);
        assert_eq!(all.handle_message(say(Performative::Cancel), &mut send), Ok(SubscribeNews::Cancelled(a.clone())));
        assert!(all.handle_message(say(Performative::Cancel), &mut send).is_err());
        assert!(all.handle_message(say(Performative::Propose), &mut send).is_err());
    }
}
