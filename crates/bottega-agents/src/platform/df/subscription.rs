//! A subscription: pending news for its subscriber, and what is known to have arrived.

use std::time::Duration;

use super::{
    super::{
        management::{DfAgentDescription, ManagementContent, SearchConstraints},
        service::{Said, ServiceOutbox},
    },
    entry::{RESULTS_BYTES_MAX, RESULTS_MAX, index},
};
use crate::{AgentId, Performative, Revision, Time};

/// Maximum number of pending news per subscriber; the oldest are dropped.
const NEWS_MAX: usize = 1024;
/// Maximum length of their offers together, in bytes of text; the newest is kept anyway.
const NEWS_BYTES_MAX: usize = 1 << 24;
/// Time without an error report after which a sent message counts as arrived: longer than a message may take.
const SURE_AFTER: Duration = Duration::from_secs(30);
/// Time without an error report after which a subscriber counts as reachable.
const REACHED_AFTER: Duration = Duration::from_secs(15);
/// Time after which another process sends news that were not sent.
const TELL_WITHIN: Duration = Duration::from_secs(3);
/// Time after which another process repeats news that are not confirmed: when the first one gives up.
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
    /// The revision up to which news have certainly arrived.
    pub(super) sure: Revision,
    /// The revision up to which news were sent.
    pub(super) told: Revision,
}

#[derive(Clone, Debug)]
pub(super) struct SubscriptionNews {
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
    /// News that are not confirmed, one per agent, in order of revision.
    pub(super) news: Vec<SubscriptionNews>,
    pub(super) lost: Option<UnreachableSubscriber>,
    /// True if a change of its entry is in progress.
    pub(super) is_written: bool,
}

impl Subscription {
    /// Adds the newest news, replacing earlier ones about the same agent.
    pub(super) fn add(&mut self, news: SubscriptionNews) {
        let name = news.offer.name.as_ref().map(index);
        self.news.retain(|other| other.offer.name.as_ref().map(index) != name);
        self.news.push(news);
        let mut bytes: usize = self.news.iter().map(|news| news.bytes).sum();
        while self.news.len() > NEWS_MAX || self.news.len() > 1 && bytes > NEWS_BYTES_MAX {
            bytes -= self.news.remove(0).bytes;
        }
    }

    /// Sends news that were not sent.
    pub(super) fn tell(&mut self, now: Time, me: &AgentId, next_number: &mut u64, todo: &mut ServiceOutbox) {
        if self.lost.is_some_and(|lost| now < lost.again) {
            return;
        }
        let SubscriptionState { message, wish, .. } = &self.standing;
        let mut unsaid: Vec<&mut SubscriptionNews> = self.news.iter_mut().filter(|news| news.said.is_none()).collect();
        // A subscriber to all offers gets all, in as many messages as needed
        let is_all = wish.1.max_results.is_some_and(|most| most < 0);
        let most = if is_all { unsaid.len() } else { wish.1.results_max(RESULTS_MAX) };
        let (mut parts, mut bytes) = (Vec::<Vec<DfAgentDescription>>::new(), 0);
        for (index, news) in unsaid.iter_mut().enumerate() {
            if index < most {
                bytes += news.bytes;
                match parts.last_mut().filter(|part| part.len() < RESULTS_MAX && bytes <= RESULTS_BYTES_MAX) {
                    Some(part) => part.push(news.offer.clone()),
                    None => {
                        parts.push(vec![news.offer.clone()]);
                        bytes = news.bytes;
                    }
                }
            }
            news.said = Some((now, *next_number + parts.len().saturating_sub(1) as u64));
        }
        for offers in parts {
            let content = ManagementContent::News(wish.0.clone(), wish.1.clone(), offers);
            let inform = message.reply(Performative::Inform, me.clone(), content);
            // Error reports refer to this number
            todo.send.push(Said { reply_with: *next_number, ..inform });
            *next_number += 1;
        }
    }

    /// Notes that the subscriber is reachable, if recent messages caused no error reports.
    pub(super) fn note_if_reached(&mut self, now: Time) {
        if self.news.iter().any(|news| news.said.is_some_and(|(said, _)| said + REACHED_AFTER <= now)) {
            self.lost = None;
        }
    }

    /// Returns the current state, if it differs from that in the store.
    pub(super) fn moved(&self, now: Time) -> Option<SubscriptionState> {
        let is_sure = |news: &SubscriptionNews| news.said.is_some_and(|(said, _)| said + SURE_AFTER <= now);
        let last =
            |news: Option<&SubscriptionNews>, known: Revision| news.map_or(known, |news| news.revision.max(known));
        let sure = last(self.news.iter().take_while(|news| is_sure(news)).last(), self.standing.sure);
        let told = last(self.news.iter().take_while(|news| news.said.is_some()).last(), self.standing.told);
        if self.is_written || (sure, told) == (self.standing.sure, self.standing.told) {
            return None;
        }
        Some(SubscriptionState { sure, told, ..self.standing.clone() })
    }

    /// Returns the time at which another process takes over.
    pub(super) fn take_over_at(&self) -> Option<Time> {
        let at = |news: &SubscriptionNews| {
            news.since + if news.revision > self.standing.told { TELL_WITHIN } else { SURE_WITHIN }
        };
        self.news.iter().map(at).min()
    }

    /// Returns the time at which the process with this name must act.
    pub(super) fn next_deadline(&self, teller: &str) -> Option<Time> {
        if self.standing.teller != teller {
            return self.take_over_at().filter(|_| !self.is_written);
        }
        let unsaid = self.news.iter().any(|news| news.said.is_none());
        let tell = self.lost.filter(|_| unsaid).map(|lost| lost.again);
        let forget = self.lost.map(|lost| lost.since + PATIENCE);
        let first = self.news.first().filter(|_| !self.is_written);
        let sure = first.and_then(|news| news.said).map(|(said, _)| said + SURE_AFTER);
        [tell, forget, sure].into_iter().flatten().min()
    }
}
