//! Federated searches, in other directories too.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use super::{
    super::{
        ONTOLOGY,
        management::{
            DfAgentDescription, FailureReason, Function, LifeCycleRequest, ManagementContent, Outcome,
            SearchConstraints, ServiceDescription,
        },
        ontology::df_description,
        service::{Said, ServiceOutbox},
    },
    entry::{RESULTS_BYTES_MAX, RESULTS_MAX, index},
};
use crate::{AclMessage, AgentId, Performative, Time, sl, wire::Calendar};

/// Maximum number of searches in progress; further ones are answered from this directory alone.
const SEARCHES_MAX: usize = 256;
/// Maximum number of directories queried for one search.
const DIRECTORIES_MAX: usize = 32;
/// Maximum number of search ids remembered.
const SEEN_MAX: usize = 4096;
/// Time for which a search id is remembered.
const SEEN_FOR: Duration = Duration::from_secs(60);
/// Time to wait for other directories, and additional time for each further hop: a directory must give up before the
/// one that asks it does.
const WAIT: Duration = Duration::from_secs(2);
const WAIT_A_HOP: Duration = Duration::from_secs(1);
/// Interval of registration at a directory that did not accept this one, and of checks at one that did.
const TRY_AGAIN_AFTER: Duration = Duration::from_secs(5);
const RENEW_AFTER: Duration = Duration::from_secs(300);
/// Lease of this directory's entries at others: a killed process cannot remove them.
const LEASE: Duration = Duration::from_secs(900);
/// Time to wait for other directories to remove the entry.
const LEAVE_WAIT: Duration = Duration::from_secs(3);
/// Maximum number of hops waited for.
const HOPS_MAX: u32 = 8;

#[derive(Clone, Debug)]
struct Search {
    request: Said,
    found: Vec<DfAgentDescription>,
    /// Length of their text, in bytes.
    bytes: usize,
    most: usize,
    /// Directories that have not answered.
    awaited: BTreeSet<AgentId>,
    until: Time,
}

/// A directory at which this one registers.
#[derive(Clone, Debug)]
struct Join {
    other: AgentId,
    /// The current conversation; 0: none yet.
    conversation: u64,
    again: Time,
    /// True if this directory is registered there, as far as known.
    is_there: bool,
    /// True if deregistration was requested and not answered.
    is_leaving: bool,
}

/// The state of leaving all other directories.
#[derive(Clone, Debug)]
struct PendingWithdrawal {
    /// The request to answer when done; `None`: answered.
    request: Option<Said>,
    until: Time,
}

#[derive(Clone, Debug)]
pub(super) struct Federation {
    me: AgentId,
    salt: u64,
    next: u64,
    joins: Vec<Join>,
    leaving: Option<PendingWithdrawal>,
    /// The searches, by the conversation with the other directories.
    searches: BTreeMap<u64, Search>,
    seen: BTreeMap<String, Time>,
}

impl Federation {
    pub(super) fn new(me: AgentId, salt: u64, others: Vec<AgentId>) -> Self {
        let join = |other| Join { other, conversation: 0, again: Time::ZERO, is_there: false, is_leaving: false };
        let joins = others.into_iter().map(join).collect();
        Self { me, salt, next: 1, joins, leaving: None, searches: BTreeMap::new(), seen: BTreeMap::new() }
    }

    /// Returns true if this search id was seen before, and remembers it.
    pub(super) fn has_seen(&mut self, now: Time, search_id: &str) -> bool {
        self.seen.retain(|_, until| now < *until);
        if self.seen.len() >= SEEN_MAX {
            // Rather miss results than search in circles
            return true;
        }
        self.seen.insert(search_id.to_owned(), now + SEEN_FOR).is_some()
    }

    /// Asks other directories. False if there are none.
    pub(super) fn search(
        &mut self,
        now: Time,
        request: &Said,
        found: &[DfAgentDescription],
        (template, constraints): (&DfAgentDescription, &SearchConstraints),
        others: &[AgentId],
        todo: &mut ServiceOutbox,
    ) -> bool {
        if others.is_empty() || self.searches.len() >= SEARCHES_MAX {
            return false;
        }
        let depth = constraints.max_depth.unwrap_or(0);
        let conversation = self.next;
        self.next += 1;
        let search_id = constraints.search_id.clone().unwrap_or_else(|| {
            let id = format!("{}-{:x}-{conversation}", self.me.name, self.salt);
            self.has_seen(now, &id);
            id
        });
        let most = constraints.results_max(RESULTS_MAX);
        let onward = SearchConstraints {
            // A negative depth means no limit
            max_depth: Some(if depth > 0 { depth - 1 } else { depth }),
            max_results: constraints.max_results.map(|_| most as i64),
            search_id: Some(search_id),
        };
        let hops = u32::try_from(depth).map_or(HOPS_MAX, |depth| depth.min(HOPS_MAX));
        let until = now + WAIT + WAIT_A_HOP * hops;
        let awaited: BTreeSet<AgentId> = others.iter().take(DIRECTORIES_MAX).cloned().collect();
        for other in &awaited {
            let content = ManagementContent::Action(Function::Search(template.clone(), onward.clone()));
            let message = AclMessage::new(Performative::Request, self.me.clone(), other.clone(), content);
            todo.send.push(Said {
                language: "fipa-sl0",
                ontology: ONTOLOGY,
                protocol: "fipa-request",
                conversation_id: conversation,
                reply_with: conversation,
                reply_by: Some(until),
                ..message
            });
        }
        let bytes = found.iter().map(bytes_of).sum();
        let search = Search { request: request.clone(), found: found.to_vec(), bytes, most, awaited, until };
        self.searches.insert(conversation, search);
        true
    }

    /// Handles the answer of another directory.
    pub(super) fn hear(&mut self, now: Time, message: &Said, todo: &mut ServiceOutbox) -> bool {
        use Performative as P;
        if !matches!(message.performative, P::Inform | P::Agree | P::Refuse | P::Failure | P::NotUnderstood) {
            return false;
        }
        if let Some(join) = self.joins.iter_mut().find(|join| join.conversation == message.conversation_id) {
            if message.performative != P::Agree {
                join.hear(now, &message.content);
            }
            self.tell_if_left(todo);
            return true;
        }
        let Some(search) = self.searches.get_mut(&message.conversation_id) else { return true };
        let sender = search.awaited.iter().find(|other| index(other) == index(&message.sender)).cloned();
        let Some(sender) = sender.filter(|_| message.performative != P::Agree) else { return true };
        search.awaited.remove(&sender);
        if let ManagementContent::Done(_, Outcome::Offers(offers)) = &message.content {
            for offer in offers {
                let known =
                    |other: &DfAgentDescription| other.name.as_ref().map(index) == offer.name.as_ref().map(index);
                let bytes = search.bytes + bytes_of(offer);
                if search.found.len() < search.most && bytes <= RESULTS_BYTES_MAX && !search.found.iter().any(known) {
                    search.found.push(offer.clone());
                    search.bytes = bytes;
                }
            }
        }
        if search.awaited.is_empty() || search.found.len() >= search.most {
            self.answer(message.conversation_id, todo);
        }
        true
    }

    /// Notes that a directory is unreachable.
    pub(super) fn unreachable(&mut self, other: &AgentId, todo: &mut ServiceOutbox) {
        for join in self.joins.iter_mut().filter(|join| index(&join.other) == index(other)) {
            join.is_leaving = false;
        }
        self.tell_if_left(todo);
        let mut done = Vec::new();
        for (conversation, search) in &mut self.searches {
            search.awaited.retain(|awaited| index(awaited) != index(other));
            if search.awaited.is_empty() {
                done.push(*conversation);
            }
        }
        for conversation in done {
            self.answer(conversation, todo);
        }
    }

    fn answer(&mut self, conversation: u64, todo: &mut ServiceOutbox) {
        let Some(search) = self.searches.remove(&conversation) else { return };
        let ManagementContent::Action(function) = &search.request.content else { return };
        let content = ManagementContent::Done(function.clone(), Outcome::Offers(search.found));
        todo.send.push(search.request.reply(Performative::Inform, self.me.clone(), content));
    }

    /// Registers at the other directories, repeatedly: they may have restarted, and leases end.
    fn join(&mut self, now: Time, todo: &mut ServiceOutbox) {
        if self.leaving.is_some() {
            return;
        }
        let entry = DfAgentDescription { lease_time: Some(now + LEASE), ..directory(&self.me) };
        for join in self.joins.iter_mut().filter(|join| join.again <= now) {
            join.again = now + TRY_AGAIN_AFTER;
            let function =
                if join.is_there { Function::Modify(entry.clone()) } else { Function::Register(entry.clone()) };
            join.ask(&self.me, &mut self.next, function, todo);
        }
    }

    /// Deregisters from the other directories permanently; `request` is answered when that is done, or takes too long.
    pub(super) fn leave(&mut self, now: Time, request: &Said, todo: &mut ServiceOutbox) {
        self.leaving = Some(PendingWithdrawal { request: Some(request.clone()), until: now + LEAVE_WAIT });
        // A directory may have accepted this one even without an answer
        for join in self.joins.iter_mut().filter(|join| join.conversation != 0) {
            join.is_leaving = true;
            let entry = DfAgentDescription { name: Some(self.me.clone()), ..DfAgentDescription::default() };
            join.ask(&self.me, &mut self.next, Function::Deregister(entry), todo);
        }
        self.tell_if_left(todo);
    }

    fn tell_if_left(&mut self, todo: &mut ServiceOutbox) {
        if self.joins.iter().any(|join| join.is_leaving) {
            return;
        }
        if let Some(request) = self.leaving.as_mut().and_then(|leaving| leaving.request.take()) {
            let content = ManagementContent::LifeCycleDone(LifeCycleRequest::Quit);
            todo.send.push(request.reply(Performative::Inform, self.me.clone(), content));
        }
    }

    pub(super) fn look_at_the_clock(&mut self, now: Time, todo: &mut ServiceOutbox) {
        self.join(now, todo);
        if self.leaving.as_ref().is_some_and(|leaving| leaving.until <= now) {
            self.joins.iter_mut().for_each(|join| join.is_leaving = false);
            self.tell_if_left(todo);
        }
        let late: Vec<u64> = self
            .searches
            .iter()
            .filter(|(_, search)| search.until <= now)
            .map(|(conversation, _)| *conversation)
            .collect();
        for conversation in late {
            self.answer(conversation, todo);
        }
    }

    pub(super) fn next_deadline(&self) -> Option<Time> {
        let searches = self.searches.values().map(|search| search.until).min();
        let own = match &self.leaving {
            None => self.joins.iter().map(|join| join.again).min(),
            Some(leaving) => leaving.request.as_ref().map(|_| leaving.until),
        };
        searches.into_iter().chain(own).min()
    }
}

impl Join {
    /// Sends a request to the other directory, in a new conversation.
    fn ask(&mut self, me: &AgentId, next: &mut u64, function: Function, todo: &mut ServiceOutbox) {
        self.conversation = *next;
        *next += 1;
        let content = ManagementContent::Action(function);
        let message = AclMessage::new(Performative::Request, me.clone(), self.other.clone(), content);
        todo.send.push(Said {
            language: "fipa-sl0",
            ontology: ONTOLOGY,
            protocol: "fipa-request",
            conversation_id: self.conversation,
            reply_with: self.conversation,
            ..message
        });
    }

    /// Handles its answer. Failed requests are repeated soon.
    fn hear(&mut self, now: Time, answer: &ManagementContent) {
        if std::mem::replace(&mut self.is_leaving, false) {
            return;
        }
        match answer {
            ManagementContent::Done(_, outcome) => {
                self.is_there = true;
                let granted = match outcome {
                    Outcome::Entered(granted) => granted.lease_time,
                    _ => None,
                };
                let half = granted.map_or(RENEW_AFTER, |end| end.since(now) / 2);
                self.again = now + half.clamp(TRY_AGAIN_AFTER, RENEW_AFTER);
            }
            ManagementContent::Failed(_, FailureReason::AlreadyRegistered) => self.is_there = true,
            ManagementContent::Failed(_, FailureReason::NotRegistered) => self.is_there = false,
            _ => {}
        }
    }
}

/// Returns the length of an offer's text; dates have the same length in any calendar.
fn bytes_of(offer: &DfAgentDescription) -> usize {
    sl::print_term(&df_description(Calendar::default(), offer)).len()
}

/// Returns the offer with which a directory registers at others.
pub(super) fn directory(df: &AgentId) -> DfAgentDescription {
    let service = ServiceDescription {
        name: Some("df".to_owned()),
        service_type: Some("fipa-df".to_owned()),
        protocols: vec!["fipa-request".to_owned()],
        ontologies: vec![ONTOLOGY.to_owned()],
        languages: vec!["fipa-sl0".to_owned()],
        ..ServiceDescription::default()
    };
    DfAgentDescription { name: Some(df.clone()), services: vec![service], ..DfAgentDescription::default() }
}
