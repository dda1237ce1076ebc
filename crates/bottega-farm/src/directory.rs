//! The agent platform of a job: Start Service, AMS and DF, and the entries that agents make there.
//!
//! Every process of a job runs these services over shared pages: entries of the store within one process, notices in a
//! farm. Messages between them and agents stay within the process.

use std::sync::Arc;

use bottega_agents::{
    AgentId, StateMachine, Time, machine_of,
    platform::{
        Ams, AmsConfig, CarriesManagement, Df, DfAgentDescription, DfConfig, ManagementContent, Property, Service,
        ServiceDescription, ServiceEntry, StartService,
    },
    sl::Term,
    wire::Calendar,
};

use crate::{
    FarmAction, FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmValue, ONTOLOGY, WorkId, contents::LANGUAGE,
    protocol,
};

/// The name of the platform, after the `@` in the names of its services.
pub const PLATFORM: &str = "bottega";
/// The `ownership` of jobs' agents in the white pages.
pub const JOB_OWNERSHIP: &str = "bottega-job";

/// The service types of a job's agents in the yellow pages.
pub mod service_type {
    /// The service type of a Master: zones by auction, for Render Agents that speak the ontology `bottega-farm`.
    pub const MASTER: &str = "bottega-job-master";
    /// The service type of an Analyst: the importance map and the zones.
    pub const ANALYST: &str = "bottega-job-analyst";
    /// The service type of a Blackboard: the rows of the zones.
    pub const BLACKBOARD: &str = "bottega-job-blackboard";
    /// The service type of a Model Repository: the scene.
    pub const MODEL_REPOSITORY: &str = "bottega-job-model-repository";
    /// The service type of a Render Agent: painting of zones.
    pub const RENDER_AGENT: &str = "bottega-job-render-agent";
    /// Common prefix of all service types.
    pub(super) const PREFIX: &str = "bottega-job-";
}

type PlatformService<F> = Service<F, FarmContent, FarmValue, FarmEffect, FarmCompletion>;

/// A service of the platform, run as an agent of the farm.
#[derive(Clone, Debug)]
pub enum DirectoryService {
    /// The Start Service: a new agent's first contact.
    Start(PlatformService<StartService>),
    /// The AMS: the white pages.
    Ams(Box<PlatformService<Ams>>),
    /// The DF: the yellow pages.
    Df(Box<PlatformService<Df>>),
}

/// Returns the ids of Start Service, AMS and DF.
pub fn directory_service_names() -> [AgentId; 3] {
    ["start", "ams", "df"].map(|name| AgentId::new(format!("{name}@{PLATFORM}")))
}

/// Returns the Start Service, AMS and DF of one process, with their ids.
///
/// - `calendar`: converts the platform's times to dates.
/// - `salt`: a number unique to the process.
pub fn directory_services(calendar: Calendar, salt: u64) -> [(AgentId, DirectoryService); 3] {
    let [start, ams, df] = directory_service_names();
    let entry = |id: &AgentId, kind: &str| {
        let name = id.name.to_string();
        ServiceEntry { id: name.clone(), service_type: kind.to_owned(), addresses: vec![name] }
    };
    let basic = vec![entry(&ams, FIPA_AMS), entry(&df, FIPA_DF), entry(&start, "bottega-start-service")];
    let white = Ams::new(AmsConfig {
        id: ams.clone(),
        platform: PLATFORM.to_owned(),
        services: vec![ams.clone(), df.clone(), start.clone()],
        administrators: Vec::new(),
        addresses: Vec::new(),
        // The services register themselves.
        enters_residents: false,
        unlisted: Vec::new(),
    });
    let yellow = Df::new(DfConfig {
        id: df.clone(),
        calendar,
        lease_max: None,
        administrators: Vec::new(),
        federates: Vec::new(),
        salt,
    });
    [
        (start.clone(), DirectoryService::Start(Service::new(start, StartService::new(basic)))),
        (ams.clone(), DirectoryService::Ams(Box::new(Service::new(ams, white)))),
        (df.clone(), DirectoryService::Df(Box::new(Service::new(df, yellow)))),
    ]
}

/// The types of the basic services that agents look up at the Start Service.
pub(crate) const FIPA_AMS: &str = "fipa-ams";
pub(crate) const FIPA_DF: &str = "fipa-df";

/// The platform at which a job's agents register, and the properties of their entries.
#[derive(Clone, Debug, PartialEq)]
pub struct RegistrationConfig {
    /// The id of the Start Service.
    pub start: AgentId,
    /// The id of the work.
    pub work: WorkId,
    /// The number of the work's job; `None`: it has none.
    pub job: Option<u32>,
    /// The machine of the Master, as [`machine_of`] gives it; agents elsewhere that claim to be the Master are ignored.
    /// `None`: no check.
    pub master_home: Option<String>,
}

impl RegistrationConfig {
    /// Makes the registration for a work, at this platform's services, without a check of the Master's machine.
    ///
    /// - `job`: the number of the work's job; `None`: it has none.
    pub fn new(work: WorkId, job: Option<u32>) -> Self {
        let [start, ..] = directory_service_names();
        Self { start, work, job, master_home: None }
    }

    /// Returns true if the agent's machine is that of the Master.
    pub(crate) fn may_be_master(&self, agent: &AgentId) -> bool {
        self.master_home.as_deref().is_none_or(|home| machine_of(&agent.name) == home)
    }

    fn properties(&self) -> Vec<Property> {
        let property =
            |name: &str, value: u64| Property { name: name.to_owned(), value: Term::Bare(value.to_string()) };
        let job = self.job.map(|job| property("job", job.into()));
        std::iter::once(property("work", self.work.0)).chain(job).collect()
    }

    /// Returns the DF entry of an agent that offers services of these types, each with these protocols.
    pub(crate) fn offer(&self, agent: &AgentId, services: &[(&str, &[&str])]) -> DfAgentDescription {
        let texts = |texts: &[&str]| texts.iter().map(|&text| text.to_owned()).collect::<Vec<String>>();
        let service = |&(kind, protocols): &(&str, &[&str])| ServiceDescription {
            name: Some(kind.strip_prefix(service_type::PREFIX).unwrap_or(kind).to_owned()),
            service_type: Some(kind.to_owned()),
            protocols: texts(protocols),
            ontologies: texts(&[ONTOLOGY]),
            languages: texts(&[LANGUAGE]),
            ownership: Some(JOB_OWNERSHIP.to_owned()),
            properties: self.properties(),
        };
        let mut protocols: Vec<String> = services.iter().flat_map(|(_, protocols)| texts(protocols)).collect();
        protocols.sort();
        protocols.dedup();
        DfAgentDescription {
            name: Some(agent.clone()),
            services: services.iter().map(service).collect(),
            protocols,
            ontologies: texts(&[ONTOLOGY]),
            languages: texts(&[LANGUAGE]),
            ..DfAgentDescription::default()
        }
    }

    /// Returns the DF query for the Master of this work.
    pub(crate) fn master_template(&self) -> DfAgentDescription {
        let work = self.properties().into_iter().take(1).collect();
        let kind = Some(service_type::MASTER.to_owned());
        let service = ServiceDescription { service_type: kind, properties: work, ..ServiceDescription::default() };
        DfAgentDescription { services: vec![service], ..DfAgentDescription::default() }
    }
}

/// The service types of a Master, which also serves the Blackboard and the scene, with their protocols.
pub(crate) const MASTER_SERVICES: [(&str, &[&str]); 3] = [
    (service_type::MASTER, &[protocol::SUBSCRIBE, protocol::CONTRACT_NET, protocol::REQUEST]),
    (service_type::BLACKBOARD, &[protocol::SUBSCRIBE]),
    (service_type::MODEL_REPOSITORY, &[protocol::REQUEST]),
];
/// The service types of an Analyst, with their protocols.
pub(crate) const ANALYST_SERVICES: [(&str, &[&str]); 1] = [(service_type::ANALYST, &[protocol::REQUEST])];
/// The service types of a Render Agent, with their protocols.
pub(crate) const RENDER_SERVICES: [(&str, &[&str]); 1] =
    [(service_type::RENDER_AGENT, &[protocol::CONTRACT_NET, protocol::REQUEST])];

impl StateMachine for DirectoryService {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = FarmEffect;
    type Completion = FarmCompletion;

    fn handle(&mut self, now: Time, event: FarmEvent, actions: &mut Vec<FarmAction>) {
        match self {
            Self::Start(service) => service.handle(now, event, actions),
            Self::Ams(service) => service.handle(now, event, actions),
            Self::Df(service) => service.handle(now, event, actions),
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        match self {
            Self::Start(service) => service.next_deadline(),
            Self::Ams(service) => service.next_deadline(),
            Self::Df(service) => service.next_deadline(),
        }
    }
}

impl From<ManagementContent> for FarmContent {
    fn from(content: ManagementContent) -> Self {
        Self::Management(Arc::new(content))
    }
}

impl CarriesManagement for FarmContent {
    fn management(&self) -> Option<&ManagementContent> {
        match self {
            Self::Management(content) => Some(content),
            _ => None,
        }
    }
}

impl From<String> for FarmValue {
    fn from(page: String) -> Self {
        Self::Page(page.into())
    }
}

impl AsRef<str> for FarmValue {
    /// Returns the text of a page; empty for a row.
    fn as_ref(&self) -> &str {
        match self {
            Self::Page(text) => text,
            _ => "",
        }
    }
}
