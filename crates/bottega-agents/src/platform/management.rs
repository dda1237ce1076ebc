//! The ontology `fipa-agent-management` (FIPA00023) as types.

use std::borrow::Cow;

use super::LifeCycleState;
use crate::{AgentId, Performative, Time, sl::Term};

/// The name of the ontology.
pub const ONTOLOGY: &str = "fipa-agent-management";

/// Content types that can say what platform services understand.
///
/// A platform whose agents talk of other things too has a content type of its own, with this as a part.
pub trait CarriesManagement: Clone + From<ManagementContent> {
    /// What is said of management, if that is what is said.
    fn management(&self) -> Option<&ManagementContent>;
}

impl CarriesManagement for ManagementContent {
    fn management(&self) -> Option<&ManagementContent> {
        Some(self)
    }
}

/// The content of a message to or from a platform service.
#[derive(Clone, Debug, PartialEq)]
pub enum ManagementContent {
    /// In a request: what is to be done.
    Action(Function),
    /// In an agree: this will be done.
    Agreed(Function),
    /// In a refuse: this is not done.
    Refused(Function, RefuseReason),
    /// In a failure: this could not be done.
    Failed(Function, FailureReason),
    /// In an inform: this is done, with this result.
    Done(Function, Outcome),
    /// In a request of the AMS to an agent.
    LifeCycle(LifeCycleRequest),
    /// In an inform of an agent to the AMS: it has done so.
    LifeCycleDone(LifeCycleRequest),
    /// In a not-understood.
    NotUnderstood(NotUnderstoodReason),
    /// In a subscribe: tell of all offers that are like this, now and later.
    Subscription(DfAgentDescription, SearchConstraints),
    /// In an inform to a subscriber: its wish, and what is new of it. An offer that is gone has its name alone.
    News(DfAgentDescription, SearchConstraints, Vec<DfAgentDescription>),
    /// In a cancel, and in the inform that it is done: the conversation is over.
    Cancel,
    /// In a failure of an AMS: a message did not reach this receiver.
    Undelivered {
        /// Who did not get it.
        receiver: AgentId,
        /// Why.
        reason: String,
    },
}

/// A function of a platform service.
#[derive(Clone, Debug, PartialEq)]
pub enum Function {
    /// AMS: enter an agent.
    RegisterAgent(AmsAgentDescription),
    /// AMS: take an agent out; the name suffices.
    DeregisterAgent(AmsAgentDescription),
    /// AMS: replace what is entered; a change of state asks for that transition of the life cycle.
    ModifyAgent(AmsAgentDescription),
    /// AMS: find agents like this.
    SearchAgents(AmsAgentDescription, SearchConstraints),
    /// AMS: ends an agent. Graceful: it is asked to quit; else it is destroyed.
    TerminateAgent {
        /// Which.
        agent: AgentId,
        /// Whether it may put its things in order, or ignore it.
        graceful: bool,
    },
    /// AMS: what is this platform?
    GetDescription,
    /// DF: enter what an agent offers.
    Register(DfAgentDescription),
    /// DF: take that out; the name suffices.
    Deregister(DfAgentDescription),
    /// DF: replace it; also renews the lease.
    Modify(DfAgentDescription),
    /// DF: find what is like this.
    Search(DfAgentDescription, SearchConstraints),
    /// Start Service: the descriptions of all basic services.
    GetServiceRoot,
    /// Start Service: one more basic service.
    SupplyBasicService(ServiceEntry),
}

/// The outcome of a function.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It is done and there is nothing to tell.
    Done,
    /// What the DF entered: its lease may be shorter than what was asked for.
    Entered(DfAgentDescription),
    /// Agents that were found.
    Agents(Vec<AmsAgentDescription>),
    /// Offers that were found.
    Offers(Vec<DfAgentDescription>),
    /// This platform.
    Platform(PlatformDescription),
    /// The service root.
    ServiceRoot(Vec<ServiceEntry>),
}

impl Function {
    /// What a request calls it.
    pub fn word(&self) -> &'static str {
        match self {
            Self::RegisterAgent(_) | Self::Register(_) => "register",
            Self::DeregisterAgent(_) | Self::Deregister(_) => "deregister",
            Self::ModifyAgent(_) | Self::Modify(_) => "modify",
            Self::SearchAgents(..) | Self::Search(..) => "search",
            Self::TerminateAgent { graceful: true, .. } => "quit",
            Self::TerminateAgent { graceful: false, .. } => "destroy",
            Self::GetDescription => "get-description",
            Self::GetServiceRoot => "getServiceRoot",
            Self::SupplyBasicService(_) => "supplyBasicService",
        }
    }
}

impl LifeCycleRequest {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Suspend, Self::Resume, Self::Quit, Self::Destroy];

    /// What a request calls it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Suspend => "suspend",
            Self::Resume => "resume",
            Self::Quit => "quit",
            Self::Destroy => "destroy",
        }
    }
}

/// A request of the AMS to an agent: the operations that every agent has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LifeCycleRequest {
    /// Do nothing until resumed; messages are kept.
    Suspend,
    /// Go on.
    Resume,
    /// Come to an end; may be ignored.
    Quit,
    /// End now; cannot be ignored.
    Destroy,
}

/// An agent as the AMS knows it. In a template, what is absent does not matter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AmsAgentDescription {
    /// Who.
    pub name: Option<AgentId>,
    /// Whose.
    pub ownership: Option<String>,
    /// Where it stands in its life.
    pub state: Option<LifeCycleState>,
}

/// The offer of an agent. In a template, what is absent or empty does not matter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DfAgentDescription {
    /// Who.
    pub name: Option<AgentId>,
    /// What it offers.
    pub services: Vec<ServiceDescription>,
    /// Interaction protocols it speaks.
    pub protocols: Vec<String>,
    /// Ontologies it knows.
    pub ontologies: Vec<String>,
    /// Content languages it reads.
    pub languages: Vec<String>,
    /// When the entry is forgotten. `None`: never.
    pub lease_time: Option<Time>,
    /// Who may see it: `global`, or `local` to this platform.
    pub scope: Vec<String>,
}

/// One service of an agent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServiceDescription {
    /// Its name.
    pub name: Option<String>,
    /// Its kind.
    pub service_type: Option<String>,
    /// Interaction protocols it speaks.
    pub protocols: Vec<String>,
    /// Ontologies it knows.
    pub ontologies: Vec<String>,
    /// Content languages it reads.
    pub languages: Vec<String>,
    /// Whose it is.
    pub ownership: Option<String>,
    /// Whatever else it has.
    pub properties: Vec<Property>,
}

/// A named value.
#[derive(Clone, Debug, PartialEq)]
pub struct Property {
    /// Its name.
    pub name: String,
    /// Its value: any term.
    pub value: Term,
}

/// The limits of a search: how deep, and how many results.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SearchConstraints {
    /// How many hops to other directories; 0 and absent: this one alone.
    pub max_depth: Option<i64>,
    /// How many results; negative: all. Absent means 1.
    pub max_results: Option<i64>,
    /// Names the search, so that it does not run in circles.
    pub search_id: Option<String>,
}

/// The platform.
#[derive(Clone, Debug, PartialEq)]
pub struct PlatformDescription {
    /// Its name: what stands behind `@` in the names of its agents.
    pub name: String,
    /// How it can be reached and what it offers.
    pub services: Vec<ServiceEntry>,
}

/// An entry of the service root (FIPA00001): a basic service and where it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServiceEntry {
    /// A unique name.
    pub id: String,
    /// Its kind, such as `fipa-ams`.
    pub service_type: String,
    /// Where it can be reached; at least one. Within a platform: the agent's name.
    pub addresses: Vec<String>,
}

/// The name of a function, an object or a parameter.
pub type Name = Cow<'static, str>;

/// Why a message is not understood.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotUnderstoodReason {
    /// This performative has no meaning here.
    UnsupportedAct(Performative),
    /// This performative was not expected at this point.
    UnexpectedAct(Performative),
    /// A parameter of the message, such as `language`, has a value that is not supported.
    UnsupportedValue(Name),
    /// A parameter of the message, such as `content`, has a value that makes no sense.
    UnrecognisedValue(Name),
    /// Something else that another platform says.
    Other(Term),
}

/// Why nothing was done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RefuseReason {
    /// It is not for you to ask.
    Unauthorised,
    /// This service does not do that.
    UnsupportedFunction(Name),
    /// The function has no such argument.
    MissingArgument(Name),
    /// The function takes no such argument.
    UnexpectedArgument(Name),
    /// The function takes more or fewer arguments.
    UnexpectedArgumentCount,
    /// Something is missing: of which object, which parameter.
    MissingParameter(Name, Name),
    /// Something is too much: of which object, which parameter.
    UnexpectedParameter(Name, Name),
    /// Something has a value that it cannot have: of which object, which parameter.
    UnrecognisedParameterValue(Name, Name),
    /// Something else that another platform says.
    Other(Term),
}

impl RefuseReason {
    pub(super) fn missing(object: &'static str, parameter: &'static str) -> Self {
        Self::MissingParameter(object.into(), parameter.into())
    }

    pub(super) fn bad_value(object: &'static str, parameter: &'static str) -> Self {
        Self::UnrecognisedParameterValue(object.into(), parameter.into())
    }
}

/// The refusal of an object that is too large: of its parameter that takes most.
pub(super) fn largest(object: &'static str, sizes: &[(&'static str, usize)]) -> RefuseReason {
    let largest = sizes.iter().max_by_key(|(_, bytes)| *bytes);
    RefuseReason::bad_value(object, largest.map_or("name", |(parameter, _)| parameter))
}

/// The reason of a failure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FailureReason {
    /// It is there already.
    AlreadyRegistered,
    /// It is not there.
    NotRegistered,
    /// Something else.
    InternalError(String),
}

impl SearchConstraints {
    /// How many results are wanted, no more than a service gives at most.
    pub(crate) fn results_max(&self, most: usize) -> usize {
        match self.max_results {
            None => 1.min(most),
            Some(count) => usize::try_from(count).map_or(most, |count| count.min(most)),
        }
    }
}

fn same<T: PartialEq>(template: &Option<T>, object: &Option<T>) -> bool {
    template.is_none() || template == object
}

/// Each element of the template matches some element.
fn within<T>(template: &[T], object: &[T], matches: impl Fn(&T, &T) -> bool) -> bool {
    template.iter().all(|wanted| object.iter().any(|found| matches(wanted, found)))
}

impl AmsAgentDescription {
    /// Whether `object` is like this template.
    pub fn matches(&self, object: &Self) -> bool {
        same(&self.name, &object.name) && same(&self.ownership, &object.ownership) && same(&self.state, &object.state)
    }
}

impl ServiceDescription {
    /// Whether `object` is like this template.
    pub fn matches(&self, object: &Self) -> bool {
        same(&self.name, &object.name)
            && same(&self.service_type, &object.service_type)
            && same(&self.ownership, &object.ownership)
            && within(&self.protocols, &object.protocols, PartialEq::eq)
            && within(&self.ontologies, &object.ontologies, PartialEq::eq)
            && within(&self.languages, &object.languages, PartialEq::eq)
            && within(&self.properties, &object.properties, PartialEq::eq)
    }
}

impl DfAgentDescription {
    /// Whether `object` is like this template.
    pub fn matches(&self, object: &Self) -> bool {
        same(&self.name, &object.name)
            && same(&self.lease_time, &object.lease_time)
            && within(&self.services, &object.services, ServiceDescription::matches)
            && within(&self.protocols, &object.protocols, PartialEq::eq)
            && within(&self.ontologies, &object.ontologies, PartialEq::eq)
            && within(&self.languages, &object.languages, PartialEq::eq)
            && within(&self.scope, &object.scope, PartialEq::eq)
    }
}
