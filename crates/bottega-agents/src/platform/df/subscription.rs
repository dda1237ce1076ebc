//! A subscription: pending updates for its subscriber, and what is known to have arrived.

use std::time::Duration;

use super::{
    super::{
        management::{DfAgentDescription, ManagementContent, SearchConstraints},
        service::{Said, ServiceOutbox},
    },
    entry::{RESULTS_BYTES_MAX, RESULTS_MAX, index},
};
use crate::{AgentId, Performative, Revision, Time};

/// Maximum number of pending updates per subscriber; the oldest are dropped.
const UPDATES_MAX: usize = 1024;
/// Maximum length of their offers together, in bytes of text; the newest is kept anyway.
const UPDATES_BYTES_MAX: usize = 1 << 24;
/// Time without an error report after which a sent message counts as arrived: longer than a message may take.
const SURE_AFTER: Duration = Duration::from_secs(30);
/// Time without an error report after which a subscriber counts as reachable.
const REACHED_AFTER: Duration = Duration::from_secs(15);
/// Time after which another process sends updates that were not sent.
const TELL_WITHIN: Duration = Duration::from_secs(3);
/// Time after which another process repeats updates that are not confirmed: when the first one gives up.
const SURE_WITHIN: Duration = Duration::from_secs(120);
/// Interval of attempts to reach a subscriber.
pub(super) const TRY_AGAIN_AFTER: Duration = Duration::from_secs(5);
/// Time after which an unreachable subscriber is dropped.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);

pub(super) type SearchRequest = (DfAgentDescription, SearchConstraints);

/// A subscription in the store.
#[derive(Clone, Debug)]
pub(super) struct SubscriptionState {
    /// The message that began the subscription, from which the informs are made.
    pub(super) message: Said,
    pub(super) wish: SearchRequest,
    /// The process that informs the subscriber.
    pub(super) teller: String,
    /// The newest revision at the beginning: entries removed by then do not concern the subscription.
    pub(super) begun: Revision,
    /// The revision up to which updates have certainly arrived.
    pub(super) sure: Revision,
    /// The revision up to which updates were sent.
    pub(super) sent: Revision,
}

#[derive(Clone, Debug)]
pub(super) struct SubscriptionUpdate {
    pub(super) revision: Revision,
    pub(super) offer: DfAgentDescription,
    /// Length of the offer's text, in bytes.
    pub(super) bytes: usize,
    /// Time since which this process knows the subscription.
    pub(super) since: Time,
    /// Time at which this process sent it, and the number of the message.
    pub(super) said: Option<(Time, u64)>,
}

/// The state of an unreachable subscriber.
#[derive(Clone, Copy, Debug)]
pub(super) struct UnreachableSubscriber {
    pub(super) since: Time,
    pub(super) again: Time,
}

#[derive(Clone, Debug)]
pub(super) struct Subscription {
    pub(super) standing: SubscriptionState,
    /// Updates that are not confirmed, one per agent, in order of revision.
    pub(super) updates: Vec<SubscriptionUpdate>,
    pub(super) lost: Option<UnreachableSubscriber>,
    /// True if a change of its entry is in progress.
    pub(super) is_written: bool,
}

impl Subscription {
    /// Adds the newest update, replacing earlier ones about the same agent.
    pub(super) fn add(&mut self, update: SubscriptionUpdate) {
        let name = update.offer.name.as_ref().map(index);
        self.updates.retain(|other| other.offer.name.as_ref().map(index) != name);
        self.updates.push(update);
        let mut bytes: usize = self.updates.iter().map(|update| update.bytes).sum();
        while self.updates.len() > UPDATES_MAX || self.updates.len() > 1 && bytes > UPDATES_BYTES_MAX {
            bytes -= self.updates.remove(0).bytes;
        }
    }

    /// Sends updates that were not sent.
    pub(super) fn tell(&mut self, now: Time, me: &AgentId, next_number: &mut u64, todo: &mut ServiceOutbox) {
        if self.lost.is_some_and(|lost| now < lost.again) {
            return;
        }
        let SubscriptionState { message, wish, .. } = &self.standing;
        let mut unsaid: Vec<&mut SubscriptionUpdate> =
            self.updates.iter_mut().filter(|update| update.said.is_none()).collect();
        // A subscriber to all offers gets all, in as many messages as needed
        let is_all = wish.1.max_results.is_some_and(|most| most < 0);
        let most = if is_all { unsaid.len() } else { wish.1.results_max(RESULTS_MAX) };
        let (mut parts, mut bytes) = (Vec::<Vec<DfAgentDescription>>::new(), 0);
        for (index, update) in unsaid.iter_mut().enumerate() {
            if index < most {
                bytes += update.bytes;
                match parts.last_mut().filter(|part| part.len() < RESULTS_MAX && bytes <= RESULTS_BYTES_MAX) {
                    Some(part) => part.push(update.offer.clone()),
                    None => {
                        parts.push(vec![update.offer.clone()]);
                        bytes = update.bytes;
                    }
                }
            }
            update.said = Some((now, *next_number + parts.len().saturating_sub(1) as u64));
        }
        for offers in parts {
            let content = ManagementContent::Updates(wish.0.clone(), wish.1.clone(), offers);
            let inform = message.reply(Performative::Inform, me.clone(), content);
            // Error reports refer to this number
            todo.send.push(Said { reply_with: *next_number, ..inform });
            *next_number += 1;
        }
    }

    /// Notes that the subscriber is reachable, if recent messages caused no error reports.
    pub(super) fn note_if_reached(&mut self, now: Time) {
        if self.updates.iter().any(|update| update.said.is_some_and(|(said, _)| said + REACHED_AFTER <= now)) {
            self.lost = None;
        }
    }

    /// Returns the current state, if it differs from that in the store.
    pub(super) fn moved(&self, now: Time) -> Option<SubscriptionState> {
        let is_sure = |update: &SubscriptionUpdate| update.said.is_some_and(|(said, _)| said + SURE_AFTER <= now);
        let last = |update: Option<&SubscriptionUpdate>, known: Revision| {
            update.map_or(known, |update| update.revision.max(known))
        };
        let sure = last(self.updates.iter().take_while(|update| is_sure(update)).last(), self.standing.sure);
        let sent = last(self.updates.iter().take_while(|update| update.said.is_some()).last(), self.standing.sent);
        if self.is_written || (sure, sent) == (self.standing.sure, self.standing.sent) {
            return None;
        }
        Some(SubscriptionState { sure, sent, ..self.standing.clone() })
    }

    /// Returns the time at which another process takes over.
    pub(super) fn take_over_at(&self) -> Option<Time> {
        let at = |update: &SubscriptionUpdate| {
            update.since + if update.revision > self.standing.sent { TELL_WITHIN } else { SURE_WITHIN }
        };
        self.updates.iter().map(at).min()
    }

    /// Returns the time at which the process with this name must act.
    pub(super) fn next_deadline(&self, teller: &str) -> Option<Time> {
        if self.standing.teller != teller {
            return self.take_over_at().filter(|_| !self.is_written);
        }
        let unsaid = self.updates.iter().any(|update| update.said.is_none());
        let tell = self.lost.filter(|_| unsaid).map(|lost| lost.again);
        let forget = self.lost.map(|lost| lost.since + PATIENCE);
        let first = self.updates.first().filter(|_| !self.is_written);
        let sure = first.and_then(|update| update.said).map(|(said, _)| said + SURE_AFTER);
        [tell, forget, sure].into_iter().flatten().min()
    }
}
