//! Subscriptions to the progress of jobs, and to the rows of their Blackboards.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::{AgentId, Performative, Time, sl::Term};

use super::{
    failure::FarmFailure,
    ontology::{Followed, job_term},
    rows::{JobRows, row_terms},
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
pub(super) type SubscriberKey = (String, u64);

#[derive(Clone, Debug)]
struct Subscription {
    message: Message,
    /// The subscribed expression.
    wish: Term,
    /// The number of the job.
    number: u32,
    reported: Reported,
    /// The time of the last report.
    last: Option<Time>,
    /// The time of the next report, if one is due.
    due: Option<Time>,
    /// The times of the first and the last lost message, if the subscriber could not be reached.
    lost: Option<(Time, Time)>,
}

/// The data that a subscriber has received.
#[derive(Clone, Debug)]
enum Reported {
    /// The job as last reported.
    Job(Option<Box<JobView>>),
    Rows(RowsReported),
}

/// The rows that a subscriber knows.
#[derive(Clone, Debug, Default)]
struct RowsReported {
    /// The only zone that the subscriber follows; `None`: all.
    zone: Option<u32>,
    /// The rows as last reported, by zone; `None`: nothing was reported.
    rows: Option<BTreeMap<u32, Term>>,
    /// True while rows are being read for the subscriber.
    is_reading: bool,
    /// True if the job was over when that began, so that these rows are its last.
    is_last: bool,
}

/// The subscriptions to all jobs.
#[derive(Debug, Default)]
pub(super) struct JobSubscriptions {
    subscriptions: BTreeMap<SubscriberKey, Subscription>,
}

fn key(message: &Message) -> SubscriberKey {
    (message.sender.name.to_lowercase(), message.conversation_id)
}

impl JobSubscriptions {
    /// Adds a subscriber. A new subscription in the same conversation replaces the old one.
    pub(super) fn subscribe(
        &mut self,
        message: &Message,
        wish: &Term,
        (number, followed): (u32, Followed),
        me: &AgentId,
        send: &mut Vec<Message>,
    ) -> Result<(), Unread> {
        let key = key(message);
        if self.subscriptions.len() >= SUBSCRIPTIONS_MAX && !self.subscriptions.contains_key(&key) {
            return Err(Unread::Refused(reason("too-many-subscribers", [])));
        }
        send.push(talk::agree(message, me, wish));
        let (message, wish) = (message.clone(), wish.clone());
        let reported = match followed {
            Followed::Job => Reported::Job(None),
            Followed::Rows(zone) => Reported::Rows(RowsReported { zone, ..RowsReported::default() }),
        };
        let (last, due, lost) = (None, None, None);
        self.subscriptions.insert(key, Subscription { message, wish, number, reported, last, due, lost });
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

    /// Sends all reports that are due. Returns the subscribers for whom rows must be read, with the number of the job.
    ///
    /// - `room`: the most of them.
    pub(super) fn report(
        &mut self,
        now: Time,
        farm: &FarmView,
        room: usize,
        me: &AgentId,
        send: &mut Vec<Message>,
    ) -> Vec<(SubscriberKey, u32)> {
        let mut reads = Vec::new();
        self.subscriptions.retain(|key, subscription| {
            let Some(job) = farm.job(subscription.number) else {
                send.push(talk::failure(
                    &subscription.message,
                    me,
                    &subscription.wish,
                    "the farm has forgotten the job",
                ));
                return false;
            };
            if subscription.begin_reading(now, job, reads.len() < room) {
                reads.push((key.clone(), subscription.number));
            }
            subscription.report_job(now, job, me, send)
        });
        reads
    }

    /// Sends the rows that have changed to a subscriber.
    pub(super) fn report_rows(
        &mut self,
        now: Time,
        key: &SubscriberKey,
        rows: Result<&JobRows, &FarmFailure>,
        me: &AgentId,
        send: &mut Vec<Message>,
    ) {
        let is_over =
            self.subscriptions.get_mut(key).is_some_and(|subscription| subscription.report_rows(now, rows, me, send));
        if is_over {
            self.subscriptions.remove(key);
        }
    }

    /// Returns the time of the next report.
    pub(super) fn next_deadline(&self) -> Option<Time> {
        self.subscriptions.values().filter_map(|subscription| subscription.due).min()
    }
}

impl Subscription {
    /// Reports the progress of the job if that is followed and a report is due. `false`: it was the last one.
    fn report_job(&mut self, now: Time, job: &JobView, me: &AgentId, send: &mut Vec<Message>) -> bool {
        let Reported::Job(reported) = &mut self.reported else { return true };
        if reported.as_deref() != Some(job) && self.due.is_none() {
            self.due = Some(self.last.map_or(now, |at| at + GAP));
        }
        if self.due.is_none_or(|due| now < due) {
            return true;
        }
        let report = Term::call("=", [self.wish.clone(), job_term(job)]);
        send.push(talk::answer(&self.message, me, Performative::Inform, &[report]));
        *reported = Some(Box::new(job.clone()));
        (self.last, self.due) = (Some(now), None);
        if job.is_over {
            send.push(talk::over(&self.message, me));
        }
        !job.is_over
    }

    /// Returns `true` if rows must be read now: they are followed, due, and not being read.
    ///
    /// - `has_room`: `false` if too many reads are pending; it is tried again later.
    fn begin_reading(&mut self, now: Time, job: &JobView, has_room: bool) -> bool {
        let Reported::Rows(reported) = &mut self.reported else { return false };
        if reported.is_reading {
            return false;
        }
        let due = *self.due.get_or_insert(self.last.map_or(now, |at| at + GAP));
        if now < due {
            return false;
        }
        if !has_room {
            self.due = Some(now + GAP);
            return false;
        }
        (reported.is_reading, reported.is_last) = (true, job.is_over);
        self.due = None;
        true
    }

    /// Reports the rows that have changed. Returns `true` if they were the last ones.
    fn report_rows(
        &mut self,
        now: Time,
        rows: Result<&JobRows, &FarmFailure>,
        me: &AgentId,
        send: &mut Vec<Message>,
    ) -> bool {
        let Reported::Rows(reported) = &mut self.reported else { return false };
        reported.is_reading = false;
        self.last = Some(now);
        // A farm that does not answer now may do so later, unless the job is over.
        let Ok(rows) = rows else {
            if reported.is_last {
                send.push(talk::failure(&self.message, me, &self.wish, "the rows of the job cannot be read"));
            }
            return reported.is_last;
        };
        let rows = row_terms(rows, reported.zone);
        let is_changed =
            |(zone, row): &(&u32, &Term)| reported.rows.as_ref().is_none_or(|known| known.get(zone) != Some(row));
        let changed: Vec<Term> = rows.iter().filter(is_changed).map(|(_, row)| row.clone()).collect();
        if reported.rows.is_none() || !changed.is_empty() {
            let report = Term::call("=", [self.wish.clone(), Term::call("sequence", changed)]);
            send.push(talk::answer(&self.message, me, Performative::Inform, &[report]));
        }
        reported.rows = Some(rows);
        if reported.is_last {
            send.push(talk::over(&self.message, me));
        }
        reported.is_last
    }
}
