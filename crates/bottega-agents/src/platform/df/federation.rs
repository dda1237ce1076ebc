//! Searches that go on to other directories.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use super::{
    super::{
        ONTOLOGY,
        management::{DfAgentDescription, Function, ManagementContent, Outcome, SearchConstraints, ServiceDescription},
        service::{Said, Todo},
    },
    RESULTS_MAX, index,
};
use crate::{AclMessage, AgentId, Performative, Time};

/// The most searches under way at a time; more are answered from this directory alone.
const SEARCHES_MAX: usize = 256;
/// The most directories that are asked for one search.
const DIRECTORIES_MAX: usize = 32;
/// The most searches whose names are remembered.
const SEEN_MAX: usize = 4096;
/// How long the name of a search is remembered.
const SEEN_FOR: Duration = Duration::from_secs(60);
/// How long to wait for other directories, and how much longer for each further hop that they may go: who is asked
/// must give up before who asks does.
const WAIT: Duration = Duration::from_secs(2);
const WAIT_A_HOP: Duration = Duration::from_secs(1);
/// When a directory that did not take this one in is asked again, and when one that did.
const TRY_AGAIN_AFTER: Duration = Duration::from_secs(5);
const RENEW_AFTER: Duration = Duration::from_secs(300);
/// More hops than that are not waited for.
const HOPS_MAX: u32 = 8;

#[derive(Clone, Debug)]
struct Search {
    request: Said,
    found: Vec<DfAgentDescription>,
    most: usize,
    /// Who has not answered yet.
    awaited: BTreeSet<AgentId>,
    until: Time,
}

/// A directory with which this one registers itself.
#[derive(Clone, Debug)]
struct Join {
    other: AgentId,
    /// In which it is asked at present.
    conversation: u64,
    again: Time,
}

#[derive(Clone, Debug)]
pub(super) struct Federation {
    me: AgentId,
    salt: u64,
    next: u64,
    joins: Vec<Join>,
    /// By the conversation in which others are asked.
    searches: BTreeMap<u64, Search>,
    seen: BTreeMap<String, Time>,
}

impl Federation {
    pub(super) fn new(me: AgentId, salt: u64, others: Vec<AgentId>) -> Self {
        let joins = others.into_iter().map(|other| Join { other, conversation: 0, again: Time::ZERO }).collect();
        Self { me, salt, next: 1, joins, searches: BTreeMap::new(), seen: BTreeMap::new() }
    }

    /// Whether a search of this name has been here, and remembers it.
    pub(super) fn has_seen(&mut self, now: Time, search_id: &str) -> bool {
        self.seen.retain(|_, until| now < *until);
        if self.seen.len() >= SEEN_MAX {
            // Rather none too many than a circle.
            return true;
        }
        self.seen.insert(search_id.to_owned(), now + SEEN_FOR).is_some()
    }

    /// Asks others too. `false`: there is nobody to ask.
    pub(super) fn search(
        &mut self,
        now: Time,
        request: &Said,
        found: &[DfAgentDescription],
        (template, constraints): (&DfAgentDescription, &SearchConstraints),
        others: &[AgentId],
        todo: &mut Todo,
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
            // A negative depth has no limit.
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
        let search = Search { request: request.clone(), found: found.to_vec(), most, awaited, until };
        self.searches.insert(conversation, search);
        true
    }

    /// Takes what another directory answers.
    pub(super) fn hear(&mut self, message: &Said, todo: &mut Todo) -> bool {
        use Performative as P;
        if !matches!(message.performative, P::Inform | P::Agree | P::Refuse | P::Failure | P::NotUnderstood) {
            return false;
        }
        if let Some(join) = self.joins.iter_mut().find(|join| join.conversation == message.conversation_id) {
            use super::super::management::FailureReason::AlreadyRegistered;
            let there = match &message.content {
                ManagementContent::Done(..) => true,
                ManagementContent::Failed(_, reason) => *reason == AlreadyRegistered,
                _ => false,
            };
            if there {
                join.again = join.again + RENEW_AFTER;
            }
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
                if search.found.len() < search.most && !search.found.iter().any(known) {
                    search.found.push(offer.clone());
                }
            }
        }
        if search.awaited.is_empty() || search.found.len() >= search.most {
            self.answer(message.conversation_id, todo);
        }
        true
    }

    /// A directory does not get what it was asked.
    pub(super) fn unreachable(&mut self, other: &AgentId, todo: &mut Todo) {
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

    fn answer(&mut self, conversation: u64, todo: &mut Todo) {
        let Some(search) = self.searches.remove(&conversation) else { return };
        let ManagementContent::Action(function) = &search.request.content else { return };
        let content = ManagementContent::Done(function.clone(), Outcome::Offers(search.found));
        todo.send.push(search.request.reply(Performative::Inform, self.me.clone(), content));
    }

    /// Registers this directory with the others, again and again: they may have started anew.
    fn join(&mut self, now: Time, todo: &mut Todo) {
        for join in self.joins.iter_mut().filter(|join| join.again <= now) {
            join.conversation = self.next;
            self.next += 1;
            join.again = now + TRY_AGAIN_AFTER;
            let content = ManagementContent::Action(Function::Register(directory(&self.me)));
            let message = AclMessage::new(Performative::Request, self.me.clone(), join.other.clone(), content);
            todo.send.push(Said {
                language: "fipa-sl0",
                ontology: ONTOLOGY,
                protocol: "fipa-request",
                conversation_id: join.conversation,
                reply_with: join.conversation,
                ..message
            });
        }
    }

    pub(super) fn look_at_the_clock(&mut self, now: Time, todo: &mut Todo) {
        self.join(now, todo);
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
        let joins = self.joins.iter().map(|join| join.again);
        self.searches.values().map(|search| search.until).chain(joins).min()
    }
}

/// A directory as others enter it.
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
