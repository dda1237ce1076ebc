//! Subscriptions to the progress of jobs.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::{AgentId, Performative, Time, sl::Term};

use super::{
    ontology::job_term,
    talk::{self, Message},
    terms::{Unread, reason},
};
use crate::job::view::{FarmView, JobView};

/// The most subscriptions at a time.
const SUBSCRIPTIONS_MAX: usize = 1 << 10;
/// The shortest time between two reports to a subscriber.
const GAP: Duration = Duration::from_millis(500);
/// Time after which an unreachable subscriber is tried again.
const TRY_AGAIN_AFTER: Duration = Duration::from_secs(5);
/// Time after which an unreachable subscriber is dropped.
const PATIENCE: Duration = Duration::from_secs(20);
/// Time after the last loss from which a subscriber counts as reachable again: detecting a loss takes half of it.
const FORGIVEN_AFTER: Duration = Duration::from_secs(40);

/// The subscriber's name and conversation.
type Key = (String, u64);

#[derive(Clone, Debug)]
struct Subscription {
    message: Message,
    /// The subscribed expression.
    wish: Term,
    number: u32,
    /// The last report, and its time.
    told: Option<(JobView, Time)>,
    /// The time of the next report, if one is due.
    due: Option<Time>,
    /// The times of the first and the last lost message, if the subscriber could not be reached.
    lost: Option<(Time, Time)>,
}

/// The subscriptions to all jobs.
#[derive(Debug, Default)]
pub(super) struct JobSubscriptions {
    subscriptions: BTreeMap<Key, Subscription>,
}

fn key(message: &Message) -> Key {
    (message.sender.name.to_lowercase(), message.conversation_id)
}

impl JobSubscriptions {
    /// Adds a subscriber. A new subscription in the same conversation replaces the old one.
    pub(super) fn subscribe(
        &mut self,
        message: &Message,
        wish: &Term,
        number: u32,
        me: &AgentId,
        send: &mut Vec<Message>,
    ) -> Result<(), Unread> {
        let key = key(message);
        if self.subscriptions.len() >= SUBSCRIPTIONS_MAX && !self.subscriptions.contains_key(&key) {
            return Err(Unread::Refused(reason("too-many-subscribers", [])));
        }
        send.push(talk::agree(message, me, wish));
        let (message, wish) = (message.clone(), wish.clone());
        self.subscriptions.insert(key, Subscription { message, wish, number, told: None, due: None, lost: None });
        Ok(())
    }

    /// Ends the subscription of this conversation.
    pub(super) fn cancel(&mut self, message: &Message, me: &AgentId, send: &mut Vec<Message>) -> Result<(), Unread> {
        match self.subscriptions.remove(&key(message)) {
            Some(_) => send.push(talk::over(message, me)),
            None => return Err(Unread::NotUnderstood(reason("unexpected-act", [Performative::Cancel.word()]))),
        }
        Ok(())
    }

    /// Records that a message to a subscriber was lost.
    pub(super) fn lost(&mut self, now: Time, receiver: &AgentId, me: &AgentId, send: &mut Vec<Message>) {
        self.subscriptions.retain(|_, subscription| {
            if !talk::hears(&subscription.message, receiver) {
                return true;
            }
            let recent = subscription.lost.filter(|(_, last)| now.since(*last) < FORGIVEN_AFTER);
            let since = recent.map_or(now, |(since, _)| since);
            subscription.lost = Some((since, now));
            subscription.due = Some(now + TRY_AGAIN_AFTER);
            let is_forgotten = now.since(since) >= PATIENCE;
            if is_forgotten {
                // It will hardly arrive; the gateway ends the conversation with it.
                send.push(talk::failure(&subscription.message, me, &subscription.wish, "you could not be reached"));
            }
            !is_forgotten
        });
    }

    /// Sends all reports that are due.
    pub(super) fn tell(&mut self, now: Time, farm: &FarmView, me: &AgentId, send: &mut Vec<Message>) {
        self.subscriptions.retain(|_, subscription| subscription.tell(now, farm, me, send));
    }

    /// Returns the time of the next report.
    pub(super) fn next_deadline(&self) -> Option<Time> {
        self.subscriptions.values().filter_map(|subscription| subscription.due).min()
    }
}

impl Subscription {
    /// Sends a report if one is due. `false`: it was the last one.
    fn tell(&mut self, now: Time, farm: &FarmView, me: &AgentId, send: &mut Vec<Message>) -> bool {
        let Some(job) = farm.job(self.number) else {
            send.push(talk::failure(&self.message, me, &self.wish, "the farm has forgotten the job"));
            return false;
        };
        let is_news = self.told.as_ref().is_none_or(|(told, _)| told != job);
        if is_news && self.due.is_none() {
            self.due = Some(self.told.as_ref().map_or(now, |(_, at)| *at + GAP));
        }
        if self.due.is_none_or(|due| now < due) {
            return true;
        }
        let news = Term::call("=", [self.wish.clone(), job_term(job)]);
        send.push(talk::answer(&self.message, me, Performative::Inform, &[news]));
        self.told = Some((job.clone(), now));
        self.due = None;
        if job.is_over {
            send.push(talk::over(&self.message, me));
        }
        !job.is_over
    }
}
