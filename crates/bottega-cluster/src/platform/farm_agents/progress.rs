//! Subscriptions to the progress of jobs.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::{AgentId, Performative, Time, sl::Term};

use super::{
    ontology::job_term,
    talk::{self, Message},
    terms::{Unread, reason},
};
use crate::view::{FarmView, JobView};

/// The most subscriptions at a time.
const SUBSCRIPTIONS_MAX: usize = 1 << 10;
/// The shortest time between two tellings.
const GAP: Duration = Duration::from_millis(500);
/// When one is told again who could not be reached.
const TRY_AGAIN_AFTER: Duration = Duration::from_secs(5);
/// Who cannot be reached for so long is forgotten.
const PATIENCE: Duration = Duration::from_secs(20);
/// Who has been reached for so long since is as good as any: it takes half of it to find that nobody is there.
const FORGIVEN_AFTER: Duration = Duration::from_secs(40);

/// Who subscribed, in which conversation.
type Key = (String, u64);

#[derive(Clone, Debug)]
struct Subscription {
    message: Message,
    /// The expression that says of what it wants to be told.
    wish: Term,
    number: u32,
    /// What it was told last, and when.
    told: Option<(JobView, Time)>,
    /// When it must be told.
    due: Option<Time>,
    /// It could not be reached: since when, and the last time.
    lost: Option<(Time, Time)>,
}

#[derive(Debug, Default)]
pub(super) struct JobSubscriptions {
    subscriptions: BTreeMap<Key, Subscription>,
}

fn key(message: &Message) -> Key {
    (message.sender.name.to_lowercase(), message.conversation_id)
}

impl JobSubscriptions {
    /// Takes a subscriber in. Who subscribes again in the same conversation has its wish replaced.
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

    /// A message to somebody got lost.
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
                // It will hardly hear this; the gateway ends the thread by it.
                send.push(talk::failure(&subscription.message, me, &subscription.wish, "you could not be reached"));
            }
            !is_forgotten
        });
    }

    /// Tells all that is new, and due.
    pub(super) fn tell(&mut self, now: Time, farm: &FarmView, me: &AgentId, send: &mut Vec<Message>) {
        self.subscriptions.retain(|_, subscription| subscription.tell(now, farm, me, send));
    }

    pub(super) fn next_deadline(&self) -> Option<Time> {
        self.subscriptions.values().filter_map(|subscription| subscription.due).min()
    }
}

impl Subscription {
    /// Tells what is new, if it is due. `false`: there will be nothing more.
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
