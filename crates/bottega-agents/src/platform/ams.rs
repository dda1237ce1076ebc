//! The Agent Management System: white pages and life cycle (FIPA00023).

use std::collections::{BTreeMap, BTreeSet};

use super::{
    LifeCycleState, ONTOLOGY,
    management::{
        AmsAgentDescription, FailureReason, Function, LifeCycleRequest, ManagementContent, Outcome,
        PlatformDescription, RefuseReason, ServiceEntry,
    },
    ontology::{AMS_DESCRIPTION, Object, ams_description, read_ams_description},
    service::{Change, Functions, NoResult, Said, Step, Todo},
};
use crate::{AclMessage, AgentId, Key, Performative, Revision, Time, sl, sl::Term};

/// The most agents of a platform.
pub const AGENTS_MAX: usize = 1 << 16;
/// The most processes that serve one platform.
pub const NODES_MAX: usize = 64;

/// The type of the transport, in the description of the platform.
pub const HTTP_TRANSPORT: &str = "fipa.mts.mtp.http.std";

const AGENT: &str = "ams/agent/";
const NODE: &str = "ams/node/";
/// The parameter of an entry that says how an agent shall end.
const ENDING: &str = ":X-ending";

/// An agent as it stands in the store.
#[derive(Clone, Debug, PartialEq)]
struct Entry {
    description: AmsAgentDescription,
    /// It is asked to end, or must: then it counts as gone.
    ending: Option<LifeCycleRequest>,
}

impl Entry {
    fn print(&self) -> String {
        let mut term = ams_description(&self.description);
        if let (Term::List(terms), Some(ending)) = (&mut term, self.ending) {
            terms.extend([Term::Bare(ENDING.to_owned()), Term::text(ending.word())]);
        }
        sl::print_term(&term)
    }

    /// What others wrote into the store: what cannot be read is passed over.
    fn parse(text: &str) -> Option<Self> {
        let term = sl::parse_term(text).ok()?;
        let description = read_ams_description(&term).ok()?;
        description.name.as_ref()?;
        let object = Object::read(AMS_DESCRIPTION, &term).ok()?;
        let ending = object.text("X-ending").ok()?;
        let ending = ending.and_then(|word| LifeCycleRequest::ALL.into_iter().find(|request| request.word() == word));
        Some(Self { description, ending })
    }

    fn is_gone(&self) -> bool {
        self.ending == Some(LifeCycleRequest::Destroy)
    }

    fn state(&self) -> LifeCycleState {
        self.description.state.unwrap_or(LifeCycleState::Active)
    }
}

/// Who an AMS is, and of what.
#[derive(Clone, Debug)]
pub struct AmsConfig {
    /// Its own name.
    pub id: AgentId,
    /// The name of the platform.
    pub platform: String,
    /// Agents that are there without being entered: the services of the platform. Nobody changes them.
    pub services: Vec<AgentId>,
    /// Who may change all entries.
    pub administrators: Vec<AgentId>,
    /// Where this process can be reached from outside; all processes that serve the platform are told.
    pub addresses: Vec<String>,
    /// Whether agents that come to this process are entered by themselves.
    pub enters_residents: bool,
}

/// The agents of a platform.
///
/// An agent may enter, change and take out itself; what the `administrators` may do to all. The AMS of the process in
/// which an agent lives tells it what its entry wants of it, whoever wrote that.
#[derive(Clone, Debug)]
pub struct Ams {
    config: AmsConfig,
    /// By name in small letters.
    agents: BTreeMap<String, Entry>,
    /// The addresses of all processes that serve the platform.
    nodes: BTreeSet<String>,
    /// The agents that live in this process.
    residents: BTreeSet<AgentId>,
    /// What waits until the pages are known.
    is_ready: bool,
}

impl Ams {
    /// An AMS that knows nobody yet.
    pub fn new(config: AmsConfig) -> Self {
        Self { config, agents: BTreeMap::new(), nodes: BTreeSet::new(), residents: BTreeSet::new(), is_ready: false }
    }

    /// Where an agent stands in its life, if it is known.
    pub fn state(&self, agent: &AgentId) -> Option<LifeCycleState> {
        self.agents.get(&index(agent)).filter(|entry| !entry.is_gone()).map(Entry::state)
    }

    fn key(agent: &AgentId) -> String {
        format!("{AGENT}{}", index(agent))
    }

    /// The entry of an agent that has not ended.
    fn entry(&self, agent: &AgentId) -> Option<&Entry> {
        self.agents.get(&index(agent)).filter(|entry| !entry.is_gone())
    }

    fn is_service(&self, agent: &AgentId) -> bool {
        self.config.services.iter().any(|service| service.name.eq_ignore_ascii_case(&agent.name))
    }

    fn is_administrator(&self, agent: &AgentId) -> bool {
        self.config.administrators.iter().any(|other| other.name.eq_ignore_ascii_case(&agent.name))
    }

    /// The name in a description, if `asker` may touch its entry.
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

    fn write(entry: &Entry, name: &AgentId) -> Step {
        Step::Write(Change { key: Self::key(name).into(), text: entry.print() }, Outcome::Done)
    }

    fn register(&self, asker: &AgentId, description: &AmsAgentDescription) -> Result<Step, NoResult> {
        let name = self.authorised(asker, description)?;
        if self.entry(&name).is_some() {
            return Err(FailureReason::AlreadyRegistered.into());
        }
        let state = description.state.unwrap_or(LifeCycleState::Active);
        if !matches!(state, LifeCycleState::Initiated | LifeCycleState::Active) {
            return Err(RefuseReason::bad_value(AMS_DESCRIPTION, "state").into());
        }
        if self.agents.len() >= AGENTS_MAX {
            return Err(FailureReason::InternalError("no room for more agents".to_owned()).into());
        }
        let description = AmsAgentDescription { state: Some(state), ..description.clone() };
        Ok(Self::write(&Entry { description, ending: None }, &name))
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
        let description = AmsAgentDescription { state: Some(after), ..description.clone() };
        Ok(Self::write(&Entry { description, ending: before.ending }, &name))
    }

    fn terminate(&self, asker: &AgentId, agent: &AgentId, graceful: bool) -> Result<Step, NoResult> {
        let description = AmsAgentDescription { name: Some(agent.clone()), ..Default::default() };
        self.authorised(asker, &description)?;
        // Destroy is the platform's alone.
        if !graceful && !self.is_administrator(asker) {
            return Err(RefuseReason::Unauthorised.into());
        }
        let before = self.entry(agent).ok_or(FailureReason::NotRegistered)?;
        // Who is asked to quit stays known until it has taken itself out: it may ignore this.
        let ending = if graceful { LifeCycleRequest::Quit } else { LifeCycleRequest::Destroy };
        Ok(Self::write(&Entry { ending: Some(ending), ..before.clone() }, agent))
    }

    fn search(&self, template: &AmsAgentDescription, most: usize) -> Vec<AmsAgentDescription> {
        let addresses: Vec<String> = self.nodes.iter().cloned().collect();
        let services = self.config.services.iter().map(|service| AmsAgentDescription {
            name: Some(AgentId { name: service.name.clone(), addresses: addresses.clone().into() }),
            ownership: None,
            state: Some(LifeCycleState::Active),
        });
        let agents = self.agents.values().filter(|entry| !entry.is_gone()).map(|entry| entry.description.clone());
        services.chain(agents).filter(|agent| template.matches(agent)).take(most).collect()
    }

    /// The platform, with all processes that serve it.
    pub fn platform(&self) -> PlatformDescription {
        let transport = ServiceEntry {
            id: HTTP_TRANSPORT.to_owned(),
            service_type: HTTP_TRANSPORT.to_owned(),
            addresses: self.nodes.iter().cloned().collect(),
        };
        let services = if self.nodes.is_empty() { Vec::new() } else { vec![transport] };
        PlatformDescription { name: self.config.platform.clone(), services }
    }

    fn tell(&self, agent: &AgentId, request: LifeCycleRequest, todo: &mut Todo) {
        let content = ManagementContent::LifeCycle(request);
        let message = AclMessage::new(Performative::Request, self.config.id.clone(), agent.clone(), content);
        todo.send.push(Said { ontology: ONTOLOGY, protocol: "fipa-request", ..message });
    }

    /// Tells a resident what its entry wants of it now, compared with before.
    fn hold_to(&self, agent: &AgentId, before: Option<&Entry>, after: &Entry, todo: &mut Todo) {
        let was = before.map_or(LifeCycleState::Active, Entry::state);
        match (was, after.state()) {
            (LifeCycleState::Suspended, LifeCycleState::Suspended) => {}
            (_, LifeCycleState::Suspended) => self.tell(agent, LifeCycleRequest::Suspend, todo),
            // What it does by itself it has done.
            (from, LifeCycleState::Active) if from != LifeCycleState::Active => {
                self.tell(agent, LifeCycleRequest::Resume, todo);
            }
            _ => {}
        }
        if let Some(ending) = after.ending.filter(|ending| before.and_then(|entry| entry.ending) != Some(*ending)) {
            self.tell(agent, ending, todo);
        }
    }

    fn take_out(agent: &AgentId) -> (u64, Change) {
        (0, Change { key: Self::key(agent).into(), text: String::new() })
    }

    /// Enters an agent that lives here.
    fn enter_resident(&self, agent: &AgentId, todo: &mut Todo) {
        if !self.config.enters_residents || self.is_service(agent) || self.agents.len() >= AGENTS_MAX {
            return;
        }
        let name = AgentId { name: agent.name.clone(), addresses: self.config.addresses.clone().into() };
        let state = self.entry(agent).map_or(LifeCycleState::Active, Entry::state);
        let description = AmsAgentDescription { name: Some(name), ownership: None, state: Some(state) };
        let text = Entry { description, ending: None }.print();
        todo.writes.push((0, Change { key: Self::key(agent).into(), text }));
    }

    fn learn_agent(&mut self, name: &str, text: &str, todo: &mut Todo) {
        let Some(entry) = Entry::parse(text) else {
            self.agents.remove(name);
            return;
        };
        let before = self.agents.get(name).cloned();
        if let Some(agent) = &entry.description.name
            && let Some(resident) = self.residents.iter().find(|resident| index(resident) == index(agent))
        {
            self.hold_to(resident, before.as_ref(), &entry, todo);
        }
        if entry.is_gone()
            && !before.is_some_and(|before| before.is_gone())
            && let Some(agent) = &entry.description.name
        {
            // All processes have been told by this entry; one of them takes it out.
            todo.writes.push(Self::take_out(agent));
        }
        self.agents.insert(name.to_owned(), entry);
    }
}

/// Names of agents are compared without case.
fn index(agent: &AgentId) -> String {
    agent.name.to_lowercase()
}

impl Functions for Ams {
    const PREFIXES: &'static [&'static str] = &["ams/"];

    fn learn(&mut self, _now: Time, key: &str, _revision: Revision, text: &str, todo: &mut Todo) {
        if let Some(name) = key.strip_prefix(AGENT) {
            self.learn_agent(name, text, todo);
        } else if let Some(address) = key.strip_prefix(NODE) {
            if text.is_empty() {
                self.nodes.remove(address);
            } else if self.nodes.len() < NODES_MAX {
                self.nodes.insert(address.to_owned());
            }
        }
    }

    fn perform(&mut self, _now: Time, request: &Said, function: &Function, _: &mut Todo) -> Result<Step, NoResult> {
        let asker = &request.sender;
        match function {
            Function::RegisterAgent(description) => self.register(asker, description),
            Function::ModifyAgent(description) => self.modify(asker, description),
            Function::DeregisterAgent(description) => {
                let name = self.authorised(asker, description)?;
                self.entry(&name).ok_or(FailureReason::NotRegistered)?;
                Ok(Step::Write(Self::take_out(&name).1, Outcome::Done))
            }
            Function::SearchAgents(template, constraints) => {
                Ok(Step::Done(Outcome::Agents(self.search(template, constraints.results_max(AGENTS_MAX)))))
            }
            Function::TerminateAgent { agent, graceful } => self.terminate(asker, agent, *graceful),
            Function::GetDescription => Ok(Step::Done(Outcome::Platform(self.platform()))),
            other => Err(RefuseReason::UnsupportedFunction(other.word().into()).into()),
        }
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

    fn hear(&mut self, _now: Time, message: &Said, _todo: &mut Todo) -> bool {
        // Agents say that they have done what they were told.
        matches!(message.content, ManagementContent::LifeCycleDone(_))
    }

    fn presence(&mut self, _now: Time, agent: &AgentId, present: bool, todo: &mut Todo) {
        if present {
            self.residents.insert(agent.clone());
            if self.is_ready {
                self.begin_resident(agent, todo);
            }
        } else if self.residents.remove(agent) && self.entry(agent).is_some() && self.config.enters_residents {
            todo.writes.push(Self::take_out(agent));
        }
    }

    fn tick(&mut self, _now: Time, todo: &mut Todo) {
        if std::mem::replace(&mut self.is_ready, true) {
            return;
        }
        for address in &self.config.addresses {
            if !self.nodes.contains(address) {
                let change = Change { key: format!("{NODE}{address}").into(), text: "true".to_owned() };
                todo.writes.push((0, change));
            }
        }
        for agent in self.residents.clone() {
            self.begin_resident(&agent, todo);
        }
    }
}

impl Ams {
    /// An agent has come to life here: what its entry wanted before a restart, it wants still.
    fn begin_resident(&self, agent: &AgentId, todo: &mut Todo) {
        if let Some(entry) = self.entry(agent) {
            self.hold_to(agent, None, entry, todo);
        }
        self.enter_resident(agent, todo);
    }

    /// The entry by which a process is known; without it nobody is sent there any more.
    pub fn node_key(address: &str) -> String {
        format!("{NODE}{address}")
    }
}

/// What an entry of the white pages says, for those who find ways by them.
#[derive(Clone, Debug, PartialEq)]
pub enum AmsPages<'a> {
    /// Of an agent.
    Agent {
        /// Its name in small letters.
        name: &'a str,
        /// Where it lives; `None`: it is gone.
        agent: Option<AgentId>,
    },
    /// Of a process that serves the platform.
    Node {
        /// Where it can be reached.
        address: &'a str,
        /// Whether it serves.
        present: bool,
    },
}

impl<'a> AmsPages<'a> {
    /// How the names of the entries begin.
    pub const PREFIX: &'static str = "ams/";

    /// Reads an entry; `None`: it says nothing of this kind.
    pub fn read(key: &'a str, text: &str) -> Option<Self> {
        if let Some(name) = key.strip_prefix(AGENT) {
            let entry = Entry::parse(text).filter(|entry| !entry.is_gone());
            return Some(Self::Agent { name, agent: entry.and_then(|entry| entry.description.name) });
        }
        let address = key.strip_prefix(NODE)?;
        Some(Self::Node { address, present: !text.is_empty() })
    }
}
