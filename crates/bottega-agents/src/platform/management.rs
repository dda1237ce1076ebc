//! The ontology `fipa-agent-management` (FIPA00023) as types.

use std::borrow::Cow;

use super::LifeCycleState;
use crate::{AgentId, Performative, Time, sl::Term};

/// The name of the ontology in messages.
pub const ONTOLOGY: &str = "fipa-agent-management";

/// A content type that can carry management content.
///
/// A platform whose agents also talk about other things has its own content type, of which this is a part.
pub trait CarriesManagement: Clone + From<ManagementContent> {
    /// Returns the management content; `None`: the content is of another kind.
    fn management(&self) -> Option<&ManagementContent>;
}

impl CarriesManagement for ManagementContent {
    fn management(&self) -> Option<&ManagementContent> {
        Some(self)
    }
}

/// The content of a message to or from a platform service, such as a request to it or its answer.
#[derive(Clone, Debug, PartialEq)]
pub enum ManagementContent {
    /// In a request: the requested function.
    Action(Function),
    /// In an agree: the function will be executed.
    Agreed(Function),
    /// In a refuse: the function is not executed.
    Refused(Function, RefuseReason),
    /// In a failure: the function has failed.
    Failed(Function, FailureReason),
    /// In an inform: the function was executed, with this outcome.
    Done(Function, Outcome),
    /// In a request of the AMS to an agent: suspend, resume or end.
    LifeCycle(LifeCycleRequest),
    /// In an inform of an agent to the AMS: the request was carried out.
    LifeCycleDone(LifeCycleRequest),
    /// In a not-understood: the reason why a message was not understood.
    NotUnderstood(NotUnderstoodReason),
    /// In a subscribe: report all matching offers, now and in the future.
    Subscription(DfAgentDescription, SearchConstraints),
    /// In an inform to a subscriber: its template, and the changes. A removed offer has its name only.
    Updates(DfAgentDescription, SearchConstraints, Vec<DfAgentDescription>),
    /// In a cancel, and in the inform that confirms it: the conversation is over.
    Cancel,
    /// In a failure from an AMS: a message did not reach a receiver.
    Undelivered {
        /// The agent that the message did not reach.
        receiver: AgentId,
        /// The reason, as text for the user.
        reason: String,
    },
}

/// A function that a platform service executes on request.
#[derive(Clone, Debug, PartialEq)]
pub enum Function {
    /// AMS: register an agent.
    RegisterAgent(AmsAgentDescription),
    /// AMS: deregister an agent; the name suffices.
    DeregisterAgent(AmsAgentDescription),
    /// AMS: replace an entry; a changed state requests that transition of the life cycle.
    ModifyAgent(AmsAgentDescription),
    /// AMS: find matching agents.
    SearchAgents(AmsAgentDescription, SearchConstraints),
    /// AMS: end an agent. Graceful: it is requested to quit; else it is destroyed.
    TerminateAgent {
        /// The agent to end.
        agent: AgentId,
        /// True if the agent may finish its work, or ignore the request.
        graceful: bool,
    },
    /// AMS: return the description of the platform.
    GetDescription,
    /// DF: register the services of an agent.
    Register(DfAgentDescription),
    /// DF: deregister the services of an agent; the agent's name suffices.
    Deregister(DfAgentDescription),
    /// DF: replace the services of an agent; also renews the lease.
    Modify(DfAgentDescription),
    /// DF: find matching offers.
    Search(DfAgentDescription, SearchConstraints),
    /// Start Service: return the descriptions of all basic services.
    GetServiceRoot,
    /// Start Service: add a basic service.
    SupplyBasicService(ServiceEntry),
}

/// The outcome of a function that was executed.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Success without a result.
    Done,
    /// The entry made by the DF, whose lease may be shorter than requested.
    Entered(DfAgentDescription),
    /// The agents that an AMS found.
    Agents(Vec<AmsAgentDescription>),
    /// The offers of agents that a DF found.
    Offers(Vec<DfAgentDescription>),
    /// The description of the platform, from its AMS.
    Platform(PlatformDescription),
    /// The service root: the descriptions of all basic services.
    ServiceRoot(Vec<ServiceEntry>),
}

impl Function {
    /// Returns the function's name in the ontology.
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
    /// All requests, in the order of the variants.
    pub const ALL: [Self; 4] = [Self::Suspend, Self::Resume, Self::Quit, Self::Destroy];

    /// Returns the request's name in the ontology.
    pub fn word(self) -> &'static str {
        match self {
            Self::Suspend => "suspend",
            Self::Resume => "resume",
            Self::Quit => "quit",
            Self::Destroy => "destroy",
        }
    }
}

/// A life-cycle request of the AMS to an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LifeCycleRequest {
    /// Suspend: do nothing until resumed; messages are kept.
    Suspend,
    /// Resume the agent.
    Resume,
    /// End; may be ignored.
    Quit,
    /// End now; cannot be ignored.
    Destroy,
}

/// The white-pages description of an agent. In a template, absent fields match anything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AmsAgentDescription {
    /// The described agent, with its addresses.
    pub name: Option<AgentId>,
    /// The owner of the agent.
    pub ownership: Option<String>,
    /// The life-cycle state.
    pub state: Option<LifeCycleState>,
}

/// The yellow-pages description of an agent. In a template, absent and empty fields match anything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DfAgentDescription {
    /// The described agent, with its addresses.
    pub name: Option<AgentId>,
    /// The services that the agent offers.
    pub services: Vec<ServiceDescription>,
    /// The names of the interaction protocols that the agent speaks.
    pub protocols: Vec<String>,
    /// The names of the ontologies that the agent understands.
    pub ontologies: Vec<String>,
    /// The names of the content languages that the agent understands.
    pub languages: Vec<String>,
    /// The time at which the entry expires. `None`: never, or in a request: when the DF decides.
    pub lease_time: Option<Time>,
    /// The visibility: `global`, or `local` to this platform; empty: global.
    pub scope: Vec<String>,
}

/// The description of a service of an agent. In a template, absent and empty fields match anything.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServiceDescription {
    /// The name of the service.
    pub name: Option<String>,
    /// The type of the service, by which agents search for it.
    pub service_type: Option<String>,
    /// The names of the interaction protocols of the service.
    pub protocols: Vec<String>,
    /// The names of the ontologies of the service.
    pub ontologies: Vec<String>,
    /// The names of the content languages of the service.
    pub languages: Vec<String>,
    /// The owner of the service.
    pub ownership: Option<String>,
    /// Further properties of the service, by name.
    pub properties: Vec<Property>,
}

/// A named value of a service's description (FIPA `property`).
#[derive(Clone, Debug, PartialEq)]
pub struct Property {
    /// The name of the property.
    pub name: String,
    /// The value of the property: any SL term.
    pub value: Term,
}

/// The limits of a search in the white or yellow pages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SearchConstraints {
    /// Maximum number of hops to other directories; 0 or absent: this one only; negative: unlimited.
    pub max_depth: Option<i64>,
    /// Maximum number of results; negative: unlimited. Absent: 1.
    pub max_results: Option<i64>,
    /// Identifies the search, to prevent cycles.
    pub search_id: Option<String>,
}

/// The description of a platform: its name, transports and services.
#[derive(Clone, Debug, PartialEq)]
pub struct PlatformDescription {
    /// The name of the platform: the part after `@` in the names of its agents.
    pub name: String,
    /// The transports and services of the platform.
    pub services: Vec<ServiceEntry>,
}

/// An entry of the service root (FIPA00001): a basic service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServiceEntry {
    /// The unique name of the service.
    pub id: String,
    /// The type of the service, such as `fipa-ams`.
    pub service_type: String,
    /// The addresses of the service, at least one. Within a platform: the agent's name.
    pub addresses: Vec<String>,
}

/// The name of a function, an object or a parameter of the ontology.
pub type Name = Cow<'static, str>;

/// The reason why a message was not understood.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotUnderstoodReason {
    /// The performative is unsupported.
    UnsupportedAct(Performative),
    /// The performative is out of sequence.
    UnexpectedAct(Performative),
    /// A parameter of the message, such as `language`, has an unsupported value.
    UnsupportedValue(Name),
    /// A parameter of the message, such as `content`, has an invalid value.
    UnrecognisedValue(Name),
    /// Another reason, from another platform.
    Other(Term),
}

/// The reason why a service refuses a function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RefuseReason {
    /// The sender is not authorized.
    Unauthorised,
    /// The service does not support this function.
    UnsupportedFunction(Name),
    /// The function lacks this argument.
    MissingArgument(Name),
    /// The function does not take this argument.
    UnexpectedArgument(Name),
    /// The function has a wrong number of arguments.
    UnexpectedArgumentCount,
    /// An object lacks a parameter: object, parameter.
    MissingParameter(Name, Name),
    /// An object has an unexpected parameter: object, parameter.
    UnexpectedParameter(Name, Name),
    /// A parameter has an invalid value: object, parameter.
    UnrecognisedParameterValue(Name, Name),
    /// Another reason, from another platform.
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

/// Returns the refusal of an object that is too large; names its largest parameter.
pub(super) fn largest(object: &'static str, sizes: &[(&'static str, usize)]) -> RefuseReason {
    let largest = sizes.iter().max_by_key(|(_, bytes)| *bytes);
    RefuseReason::bad_value(object, largest.map_or("name", |(parameter, _)| parameter))
}

/// The reason why a function failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FailureReason {
    /// The agent, or the identifier of the basic service, is already registered.
    AlreadyRegistered,
    /// The agent is not registered.
    NotRegistered,
    /// Any other failure, with its description.
    InternalError(String),
}

impl SearchConstraints {
    /// Returns the maximum number of results, at most `most`.
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

/// Returns true if each element of the template matches some element.
fn within<T>(template: &[T], object: &[T], matches: impl Fn(&T, &T) -> bool) -> bool {
    template.iter().all(|wanted| object.iter().any(|found| matches(wanted, found)))
}

impl AmsAgentDescription {
    /// Returns true if `object` matches this template: it has the same value of each parameter that the template sets.
    pub fn matches(&self, object: &Self) -> bool {
        same(&self.name, &object.name) && same(&self.ownership, &object.ownership) && same(&self.state, &object.state)
    }
}

impl ServiceDescription {
    /// Returns the value of a property; `None`: there is none of this name.
    pub fn property(&self, name: &str) -> Option<&Term> {
        self.properties.iter().find(|property| property.name == name).map(|property| &property.value)
    }

    /// Returns true if `object` matches this template: it has the same value of each parameter that the template sets, and
    /// of lists at least the elements that the template lists.
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
    /// Returns true if `object` matches this template: it has the same value of each parameter that the template sets, and
    /// of lists at least the elements that the template lists. A service matches by [`ServiceDescription::matches`].
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
