//! The Directory Facilitator: yellow pages with leases (FIPA00023).

mod entry;
mod federation;
mod subscription;
mod subscriptions;

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

pub use entry::{DESCRIPTION_BYTES_MAX, RESULTS_BYTES_MAX, RESULTS_MAX, read_yellow_page};
use entry::{DfEntry, ENTRY, holds, index, is_for, key, largest_of};
use federation::Federation;
use subscriptions::{DfSubscriptions, Pages};

use super::{
    management::{
        DfAgentDescription, FailureReason, Function, LifeCycleRequest, ManagementContent, Outcome, RefuseReason,
        SearchConstraints,
    },
    ontology::{DF_DESCRIPTION, SERVICE_DESCRIPTION, df_description},
    service::{Change, Functions, NoResult, Said, ServiceOutbox, Step},
    signature::signed,
};
use crate::{AgentId, Key, Performative, Revision, Time, sl, wire::Calendar};

/// Maximum number of entries of a directory.
pub const DESCRIPTIONS_MAX: usize = 1 << 16;
/// Maximum length of all entries together, in bytes of text.
pub const DIRECTORY_BYTES_MAX: usize = 1 << 28;

/// Maximum time after the end of a lease until its entry is removed.
const SWEEP_AFTER: Duration = Duration::from_secs(1);

/// The configuration of a DF: its leases, and the directories with which it is federated.
#[derive(Clone, Debug)]
pub struct DfConfig {
    /// The identifier of the DF itself.
    pub id: AgentId,
    /// The calendar of the platform, for leases.
    pub calendar: Calendar,
    /// Maximum lease granted; an offer without a lease gets this one. `None`: any, including unlimited.
    pub lease_max: Option<Duration>,
    /// Agents that may register, modify and deregister offers of others.
    pub administrators: Vec<AgentId>,
    /// Directories at which the directory registers, and which it asks in federated searches.
    pub federates: Vec<AgentId>,
    /// Number that makes the directory's search ids differ from those of other processes.
    pub salt: u64,
}

/// The yellow pages: the offers of agents, and the functions of the DF. An agent may register, modify and deregister
/// its own offers only; `administrators` may do that for all.
#[derive(Clone, Debug)]
pub struct Df {
    config: DfConfig,
    /// The entries, by name in lower case.
    entries: BTreeMap<String, DfEntry>,
    /// Length of the text of all entries, in bytes.
    bytes: usize,
    /// Removed entries, with the revision of the removal.
    gone: BTreeMap<String, Revision>,
    /// Entries whose lease has ended, being removed.
    ending: BTreeSet<String>,
    /// The next time to check leases.
    sweep_at: Option<Time>,
    newest: Revision,
    subscriptions: DfSubscriptions,
    federation: Federation,
}

impl Df {
    /// Makes a directory without entries. The service that runs it reads the entries from the store when it starts.
    pub fn new(config: DfConfig) -> Self {
        let subscriptions = DfSubscriptions::new(config.id.clone(), config.calendar);
        let federation = Federation::new(config.id.clone(), config.salt, config.federates.clone());
        Self {
            config,
            entries: BTreeMap::new(),
            bytes: 0,
            gone: BTreeMap::new(),
            ending: BTreeSet::new(),
            sweep_at: None,
            newest: Revision::ABSENT,
            subscriptions,
            federation,
        }
    }

    fn is_administrator(&self, agent: &AgentId) -> bool {
        self.config.administrators.iter().any(|other| index(other) == index(agent))
    }

    fn own_name(&self, asker: &AgentId, description: &DfAgentDescription) -> Result<AgentId, NoResult> {
        match &description.name {
            None => Err(RefuseReason::missing(DF_DESCRIPTION, "name").into()),
            Some(name) if index(name) == index(asker) || self.is_administrator(asker) => Ok(name.clone()),
            Some(_) => Err(RefuseReason::Unauthorised.into()),
        }
    }

    /// Registers an offer, with the lease that is granted.
    fn enter(
        &self,
        now: Time,
        request: &Said,
        name: &AgentId,
        description: &DfAgentDescription,
    ) -> Result<Step, NoResult> {
        for service in &description.services {
            for (missing, parameter) in [(service.name.is_none(), "name"), (service.service_type.is_none(), "type")] {
                if missing {
                    return Err(RefuseReason::missing(SERVICE_DESCRIPTION, parameter).into());
                }
            }
        }
        if description.lease_time.is_some_and(|end| end <= now) {
            return Err(RefuseReason::bad_value(DF_DESCRIPTION, "lease-time").into());
        }
        let most = self.config.lease_max.map(|lease| now + lease);
        let lease_time = match (description.lease_time, most) {
            (Some(wanted), Some(most)) => Some(wanted.min(most)),
            (wanted, most) => wanted.or(most),
        };
        let entry = DfAgentDescription { lease_time, ..description.clone() };
        let text = sl::print_term(&signed(df_description(self.config.calendar, &entry), request));
        Ok(Step::Write(Change { key: key(name).into(), text }, Outcome::Entered(entry)))
    }

    /// Returns the entry of an agent, if its lease has not ended.
    fn entry(&self, now: Time, name: &AgentId) -> Option<&DfEntry> {
        self.entries.get(&index(name)).filter(|entry| holds(&entry.offer, now))
    }

    fn matching(
        &self,
        now: Time,
        asker: &AgentId,
        template: &DfAgentDescription,
        most: usize,
    ) -> Vec<DfAgentDescription> {
        let held = self.entries.values().filter(|entry| holds(&entry.offer, now));
        let seen = held.filter(|entry| is_for(&self.config.id, asker, &entry.offer));
        let found = seen.filter(|entry| template.matches(&entry.offer)).take(most);
        let mut bytes = 0;
        let fitting = found.filter(|entry| {
            let fits = bytes + entry.bytes <= RESULTS_BYTES_MAX;
            bytes += if fits { entry.bytes } else { 0 };
            fits
        });
        fitting.map(|entry| entry.offer.clone()).collect()
    }

    fn search(
        &mut self,
        now: Time,
        request: &Said,
        template: &DfAgentDescription,
        constraints: &SearchConstraints,
        todo: &mut ServiceOutbox,
    ) -> Step {
        let most = constraints.results_max(RESULTS_MAX);
        if constraints.search_id.as_ref().is_some_and(|id| self.federation.has_seen(now, id)) {
            return Step::Done(Outcome::Offers(Vec::new()));
        }
        let found = self.matching(now, &request.sender, template, most);
        let wants_more = constraints.max_depth.unwrap_or(0) != 0 && found.len() < most;
        if wants_more {
            let others: Vec<AgentId> = self.directories(now, &request.sender);
            if self.federation.search(now, request, &found, (template, constraints), &others, todo) {
                return Step::Later;
            }
        }
        Step::Done(Outcome::Offers(found))
    }

    /// Returns the directories registered here, except this one and the one that asks.
    fn directories(&self, now: Time, asker: &AgentId) -> Vec<AgentId> {
        let is_directory = |offer: &DfAgentDescription| {
            let mut types = offer.services.iter().filter_map(|service| service.service_type.as_deref());
            types.any(|kind| kind.eq_ignore_ascii_case("fipa-df"))
        };
        let held = self.entries.values().map(|entry| &entry.offer).filter(|offer| holds(offer, now));
        let entered = held.filter(|offer| is_directory(offer)).filter_map(|offer| offer.name.clone());
        let mut others: BTreeMap<String, AgentId> = entered.map(|name| (index(&name), name)).collect();
        others.extend(self.config.federates.iter().map(|other| (index(other), other.clone())));
        others.remove(&index(asker));
        others.remove(&index(&self.config.id));
        others.into_values().collect()
    }

    fn sweep(&mut self, now: Time, todo: &mut ServiceOutbox) {
        for (name, entry) in &self.entries {
            if !holds(&entry.offer, now) && self.ending.insert(name.clone()) {
                let change = Change { key: format!("{ENTRY}{name}").into(), text: String::new() };
                todo.writes.push((subscriptions::NO_MARK, change));
            }
        }
        let ends = self.entries.iter().filter(|(name, _)| !self.ending.contains(*name));
        self.sweep_at = ends.filter_map(|(_, entry)| entry.offer.lease_time).min();
        // Check pending removals again, in case they failed
        if !self.ending.is_empty() {
            let again = now + SWEEP_AFTER;
            self.sweep_at = Some(self.sweep_at.map_or(again, |at| at.min(again)));
            self.ending.clear();
        }
    }
}

impl Df {
    fn entered(&mut self, now: Time, name: &str, entry: DfEntry) {
        if let Some(end) = entry.offer.lease_time {
            self.sweep_at = Some(self.sweep_at.map_or(end, |at| at.min(end)));
        }
        self.gone.remove(name);
        let (offer, revision, bytes) = (entry.offer.clone(), entry.revision, entry.bytes);
        let before = self.entries.insert(name.to_owned(), entry);
        self.bytes = self.bytes + bytes - before.as_ref().map_or(0, |before| before.bytes);
        self.subscriptions.changed(now, before.as_ref(), (&offer, bytes), revision);
    }

    fn taken_out(&mut self, now: Time, name: &str, revision: Revision) {
        if revision != Revision::ABSENT {
            if self.gone.len() >= DESCRIPTIONS_MAX {
                self.gone.pop_first();
            }
            self.gone.insert(name.to_owned(), revision);
        }
        if let Some(before) = self.entries.remove(name) {
            self.bytes -= before.bytes;
            let gone = DfAgentDescription { name: before.offer.name.clone(), ..Default::default() };
            self.subscriptions.changed(now, Some(&before), (&gone, 0), revision);
        }
    }
}

impl Functions for Df {
    const PREFIXES: &'static [&'static str] = &["df/"];
    const ENTRY_BYTES_MAX: usize = DESCRIPTION_BYTES_MAX;

    fn learn(&mut self, now: Time, key: &str, revision: Revision, text: &str, _todo: &mut ServiceOutbox) {
        self.newest = self.newest.max(revision);
        let Some(name) = key.strip_prefix(ENTRY) else {
            let pages = Pages { entries: &self.entries, gone: &self.gone };
            self.subscriptions.learn(now, key, text, &pages);
            return;
        };
        self.ending.remove(name);
        match DfEntry::parse(self.config.calendar, now, revision, text) {
            Some(entry) => self.entered(now, name, entry),
            None => self.taken_out(now, name, revision),
        }
    }

    fn perform(
        &mut self,
        now: Time,
        request: &Said,
        function: &Function,
        todo: &mut ServiceOutbox,
    ) -> Result<Step, NoResult> {
        let asker = &request.sender;
        match function {
            Function::Register(description) => {
                let name = self.own_name(asker, description)?;
                match self.entry(now, &name) {
                    Some(entry) if entry.is_by(request, description) => {
                        return Ok(Step::Done(Outcome::Entered(entry.offer.clone())));
                    }
                    Some(_) => return Err(FailureReason::AlreadyRegistered.into()),
                    None => {}
                }
                if self.entries.len() >= DESCRIPTIONS_MAX || self.bytes >= DIRECTORY_BYTES_MAX {
                    return Err(FailureReason::InternalError("no room for more entries".to_owned()).into());
                }
                self.enter(now, request, &name, description)
            }
            Function::Modify(description) => {
                let name = self.own_name(asker, description)?;
                self.entry(now, &name).ok_or(FailureReason::NotRegistered)?;
                self.enter(now, request, &name, description)
            }
            Function::Deregister(description) => {
                let name = self.own_name(asker, description)?;
                self.entry(now, &name).ok_or(FailureReason::NotRegistered)?;
                Ok(Step::Write(Change { key: key(&name).into(), text: String::new() }, Outcome::Done))
            }
            Function::Search(template, constraints) => Ok(self.search(now, request, template, constraints, todo)),
            other => Err(RefuseReason::UnsupportedFunction(other.word().into()).into()),
        }
    }

    fn too_large(&self, function: &Function) -> RefuseReason {
        let (Function::Register(offer) | Function::Modify(offer)) = function else {
            return RefuseReason::UnsupportedFunction(function.word().into());
        };
        largest_of(self.config.calendar, offer)
    }

    fn entry_of(&self, function: &Function) -> Option<Key> {
        match function {
            Function::Register(offer) | Function::Modify(offer) | Function::Deregister(offer) => {
                offer.name.as_ref().map(|name| key(name).into())
            }
            _ => None,
        }
    }

    fn hear(&mut self, now: Time, message: &Said, todo: &mut ServiceOutbox) -> bool {
        match (&message.content, message.performative) {
            (ManagementContent::Subscription(template, constraints), Performative::Subscribe) => {
                let wish = (template.clone(), constraints.clone());
                self.subscriptions.subscribe(message, wish, self.newest, todo)
            }
            (ManagementContent::Cancel, Performative::Cancel) => self.subscriptions.cancel(message, todo),
            (ManagementContent::Undelivered { receiver, .. }, Performative::Failure) => {
                self.federation.unreachable(receiver, todo);
                self.subscriptions.lost(now, message.in_reply_to);
                true
            }
            // Before its process ends. Messages from outside cannot contain this: see the gateway.
            (ManagementContent::LifeCycle(LifeCycleRequest::Quit), Performative::Request) => {
                self.federation.leave(now, message, todo);
                true
            }
            _ => self.federation.hear(now, message, todo),
        }
    }

    fn settled(&mut self, now: Time, mark: u64, made: bool, todo: &mut ServiceOutbox) {
        self.subscriptions.settled(now, mark, made, todo);
    }

    fn tick(&mut self, now: Time, todo: &mut ServiceOutbox) {
        self.subscriptions.pages_are_known(now, &Pages { entries: &self.entries, gone: &self.gone });
        self.subscriptions.tick(now, todo);
        if self.sweep_at.is_none_or(|at| at <= now) {
            self.sweep(now, todo);
        }
        self.federation.look_at_the_clock(now, todo);
    }

    fn next_deadline(&self) -> Option<Time> {
        let others = [self.subscriptions.next_deadline(), self.federation.next_deadline()];
        self.sweep_at.into_iter().chain(others.into_iter().flatten()).min()
    }
}
