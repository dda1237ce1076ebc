//! Who wants to be told of offers.
//!
//! A subscription is an entry of the store that says up to which revision its subscriber was told. A replica that has
//! news moves that revision on first, and tells only if it was the one who moved it: so each change is told once, by
//! whichever replica lives, and a directory that starts again tells what was missed. (A replica that dies between the
//! two leaves that one change untold.)

use std::collections::BTreeMap;

use super::{
    super::{
        ONTOLOGY,
        management::{DfAgentDescription, Function, ManagementContent, NotUnderstoodReason, SearchConstraints},
        ontology::{Object, agent_term, print_content, read_agent, read_content},
        service::{Change, Said, Todo},
    },
    Entry, RESULTS_MAX, index, is_for,
};
use crate::{AclMessage, AgentId, Performative, Revision, Time, sl, sl::Term, wire::Calendar};

/// The most subscriptions at a time.
const SUBSCRIPTIONS_MAX: usize = 4096;
/// The most news that wait to be told to one subscriber; the oldest are dropped.
const NEWS_MAX: usize = 1024;
/// The mark of changes of which nobody needs to hear.
pub(super) const NO_MARK: u64 = 0;

const PREFIX: &str = "df/subscription/";
const OBJECT: &str = "subscription";

type Wish = (DfAgentDescription, SearchConstraints);

#[derive(Clone, Debug)]
struct Subscription {
    /// The message that began it, of which the answers are made.
    wish_message: Said,
    wish: Wish,
    /// Up to which revision the subscriber was told, as far as this replica is sure.
    told: Revision,
    /// The same, as the store has it.
    stored: Revision,
    /// Not told yet, in order of revision.
    news: Vec<(Revision, DfAgentDescription)>,
    /// Up to which revision this replica is about to tell.
    claim: Option<Revision>,
}

#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "few at a time, for as long as the store takes")]
enum Pending {
    Begin { message: Said, wish: Wish, found: Vec<DfAgentDescription> },
    Tell(String),
    End(Said),
}

#[derive(Clone, Debug)]
pub(super) struct Subscriptions {
    me: AgentId,
    calendar: Calendar,
    by_key: BTreeMap<String, Subscription>,
    pending: BTreeMap<u64, Pending>,
    next_mark: u64,
    /// Before all pages are known nothing is told: what is read may be old news.
    pages_known: bool,
}

impl Subscriptions {
    pub(super) fn new(me: AgentId, calendar: Calendar) -> Self {
        Self {
            me,
            calendar,
            by_key: BTreeMap::new(),
            pending: BTreeMap::new(),
            next_mark: NO_MARK + 1,
            pages_known: false,
        }
    }

    fn key(message: &Said) -> String {
        format!("{PREFIX}{}/{}", index(&message.sender), message.conversation_id)
    }

    fn write(&mut self, pending: Pending, key: &str, text: String, todo: &mut Todo) {
        let mark = self.next_mark;
        self.next_mark += 1;
        self.pending.insert(mark, pending);
        todo.writes.push((mark, Change { key: key.into(), text }));
    }

    pub(super) fn subscribe(
        &mut self,
        message: &Said,
        wish: Wish,
        found: Vec<DfAgentDescription>,
        newest: Revision,
        todo: &mut Todo,
    ) -> bool {
        let key = Self::key(message);
        if self.by_key.len() + self.pending.len() >= SUBSCRIPTIONS_MAX && !self.by_key.contains_key(&key) {
            let reason = super::FailureReason::InternalError("no room for more subscriptions".to_owned());
            let content = ManagementContent::Failed(Function::Search(wish.0, wish.1), reason);
            todo.send.push(message.reply(Performative::Failure, self.me.clone(), content));
            return true;
        }
        let text = self.print(message, &wish, newest);
        self.write(Pending::Begin { message: message.clone(), wish, found }, &key, text, todo);
        true
    }

    pub(super) fn cancel(&mut self, message: &Said, todo: &mut Todo) -> bool {
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

    /// Ends all subscriptions of one who cannot be reached.
    pub(super) fn forget(&mut self, subscriber: &AgentId, todo: &mut Todo) {
        for (key, subscription) in &self.by_key {
            if index(&subscription.wish_message.sender) == index(subscriber) {
                todo.writes.push((NO_MARK, Change { key: key.as_str().into(), text: String::new() }));
            }
        }
    }

    /// An offer is new, another, or gone (then `after` has its name alone).
    pub(super) fn changed(
        &mut self,
        before: Option<&Entry>,
        after: &DfAgentDescription,
        revision: Revision,
        todo: &mut Todo,
    ) {
        if !self.pages_known {
            return;
        }
        for subscription in self.by_key.values_mut() {
            let template = &subscription.wish.0;
            let subscriber = &subscription.wish_message.sender;
            let fits = |offer: &DfAgentDescription| template.matches(offer) && is_for(&self.me, subscriber, offer);
            let was_like_it = before.is_some_and(|before| fits(&before.offer));
            let is_like_it = fits(after);
            // What is not like it any more is told as gone.
            let news = match (is_like_it, was_like_it) {
                (true, _) => after.clone(),
                (false, true) => DfAgentDescription { name: after.name.clone(), ..Default::default() },
                (false, false) => continue,
            };
            // Of an entry that was found to be gone nobody knows by which write.
            let absent = revision == Revision::ABSENT;
            let revision = if absent { Revision(subscription.last_known().0 + 1) } else { revision };
            if revision > subscription.told {
                subscription.news.push((revision, news));
                if subscription.news.len() > NEWS_MAX {
                    subscription.news.remove(0);
                }
            }
        }
        self.claim_news(todo);
    }

    /// Moves on what is told of each subscription that has news.
    fn claim_news(&mut self, todo: &mut Todo) {
        let mut claims = Vec::new();
        for (key, subscription) in &mut self.by_key {
            subscription.news.retain(|(revision, _)| *revision > subscription.told);
            if let Some((newest, _)) = subscription.news.last()
                && subscription.claim.is_none()
            {
                subscription.claim = Some(*newest);
                claims.push((key.clone(), *newest));
            }
        }
        for (key, newest) in claims {
            let Some(subscription) = self.by_key.get(&key) else { continue };
            let text = self.print(&subscription.wish_message, &subscription.wish, newest);
            self.write(Pending::Tell(key.clone()), &key, text, todo);
        }
    }

    pub(super) fn settled(&mut self, mark: u64, made: bool, todo: &mut Todo) {
        match self.pending.remove(&mark) {
            None => {}
            Some(Pending::Begin { message, wish, found }) => {
                if made {
                    self.tell(&message, &wish, found, todo);
                } else {
                    let reason = super::FailureReason::InternalError("the store does not take it".to_owned());
                    let content = ManagementContent::Failed(Function::Search(wish.0, wish.1), reason);
                    todo.send.push(message.reply(Performative::Failure, self.me.clone(), content));
                }
            }
            Some(Pending::Tell(key)) => {
                let Some(subscription) = self.by_key.get_mut(&key) else { return };
                let claim = subscription.claim.take();
                subscription.told = claim.filter(|_| made).unwrap_or(subscription.stored);
                if let Some(claim) = claim.filter(|_| made) {
                    let mine = subscription.news.extract_if(.., |(revision, _)| *revision <= claim);
                    let offers: Vec<DfAgentDescription> = mine.map(|(_, offer)| offer).collect();
                    let (message, wish) = (subscription.wish_message.clone(), subscription.wish.clone());
                    self.tell(&message, &wish, offers, todo);
                }
                self.claim_news(todo);
            }
            Some(Pending::End(message)) => {
                // Not made: it was cancelled elsewhere, or changed and is still there.
                if self.by_key.contains_key(&Self::key(&message)) {
                    self.cancel(&message, todo);
                } else {
                    todo.send.push(message.reply(Performative::Inform, self.me.clone(), ManagementContent::Cancel));
                }
            }
        }
    }

    fn tell(&self, message: &Said, wish: &Wish, mut offers: Vec<DfAgentDescription>, todo: &mut Todo) {
        offers.truncate(wish.1.results_max(RESULTS_MAX));
        if offers.is_empty() {
            return;
        }
        let content = ManagementContent::News(wish.0.clone(), wish.1.clone(), offers);
        todo.send.push(message.reply(Performative::Inform, self.me.clone(), content));
    }

    /// Takes over an entry of the store.
    pub(super) fn learn(
        &mut self,
        now: Time,
        key: &str,
        text: &str,
        entries: &BTreeMap<String, Entry>,
        todo: &mut Todo,
    ) {
        let Some((message, wish, told)) = self.parse(now, text).filter(|_| key.starts_with(PREFIX)) else {
            self.by_key.remove(key);
            return;
        };
        match self.by_key.get_mut(key) {
            Some(known) => {
                known.wish_message = message;
                known.wish = wish;
                known.stored = told;
                // While this replica claims, it does not know yet whether it was the one who moved on.
                if known.claim.is_none() {
                    known.told = told;
                    known.news.retain(|(revision, _)| *revision > told);
                }
            }
            None => {
                let new =
                    Subscription { wish_message: message, wish, told, stored: told, news: Vec::new(), claim: None };
                self.by_key.insert(key.to_owned(), new);
                if self.pages_known {
                    self.look_for_news(key, entries);
                }
            }
        }
        if self.pages_known {
            self.claim_news(todo);
        }
    }

    /// What was entered after the subscriber was last told.
    fn look_for_news(&mut self, key: &str, entries: &BTreeMap<String, Entry>) {
        let Some(subscription) = self.by_key.get_mut(key) else { return };
        let missed = entries.values().filter(|entry| entry.revision > subscription.told);
        let subscriber = &subscription.wish_message.sender;
        let missed = missed.filter(|entry| subscription.wish.0.matches(&entry.offer));
        let missed = missed.filter(|entry| is_for(&self.me, subscriber, &entry.offer));
        subscription.news = missed.map(|entry| (entry.revision, entry.offer.clone())).collect();
        subscription.news.sort_by_key(|(revision, _)| *revision);
    }

    /// From now on all that is learned is new.
    pub(super) fn pages_are_known(&mut self, entries: &BTreeMap<String, Entry>, todo: &mut Todo) {
        if std::mem::replace(&mut self.pages_known, true) {
            return;
        }
        for key in self.by_key.keys().cloned().collect::<Vec<_>>() {
            self.look_for_news(&key, entries);
        }
        self.claim_news(todo);
    }

    fn print(&self, message: &Said, wish: &Wish, told: Revision) -> String {
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
            key("told"),
            number(told.0),
            key("wish"),
            Term::text(wish),
        ]))
    }

    fn parse(&self, now: Time, text: &str) -> Option<(Said, Wish, Revision)> {
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
        Some((message, (template, constraints), Revision(number("told")?)))
    }
}

impl Subscription {
    /// The last revision of which there is news.
    fn last_known(&self) -> Revision {
        self.news.last().map_or(self.told, |(revision, _)| *revision)
    }
}
