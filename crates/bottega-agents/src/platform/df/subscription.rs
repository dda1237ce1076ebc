//! One subscription: what is new to its subscriber, and what of that it knows.

use std::time::Duration;

use super::{
    super::{
        management::{DfAgentDescription, ManagementContent, SearchConstraints},
        service::{Said, ServiceOutbox},
    },
    entry::{RESULTS_BYTES_MAX, RESULTS_MAX, index},
};
use crate::{AgentId, Performative, Revision, Time};

/// The most news that wait to be told to one subscriber; the oldest are dropped.
const NEWS_MAX: usize = 1024;
/// The most that their offers take together, in bytes of text; the newest is kept whatever it takes.
const NEWS_BYTES_MAX: usize = 1 << 24;
/// What was told is sure when in this time nobody has said that it did not arrive: longer than a message may take.
const SURE_AFTER: Duration = Duration::from_secs(30);
/// Who was told something of which nobody says for so long that it did not arrive has been reached.
const REACHED_AFTER: Duration = Duration::from_secs(15);
/// What nobody has told for so long, another process tells.
const TELL_WITHIN: Duration = Duration::from_secs(3);
/// What was told and is not sure for so long, another process tells again: when the first would have lost its patience.
const SURE_WITHIN: Duration = Duration::from_secs(120);
/// When one is told again who could not be reached.
pub(super) const TRY_AGAIN_AFTER: Duration = Duration::from_secs(5);
/// Who cannot be reached for so long is forgotten.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);

pub(super) type SearchRequest = (DfAgentDescription, SearchConstraints);

/// A subscription as it stands in the store.
#[derive(Clone, Debug)]
pub(super) struct SubscriptionState {
    /// The message that began it, of which the answers are made.
    pub(super) message: Said,
    pub(super) wish: SearchRequest,
    /// Who tells the subscriber.
    pub(super) teller: String,
    /// The newest revision when it began: what was gone by then is none of its business.
    pub(super) begun: Revision,
    /// Up to which revision the subscriber was told, as far as is sure.
    pub(super) sure: Revision,
    /// Up to which it was told.
    pub(super) told: Revision,
}

#[derive(Clone, Debug)]
pub(super) struct SubscriptionNews {
    pub(super) revision: Revision,
    pub(super) offer: DfAgentDescription,
    /// Of the offer's text.
    pub(super) bytes: usize,
    /// Since when this process knows it.
    pub(super) since: Time,
    /// When this process told it, and in the message of which number.
    pub(super) said: Option<(Time, u64)>,
}

/// A subscriber that cannot be reached.
#[derive(Clone, Copy, Debug)]
pub(super) struct UnreachableSubscriber {
    pub(super) since: Time,
    pub(super) again: Time,
}

#[derive(Clone, Debug)]
pub(super) struct Subscription {
    pub(super) standing: SubscriptionState,
    /// What is not sure, one for each agent, in order of revision.
    pub(super) news: Vec<SubscriptionNews>,
    pub(super) lost: Option<UnreachableSubscriber>,
    /// A change of its entry is under way.
    pub(super) is_written: bool,
}

impl Subscription {
    /// Adds what is the newest, in place of what was new of the same agent.
    pub(super) fn add(&mut self, news: SubscriptionNews) {
        let name = news.offer.name.as_ref().map(index);
        self.news.retain(|other| other.offer.name.as_ref().map(index) != name);
        self.news.push(news);
        let mut bytes: usize = self.news.iter().map(|news| news.bytes).sum();
        while self.news.len() > NEWS_MAX || self.news.len() > 1 && bytes > NEWS_BYTES_MAX {
            bytes -= self.news.remove(0).bytes;
        }
    }

    /// Tells what was not told yet.
    pub(super) fn tell(&mut self, now: Time, me: &AgentId, next_number: &mut u64, todo: &mut ServiceOutbox) {
        if self.lost.is_some_and(|lost| now < lost.again) {
            return;
        }
        let SubscriptionState { message, wish, .. } = &self.standing;
        let mut unsaid: Vec<&mut SubscriptionNews> = self.news.iter_mut().filter(|news| news.said.is_none()).collect();
        // Who wants all gets all, in as many messages as it takes.
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
            // By this number it is told if it does not arrive.
            todo.send.push(Said { reply_with: *next_number, ..inform });
            *next_number += 1;
        }
    }

    /// It can be reached, if something that it was told lately has not come back.
    pub(super) fn note_if_reached(&mut self, now: Time) {
        if self.news.iter().any(|news| news.said.is_some_and(|(said, _)| said + REACHED_AFTER <= now)) {
            self.lost = None;
        }
    }

    /// How it stands now, if that is not what the store has.
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

    /// When another process shall tell.
    pub(super) fn take_over_at(&self) -> Option<Time> {
        let at = |news: &SubscriptionNews| {
            news.since + if news.revision > self.standing.told { TELL_WITHIN } else { SURE_WITHIN }
        };
        self.news.iter().map(at).min()
    }

    /// When there is something to do for the process of this name.
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
