//! The Agent Management System: white pages and life cycle (FIPA00023).

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use super::{
    LifeCycleState, ONTOLOGY,
    ams_pages::{AGENT, AmsEntry, NODE},
    management::{
        AmsAgentDescription, FailureReason, Function, LifeCycleRequest, ManagementContent, Outcome,
        PlatformDescription, RefuseReason, ServiceEntry, largest,
    },
    ontology::AMS_DESCRIPTION,
    service::{Change, Functions, NoResult, Said, ServiceOutbox, Step},
    signature::name_of_request,
};
use crate::{AclMessage, AgentId, Key, Performative, Revision, Time};

/// Maximum number of agents of a platform.
pub const AGENTS_MAX: usize = 1 << 16;
/// Maximum number of processes that serve one platform.
pub const NODES_MAX: usize = 64;

/// The name of FIPA's transport over HTTP, as in the platform's description.
pub const HTTP_TRANSPORT: &str = "fipa.mts.mtp.http.std";

/// Time after which a failed write is repeated.
const LOOK_AGAIN_AFTER: Duration = Duration::from_secs(2);

/// The configuration of an AMS: its platform, and the agents with special rights.
#[derive(Clone, Debug)]
pub struct AmsConfig {
    /// The identifier of the AMS itself.
    pub id: AgentId,
    /// The name of the platform.
    pub platform: String,
    /// Agents that exist without registration: the services of the platform. Their entries are read-only.
    pub services: Vec<AgentId>,
    /// Agents that may change all entries.
    pub administrators: Vec<AgentId>,
    /// Transport addresses of this process for other platforms; entered in the pages for all processes of the platform.
    pub addresses: Vec<String>,
    /// `true`: agents that start in this process are registered automatically.
    pub enters_residents: bool,
    /// Agents that [`Self::enters_residents`] does not register, because they exist only briefly.
    pub unlisted: Vec<AgentId>,
}

/// The white pages of a platform: the functions of its AMS.
///
/// An agent may register, modify and deregister itself; `administrators` may do that for all. The AMS of an agent's
/// process sends it the requests in its entry, regardless of their author.
#[derive(Clone, Debug)]
pub struct Ams {
    config: AmsConfig,
    /// The entries, by name in lower case.
    agents: BTreeMap<String, AmsEntry>,
    /// The addresses of all processes that serve the platform.
    nodes: BTreeSet<String>,
    /// The agents in this process.
    residents: BTreeSet<AgentId>,
    /// True when the pages are known.
    is_ready: bool,
    /// Entries that this process has to write, by key.
    errands: BTreeMap<String, AmsTask>,
    /// The names of entries that are being written, by mark.
    written: BTreeMap<u64, String>,
    next_mark: u64,
    /// The next time to check them.
    look_at: Option<Time>,
}

/// A task of the AMS: an entry to write, repeated until done.
#[derive(Clone, Debug, PartialEq)]
enum AmsTask {
    /// An agent has started here: register it.
    Enter(AgentId),
    /// An agent has ended here: deregister it.
    TakeOut,
    /// An agent was destroyed and all processes know: remove its entry.
    Bury,
    /// This process serves the platform: enter its address.
    Serve,
}

impl Ams {
    /// Makes an AMS that does not know the pages yet; its service reads them from the store.
    pub fn new(config: AmsConfig) -> Self {
        Self {
            config,
            agents: BTreeMap::new(),
            nodes: BTreeSet::new(),
            residents: BTreeSet::new(),
            is_ready: false,
            errands: BTreeMap::new(),
            written: BTreeMap::new(),
            next_mark: 1,
            look_at: None,
        }
    }

    /// Returns the life-cycle state of an agent; `None`: it is not in the pages, or was destroyed.
    pub fn state(&self, agent: &AgentId) -> Option<LifeCycleState> {
        self.agents.get(&index(agent)).filter(|entry| !entry.is_gone()).map(AmsEntry::state)
    }

    fn key(agent: &AgentId) -> String {
        format!("{AGENT}{}", index(agent))
    }

    /// Returns the entry of an agent that has not ended.
    fn entry(&self, agent: &AgentId) -> Option<&AmsEntry> {
        self.agents.get(&index(agent)).filter(|entry| !entry.is_gone())
    }

    fn is_service(&self, agent: &AgentId) -> bool {
        self.config.services.iter().any(|service| service.name.eq_ignore_ascii_case(&agent.name))
    }

    fn is_administrator(&self, agent: &AgentId) -> bool {
        self.config.administrators.iter().any(|other| other.name.eq_ignore_ascii_case(&agent.name))
    }

    /// Returns true if the agent is registered and deregistered automatically in this process.
    fn is_entered(&self, agent: &AgentId) -> bool {
        let is_unlisted = self.config.unlisted.iter().any(|other| other.name.eq_ignore_ascii_case(&agent.name));
        self.config.enters_residents && !self.is_service(agent) && !is_unlisted
    }

    /// Returns the name in a description, if `asker` may change its entry.
    fn authorised(&self, asker: &AgentId, description: &AmsAgentDescription) -> Result<AgentId, NoResult> {
        let Some(name) = &description.name else {
            return Err(RefuseReason::missing(AMS_DESCRIPTION, "name").into());
        };
        let own = index(name) == index(asker);
        if (own || self.is_administrator(asker)) && !self.is_service(name) {
            return Ok(name.clone());
        }
        Err(RefuseReason::Unauthorised.into())
    }

    fn write(entry: &AmsEntry, name: &AgentId) -> Step {
        Step::Write(Change { key: Self::key(name).into(), text: entry.print() }, Outcome::Done)
    }

    fn register(&self, request: &Said, description: &AmsAgentDescription) -> Result<Step, NoResult> {
        let name = self.authorised(&request.sender, description)?;
        let by = name_of_request(request);
        match self.entry(&name) {
            // A repetition of the same request
            Some(entry) if by.is_some() && entry.by == by => return Ok(Step::Done(Outcome::Done)),
            Some(_) => return Err(FailureReason::AlreadyRegistered.into()),
            None => {}
        }
        let state = description.state.unwrap_or(LifeCycleState::Active);
        if !matches!(state, LifeCycleState::Initiated | LifeCycleState::Active) {
            return Err(RefuseReason::bad_value(AMS_DESCRIPTION, "state").into());
        }
        if self.agents.len() >= AGENTS_MAX {
            return Err(FailureReason::InternalError("no room for more agents".to_owned()).into());
        }
        let description = AmsAgentDescription { state: Some(state), ..description.clone() };
        Ok(Self::write(&AmsEntry { by, ..AmsEntry::of(description) }, &name))
    }

    fn modify(&self, asker: &AgentId, description: &AmsAgentDescription) -> Result<Step, NoResult> {
        let name = self.authorised(asker, description)?;
        let before = self.entry(&name).ok_or(FailureReason::NotRegistered)?;
        let after = description.state.unwrap_or(before.state());
        if after != before.state() {
            let forbidden = RefuseReason::bad_value(AMS_DESCRIPTION, "state");
            let transition = before.state().transition_to(after).ok_or(forbidden)?;
            let by_platform = self.is_administrator(asker) && transition.by_platform();
            if !(by_platform || *asker == name && transition.by_agent()) {
                return Err(RefuseReason::Unauthorised.into());
            }
        }
        // A name without addresses does not delete known addresses
        let known = before.description.name.clone().filter(|_| name.addresses.is_empty());
        let description =
            AmsAgentDescription { name: known.or(Some(name.clone())), state: Some(after), ..description.clone() };
        Ok(Self::write(&AmsEntry { description, ..before.clone() }, &name))
    }

    fn terminate(&self, asker: &AgentId, agent: &AgentId, graceful: bool) -> Result<Step, NoResult> {
        let description = AmsAgentDescription { name: Some(agent.clone()), ..Default::default() };
        self.authorised(asker, &description)?;
        // Only the platform may destroy agents
        if !graceful && !self.is_administrator(asker) {
            return Err(RefuseReason::Unauthorised.into());
        }
        let before = self.entry(agent).ok_or(FailureReason::NotRegistered)?;
        // An agent that is requested to quit stays registered until it deregisters itself: it may ignore the request
        let ending = if graceful { LifeCycleRequest::Quit } else { LifeCycleRequest::Destroy };
        Ok(Self::write(&AmsEntry { ending: Some(ending), ..before.clone() }, agent))
    }

    fn search(&self, template: &AmsAgentDescription, most: usize) -> Vec<AmsAgentDescription> {
        let addresses = self.addresses();
        let services = self.config.services.iter().map(|service| AmsAgentDescription {
            name: Some(AgentId { name: service.name.clone(), addresses: addresses.clone().into() }),
            ownership: None,
            state: Some(LifeCycleState::Active),
        });
        let agents = self.agents.values().filter(|entry| !entry.is_gone()).map(|entry| entry.description.clone());
        services.chain(agents).filter(|agent| template.matches(agent)).take(most).collect()
    }

    /// Returns the addresses of all processes that serve the platform, including this one before it is entered.
    fn addresses(&self) -> Vec<String> {
        let all: BTreeSet<&String> = self.nodes.iter().chain(&self.config.addresses).collect();
        all.into_iter().cloned().collect()
    }

    /// Returns the description of the platform: its name, and the transport addresses of all processes that serve it.
    pub fn platform(&self) -> PlatformDescription {
        let transport = ServiceEntry {
            id: HTTP_TRANSPORT.to_owned(),
            service_type: HTTP_TRANSPORT.to_owned(),
            addresses: self.addresses(),
        };
        let services = if transport.addresses.is_empty() { Vec::new() } else { vec![transport] };
        PlatformDescription { name: self.config.platform.clone(), services }
    }

    fn tell(&self, agent: &AgentId, request: LifeCycleRequest, todo: &mut ServiceOutbox) {
        let content = ManagementContent::LifeCycle(request);
        let message = AclMessage::new(Performative::Request, self.config.id.clone(), agent.clone(), content);
        todo.send.push(Said { ontology: ONTOLOGY, protocol: "fipa-request", ..message });
    }

    /// Sends an agent of this process the requests that its entry newly contains.
    fn hold_to(&self, agent: &AgentId, before: Option<&AmsEntry>, after: &AmsEntry, todo: &mut ServiceOutbox) {
        let was = before.map_or(LifeCycleState::Active, AmsEntry::state);
        match (was, after.state()) {
            (LifeCycleState::Suspended, LifeCycleState::Suspended) => {}
            (_, LifeCycleState::Suspended) => self.tell(agent, LifeCycleRequest::Suspend, todo),
            // Changes that the agent made itself need no request
            (from, LifeCycleState::Active) if from != LifeCycleState::Active => {
                self.tell(agent, LifeCycleRequest::Resume, todo);
            }
            _ => {}
        }
        if let Some(ending) = after.ending.filter(|ending| before.and_then(|entry| entry.ending) != Some(*ending)) {
            self.tell(agent, ending, todo);
        }
    }

    fn run(&mut self, key: String, errand: AmsTask, now: Time) {
        self.errands.insert(key, errand);
        self.look_at = Some(now);
    }

    /// Writes pending entries, and repeats failed writes.
    fn look_after_errands(&mut self, now: Time, todo: &mut ServiceOutbox) {
        if !self.is_ready || self.look_at.is_none_or(|at| now < at) {
            return;
        }
        let mut errands = std::mem::take(&mut self.errands);
        errands.retain(|key, errand| {
            let is_written = self.written.values().any(|other| other == key);
            let Some(text) = self.wanted(key, errand) else { return is_written };
            if !is_written {
                let mark = self.next_mark;
                self.next_mark += 1;
                self.written.insert(mark, key.clone());
                todo.writes.push((mark, Change { key: key.as_str().into(), text }));
            }
            true
        });
        self.errands = errands;
        self.look_at = (!self.errands.is_empty()).then(|| now + LOOK_AGAIN_AFTER);
    }

    /// Returns true if an entry's agent is in this process, or its process is not given.
    fn is_here(&self, entry: &AmsEntry) -> bool {
        let addresses = entry.description.name.as_ref().map_or(&[][..], |name| &name.addresses);
        addresses.is_empty() || addresses.iter().any(|address| self.config.addresses.contains(address))
    }

    /// Returns the text to write for a task. `None`: done already, or no longer applicable.
    fn wanted(&self, key: &str, errand: &AmsTask) -> Option<String> {
        let entry = key.strip_prefix(AGENT).and_then(|name| self.agents.get(name));
        match errand {
            AmsTask::Enter(agent) => {
                if !self.residents.contains(agent) || entry.is_none() && self.agents.len() >= AGENTS_MAX {
                    return None;
                }
                let name = AgentId { name: agent.name.clone(), addresses: self.config.addresses.clone().into() };
                let state = self.entry(agent).map_or(LifeCycleState::Active, AmsEntry::state);
                let description = AmsAgentDescription { name: Some(name), ownership: None, state: Some(state) };
                Some(AmsEntry::of(description).print())
            }
            // The agent may have moved to another process meanwhile
            AmsTask::TakeOut => entry.filter(|entry| entry.is_gone() || self.is_here(entry)).map(|_| String::new()),
            AmsTask::Bury => entry.filter(|entry| entry.is_gone()).map(|_| String::new()),
            AmsTask::Serve => {
                let address = key.strip_prefix(NODE).unwrap_or_default();
                (!self.nodes.contains(address)).then(|| "true".to_owned())
            }
        }
    }

    fn learn_agent(&mut self, now: Time, name: &str, text: &str, todo: &mut ServiceOutbox) {
        let Some(entry) = AmsEntry::parse(text) else {
            self.agents.remove(name);
            return;
        };
        let before = self.agents.get(name).cloned();
        if let Some(agent) = &entry.description.name
            && let Some(resident) = self.residents.iter().find(|resident| index(resident) == index(agent))
        {
            self.hold_to(resident, before.as_ref(), &entry, todo);
        }
        if entry.is_gone() && !before.is_some_and(|before| before.is_gone()) {
            // All processes have seen this entry; one of them removes it
            self.run(format!("{AGENT}{name}"), AmsTask::Bury, now);
        }
        self.agents.insert(name.to_owned(), entry);
    }
}

/// Returns the key of an agent: names are compared without case.
fn index(agent: &AgentId) -> String {
    agent.name.to_lowercase()
}

impl Functions for Ams {
    const PREFIXES: &'static [&'static str] = &["ams/"];

    fn learn(&mut self, now: Time, key: &str, _revision: Revision, text: &str, todo: &mut ServiceOutbox) {
        if let Some(name) = key.strip_prefix(AGENT) {
            self.learn_agent(now, name, text, todo);
        } else if let Some(address) = key.strip_prefix(NODE) {
            if text.is_empty() {
                self.nodes.remove(address);
            } else if self.nodes.len() < NODES_MAX {
                self.nodes.insert(address.to_owned());
            }
        }
    }

    fn perform(
        &mut self,
        _now: Time,
        request: &Said,
        function: &Function,
        _: &mut ServiceOutbox,
    ) -> Result<Step, NoResult> {
        let asker = &request.sender;
        match function {
            Function::RegisterAgent(description) => self.register(request, description),
            Function::ModifyAgent(description) => self.modify(asker, description),
            Function::DeregisterAgent(description) => {
                let name = self.authorised(asker, description)?;
                self.entry(&name).ok_or(FailureReason::NotRegistered)?;
                Ok(Step::Write(Change { key: Self::key(&name).into(), text: String::new() }, Outcome::Done))
            }
            Function::SearchAgents(template, constraints) => {
                Ok(Step::Done(Outcome::Agents(self.search(template, constraints.results_max(AGENTS_MAX)))))
            }
            Function::TerminateAgent { agent, graceful } => self.terminate(asker, agent, *graceful),
            Function::GetDescription => Ok(Step::Done(Outcome::Platform(self.platform()))),
            other => Err(RefuseReason::UnsupportedFunction(other.word().into()).into()),
        }
    }

    fn too_large(&self, function: &Function) -> RefuseReason {
        let ownership = match function {
            Function::RegisterAgent(agent) | Function::ModifyAgent(agent) => agent.ownership.as_ref(),
            _ => None,
        };
        let ownership = ownership.map_or(0, String::len);
        largest(AMS_DESCRIPTION, &[("ownership", ownership), ("name", Self::ENTRY_BYTES_MAX.saturating_sub(ownership))])
    }

    fn entry_of(&self, function: &Function) -> Option<Key> {
        let agent = match function {
            Function::RegisterAgent(agent) | Function::ModifyAgent(agent) | Function::DeregisterAgent(agent) => {
                agent.name.as_ref()?
            }
            Function::TerminateAgent { agent, .. } => agent,
            _ => return None,
        };
        Some(Self::key(agent).into())
    }

    fn hear(&mut self, _now: Time, message: &Said, _todo: &mut ServiceOutbox) -> bool {
        // Agents confirm that they have obeyed
        matches!(message.content, ManagementContent::LifeCycleDone(_))
    }

    fn presence(&mut self, now: Time, agent: &AgentId, present: bool, todo: &mut ServiceOutbox) {
        if present {
            self.residents.insert(agent.clone());
            if self.is_ready {
                self.begin_resident(now, agent, todo);
            }
        } else if self.residents.remove(agent) && self.is_entered(agent) {
            self.run(Self::key(agent), AmsTask::TakeOut, now);
        }
        self.look_after_errands(now, todo);
    }

    fn settled(&mut self, now: Time, mark: u64, made: bool, todo: &mut ServiceOutbox) {
        let Some(key) = self.written.remove(&mark) else { return };
        if made {
            self.errands.remove(&key);
        } else if self.errands.contains_key(&key) {
            // The entry has another revision, known by now; or it is unknown whether the write was done
            self.look_at = Some(now);
        }
        self.look_after_errands(now, todo);
    }

    fn tick(&mut self, now: Time, todo: &mut ServiceOutbox) {
        if !std::mem::replace(&mut self.is_ready, true) {
            for address in self.config.addresses.clone() {
                self.run(Self::node_key(&address), AmsTask::Serve, now);
            }
            for agent in self.residents.clone() {
                self.begin_resident(now, &agent, todo);
            }
        }
        self.look_after_errands(now, todo);
    }

    fn next_deadline(&self) -> Option<Time> {
        self.look_at
    }
}

impl Ams {
    /// Registers an agent that has started. Requests in its entry from before a restart still apply.
    fn begin_resident(&mut self, now: Time, agent: &AgentId, todo: &mut ServiceOutbox) {
        if let Some(entry) = self.entry(agent) {
            self.hold_to(agent, None, entry, todo);
        }
        if self.is_entered(agent) {
            self.run(Self::key(agent), AmsTask::Enter(agent.clone()), now);
        }
    }

    /// Returns the key of the entry that says that the process with this address serves the platform. An entry with
    /// empty text says that it does not any more.
    pub fn node_key(address: &str) -> String {
        format!("{NODE}{address}")
    }
}
