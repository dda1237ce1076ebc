//! Subscriptions to the yellow pages.
//!
//! A subscription is an entry of the store. It names the process that informs the subscriber, the revision up to which
//! it has sent updates, and the one up to which they have certainly arrived: no error was reported for some time. If that
//! process fails, another takes over and repeats all that is not confirmed; if a subscriber is unreachable, updates are
//! repeated for some time. So in the end a subscriber knows the current state, whatever fails. Updates may arrive twice.

use std::{collections::BTreeMap, time::Duration};

use super::{
    super::{
        ONTOLOGY,
        management::{DfAgentDescription, Function, ManagementContent, NotUnderstoodReason},
        ontology::{Object, agent_term, print_content, read_agent, read_content},
        service::{Change, Said, ServiceOutbox},
    },
    entry::{DfEntry, index, is_for, largest_of},
    subscription::{
        PATIENCE, SearchRequest, Subscription, SubscriptionState, SubscriptionUpdate, TRY_AGAIN_AFTER,
        UnreachableSubscriber,
    },
};
use crate::{AclMessage, AgentId, Performative, Revision, Time, sl, sl::Term, wire::Calendar};

/// Maximum number of subscriptions.
const SUBSCRIPTIONS_MAX: usize = 4096;
/// Maximum length of a subscriber's template, in bytes.
const WISH_BYTES_MAX: usize = 1 << 15;
/// Maximum number of attempts to enter a subscription against concurrent writes.
const TRIES_MAX: u32 = 3;
/// The mark of changes whose result is ignored.
pub(super) const NO_MARK: u64 = 0;

const PREFIX: &str = "df/subscription/";
const OBJECT: &str = "subscription";

/// The entries of a directory.
pub(super) struct Pages<'a> {
    /// The entries, by name in lower case.
    pub(super) entries: &'a BTreeMap<String, DfEntry>,
    /// Removed entries, with the revision of the removal.
    pub(super) gone: &'a BTreeMap<String, Revision>,
}

#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "few at a time, for as long as the store takes")]
enum Pending {
    Begin { message: Said, wish: SearchRequest, begun: Revision, tries: u32 },
    Move(String),
    End(Said),
}

#[derive(Clone, Debug)]
pub(super) struct DfSubscriptions {
    me: AgentId,
    /// The name of this process, kept over restarts.
    teller: String,
    calendar: Calendar,
    by_key: BTreeMap<String, Subscription>,
    pending: BTreeMap<u64, Pending>,
    next_mark: u64,
    /// The number of the next message to a subscriber.
    next_number: u64,
    /// False until all pages are known; nothing is sent before, because entries read may be old.
    pages_known: bool,
    /// The time of the next check.
    due: Option<Time>,
}

impl DfSubscriptions {
    pub(super) fn new(me: AgentId, calendar: Calendar) -> Self {
        let teller = me.addresses.first().map_or_else(|| me.name.to_string(), Clone::clone);
        Self {
            me,
            teller,
            calendar,
            by_key: BTreeMap::new(),
            pending: BTreeMap::new(),
            next_mark: NO_MARK + 1,
            next_number: 1,
            pages_known: false,
            due: None,
        }
    }

    fn key(message: &Said) -> String {
        format!("{PREFIX}{}/{}", index(&message.sender), message.conversation_id)
    }

    fn write(&mut self, pending: Pending, key: &str, text: String, todo: &mut ServiceOutbox) {
        let mark = self.next_mark;
        self.next_mark += 1;
        self.pending.insert(mark, pending);
        todo.writes.push((mark, Change { key: key.into(), text }));
    }

    /// Begins a subscription; one with too large a template is refused.
    ///
    /// - `newest`: the last known revision.
    pub(super) fn subscribe(
        &mut self,
        message: &Said,
        wish: SearchRequest,
        newest: Revision,
        todo: &mut ServiceOutbox,
    ) -> bool {
        let key = Self::key(message);
        if self.by_key.len() + self.pending.len() >= SUBSCRIPTIONS_MAX && !self.by_key.contains_key(&key) {
            todo.send.push(self.failure(message, wish, "no room for more subscriptions"));
            return true;
        }
        if print_content(self.calendar, &self.me, &message.content).len() > WISH_BYTES_MAX {
            let content = ManagementContent::Refused(
                Function::Search(wish.0.clone(), wish.1),
                largest_of(self.calendar, &wish.0),
            );
            todo.send.push(message.reply(Performative::Refuse, self.me.clone(), content));
            return true;
        }
        self.begin(message, wish, newest, 0, todo);
        true
    }

    fn begin(&mut self, message: &Said, wish: SearchRequest, begun: Revision, tries: u32, todo: &mut ServiceOutbox) {
        let standing = SubscriptionState {
            message: message.clone(),
            wish: wish.clone(),
            teller: self.teller.clone(),
            begun,
            sure: Revision::ABSENT,
            sent: Revision::ABSENT,
        };
        let text = self.print(&standing);
        self.write(Pending::Begin { message: message.clone(), wish, begun, tries }, &Self::key(message), text, todo);
    }

    fn failure(&self, message: &Said, wish: SearchRequest, why: &str) -> Said {
        let reason = super::FailureReason::InternalError(why.to_owned());
        let content = ManagementContent::Failed(Function::Search(wish.0, wish.1), reason);
        message.reply(Performative::Failure, self.me.clone(), content)
    }

    pub(super) fn cancel(&mut self, message: &Said, todo: &mut ServiceOutbox) -> bool {
        let key = Self::key(message);
        if self.by_key.contains_key(&key) {
            self.write(Pending::End(message.clone()), &key, String::new(), todo);
        } else {
            let reason = NotUnderstoodReason::UnexpectedAct(Performative::Cancel);
            let content = ManagementContent::NotUnderstood(reason);
            todo.send.push(message.reply(Performative::NotUnderstood, self.me.clone(), content));
        }
        true
    }

    /// Notes that the message with this number did not arrive.
    pub(super) fn lost(&mut self, now: Time, number: u64) {
        for subscription in self.by_key.values_mut() {
            let in_it = |update: &&mut SubscriptionUpdate| update.said.is_some_and(|(_, said)| said == number);
            let mut unsaid = subscription.updates.iter_mut().filter(in_it).peekable();
            if unsaid.peek().is_some() {
                unsaid.for_each(|update| update.said = None);
                let since = subscription.lost.map_or(now, |lost| lost.since);
                subscription.lost = Some(UnreachableSubscriber { since, again: now + TRY_AGAIN_AFTER });
                self.due = Some(now);
            }
        }
    }

    /// Notes that an offer is new, changed, or removed (then `after` has its name only).
    ///
    /// - `bytes`: length of its text.
    pub(super) fn changed(
        &mut self,
        now: Time,
        before: Option<&DfEntry>,
        (after, bytes): (&DfAgentDescription, usize),
        revision: Revision,
    ) {
        if !self.pages_known {
            return;
        }
        for subscription in self.by_key.values_mut() {
            let SubscriptionState { message, wish, sure, .. } = &subscription.standing;
            let fits = |offer: &DfAgentDescription| wish.0.matches(offer) && is_for(&self.me, &message.sender, offer);
            let was_like_it = before.is_some_and(|before| fits(&before.offer));
            // An offer that no longer matches is reported as removed
            let (offer, bytes) = match (fits(after), was_like_it) {
                (true, _) => (after.clone(), bytes),
                (false, true) => (DfAgentDescription { name: after.name.clone(), ..Default::default() }, 0),
                (false, false) => continue,
            };
            // The revision of an unnoticed removal is unknown
            let newest = subscription.updates.last().map_or(*sure, |update| update.revision);
            let revision = if revision == Revision::ABSENT { Revision(newest.0 + 1) } else { revision };
            if revision > *sure {
                subscription.add(SubscriptionUpdate { revision, offer, bytes, since: now, said: None });
                self.due = Some(now);
            }
        }
    }

    pub(super) fn settled(&mut self, now: Time, mark: u64, made: bool, todo: &mut ServiceOutbox) {
        self.due = Some(now);
        match self.pending.remove(&mark) {
            None => {}
            Some(Pending::Begin { .. }) if made => {}
            Some(Pending::Begin { message, wish, begun, tries }) if tries < TRIES_MAX => {
                self.begin(&message, wish, begun, tries + 1, todo);
            }
            Some(Pending::Begin { message, wish, .. }) => {
                todo.send.push(self.failure(&message, wish, "the store does not accept it"));
            }
            Some(Pending::Move(key)) => {
                if let Some(subscription) = self.by_key.get_mut(&key) {
                    subscription.is_written = false;
                }
            }
            Some(Pending::End(message)) => {
                // Failed: it was cancelled elsewhere, or was changed and still exists
                if self.by_key.contains_key(&Self::key(&message)) {
                    self.cancel(&message, todo);
                } else {
                    todo.send.push(message.reply(Performative::Inform, self.me.clone(), ManagementContent::Cancel));
                }
            }
        }
    }

    /// Does what is due: sends updates, records what was sent, takes over from other processes.
    pub(super) fn tick(&mut self, now: Time, todo: &mut ServiceOutbox) {
        if self.due.is_none_or(|due| now < due) {
            return;
        }
        let (mut moves, mut ends) = (Vec::new(), Vec::new());
        for (key, subscription) in &mut self.by_key {
            subscription.note_if_reached(now);
            if subscription.standing.teller != self.teller {
                if !subscription.is_written && subscription.take_over_at().is_some_and(|at| at <= now) {
                    moves.push((
                        key.clone(),
                        SubscriptionState { teller: self.teller.clone(), ..subscription.standing.clone() },
                    ));
                }
            } else if subscription.lost.is_some_and(|lost| lost.since + PATIENCE <= now) {
                ends.push(key.clone());
            } else {
                subscription.tell(now, &self.me, &mut self.next_number, todo);
                moves.extend(subscription.moved(now).map(|standing| (key.clone(), standing)));
            }
        }
        for (key, standing) in moves {
            let text = self.print(&standing);
            if let Some(subscription) = self.by_key.get_mut(&key) {
                subscription.is_written = true;
            }
            self.write(Pending::Move(key.clone()), &key, text, todo);
        }
        for key in ends {
            self.give_up(now, &key, todo);
        }
        let next = self.by_key.values().filter_map(|subscription| subscription.next_deadline(&self.teller)).min();
        self.due = next.map(|next| next.max(now + Duration::from_millis(1)));
    }

    /// Ends the subscription of an unreachable subscriber. The message probably does not arrive, but the gateway ends
    /// the thread.
    fn give_up(&mut self, now: Time, key: &str, todo: &mut ServiceOutbox) {
        let Some(subscription) = self.by_key.get_mut(key) else { return };
        // In case the store does not accept the change
        subscription.lost = Some(UnreachableSubscriber { since: now, again: now + TRY_AGAIN_AFTER });
        let SubscriptionState { message, wish, .. } = subscription.standing.clone();
        todo.send.push(self.failure(&message, wish, "you could not be reached"));
        todo.writes.push((NO_MARK, Change { key: key.into(), text: String::new() }));
    }

    pub(super) fn next_deadline(&self) -> Option<Time> {
        self.due
    }

    /// Takes in an entry of the store.
    pub(super) fn learn(&mut self, now: Time, key: &str, text: &str, pages: &Pages<'_>) {
        self.due = Some(now);
        let Some(standing) = self.parse(now, text).filter(|_| key.starts_with(PREFIX)) else {
            self.by_key.remove(key);
            return;
        };
        let begins = match self.by_key.get_mut(key) {
            Some(known) => {
                // A restarted process knows nothing, and one taken over from may have sent more than recorded
                let begins = standing.sure < known.standing.sure || standing.sent < known.standing.sent;
                if standing.teller != known.standing.teller {
                    // The process in charge gets its full time
                    known.updates.iter_mut().for_each(|update| (update.since, update.said) = (now, None));
                    known.lost = None;
                }
                known.updates.retain(|update| update.revision > standing.sure);
                known.standing = standing;
                begins
            }
            None => {
                let new = Subscription { standing, updates: Vec::new(), lost: None, is_written: false };
                self.by_key.insert(key.to_owned(), new);
                true
            }
        };
        if begins && self.pages_known {
            self.collect_updates(now, key, pages);
        }
    }

    /// Collects all updates that are not confirmed.
    fn collect_updates(&mut self, now: Time, key: &str, pages: &Pages<'_>) {
        let Some(subscription) = self.by_key.get_mut(key) else { return };
        let SubscriptionState { message, wish, begun, sure, .. } = &subscription.standing;
        let fits = |offer: &DfAgentDescription| wish.0.matches(offer) && is_for(&self.me, &message.sender, offer);
        let offered = pages.entries.values().filter(|entry| entry.revision > *sure && fits(&entry.offer));
        let offered = offered.map(|entry| (entry.revision, entry.offer.clone(), entry.bytes));
        // The removed offers are unknown: assume that they matched
        let gone = pages.gone.iter().filter(|(_, revision)| **revision > *sure.max(begun)).map(|(name, revision)| {
            let name = Some(AgentId::new(name.as_str()));
            (*revision, DfAgentDescription { name, ..Default::default() }, 0)
        });
        let updates = offered.chain(gone).map(|(revision, offer, bytes)| SubscriptionUpdate {
            revision,
            offer,
            bytes,
            since: now,
            said: None,
        });
        subscription.updates = updates.collect();
        subscription.updates.sort_by_key(|update| update.revision);
    }

    /// Notes that all pages are known: entries from now on are updates.
    pub(super) fn pages_are_known(&mut self, now: Time, pages: &Pages<'_>) {
        if std::mem::replace(&mut self.pages_known, true) {
            return;
        }
        for key in self.by_key.keys().cloned().collect::<Vec<_>>() {
            self.collect_updates(now, &key, pages);
        }
        self.due = Some(now);
    }

    fn print(&self, standing: &SubscriptionState) -> String {
        let SubscriptionState { message, wish, teller, begun, sure, sent } = standing;
        let content = ManagementContent::Subscription(wish.0.clone(), wish.1.clone());
        let wish = print_content(self.calendar, &self.me, &content);
        let number = |number: u64| Term::Bare(number.to_string());
        let key = |name: &str| Term::Bare(format!(":{name}"));
        sl::print_term(&Term::List(vec![
            Term::text(OBJECT),
            key("subscriber"),
            agent_term(&message.sender),
            key("conversation"),
            number(message.conversation_id),
            key("reply-with"),
            number(message.reply_with),
            key("teller"),
            Term::text(teller),
            key("begun"),
            number(begun.0),
            key("sure"),
            number(sure.0),
            key("told"),
            number(sent.0),
            key("wish"),
            Term::text(wish),
        ]))
    }

    fn parse(&self, now: Time, text: &str) -> Option<SubscriptionState> {
        let term = sl::parse_term(text).ok()?;
        let object = Object::read(OBJECT, &term).ok()?;
        let number = |name: &str| object.get(name)?.as_str()?.parse::<u64>().ok();
        let subscriber = read_agent(object.get("subscriber")?).ok()?;
        let wish = sl::parse(object.get("wish")?.as_str()?).ok()?;
        let content = read_content(self.calendar, now, Performative::Subscribe, &wish).ok()?;
        let ManagementContent::Subscription(template, constraints) = content.clone() else { return None };
        let message = Said {
            language: "fipa-sl",
            ontology: ONTOLOGY,
            protocol: "fipa-subscribe",
            conversation_id: number("conversation")?,
            reply_with: number("reply-with")?,
            ..AclMessage::new(Performative::Subscribe, subscriber, self.me.clone(), content)
        };
        Some(SubscriptionState {
            message,
            wish: (template, constraints),
            teller: object.get("teller")?.as_str()?.to_owned(),
            begun: Revision(number("begun")?),
            sure: Revision(number("sure")?),
            sent: Revision(number("told")?),
        })
    }
}
