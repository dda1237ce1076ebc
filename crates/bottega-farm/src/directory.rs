//! The platform of a job: its Start Service, AMS and DF, and what stands in its directories.
//!
//! Every process of a job has these services, over pages that all share: in one process they are entries of its store, in a farm
//! notices. What they say to agents stays in the process.

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

/// The name of the platform: what stands behind `@` in the names of its services.
pub const PLATFORM: &str = "bottega";
/// Whose the agents of jobs are, as the white pages say it.
pub const JOB_OWNERSHIP: &str = "bottega-job";

/// The types of a job's services in the yellow pages.
pub mod service_type {
    /// Zones by auction, for Render Agents that speak the farm's own language.
    pub const MASTER: &str = "bottega-job-master";
    /// The importance map and the zones.
    pub const ANALYST: &str = "bottega-job-analyst";
    /// The rows of the zones.
    pub const BLACKBOARD: &str = "bottega-job-blackboard";
    /// The scene.
    pub const MODEL_REPOSITORY: &str = "bottega-job-model-repository";
    /// Painting.
    pub const RENDER_AGENT: &str = "bottega-job-render-agent";
    /// How all of them begin.
    pub(super) const PREFIX: &str = "bottega-job-";
}

type PlatformService<F> = Service<F, FarmContent, FarmValue, FarmEffect, FarmCompletion>;

/// A service of the platform as an agent of the farm.
#[derive(Clone, Debug)]
pub enum DirectoryService {
    /// The root service: what a new agent asks first.
    Start(PlatformService<StartService>),
    /// The white pages.
    Ams(Box<PlatformService<Ams>>),
    /// The yellow pages.
    Df(Box<PlatformService<Df>>),
}

/// The names of the services: Start Service, AMS, DF.
pub fn directory_service_names() -> [AgentId; 3] {
    ["start", "ams", "df"].map(|name| AgentId::new(format!("{name}@{PLATFORM}")))
}

/// The services of a process, by name.
///
/// - `salt`: what no other process has.
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
        // They enter themselves.
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

/// The types of the basic services that agents look for in the service root.
pub(crate) const FIPA_AMS: &str = "fipa-ams";
pub(crate) const FIPA_DF: &str = "fipa-df";

/// Where the agents of a job register, and what their entries say of it.
#[derive(Clone, Debug, PartialEq)]
pub struct RegistrationConfig {
    /// The root service.
    pub start: AgentId,
    /// The work.
    pub work: WorkId,
    /// The number of the job, where it has one.
    pub job: Option<u32>,
    /// Where the Master is at home, as [`machine_of`] has it: others who say that they are it are not believed. `None`: nobody lies.
    pub master_home: Option<String>,
}

impl RegistrationConfig {
    /// Of a work, at the services of this platform.
    pub fn new(work: WorkId, job: Option<u32>) -> Self {
        let [start, ..] = directory_service_names();
        Self { start, work, job, master_home: None }
    }

    /// Whether this may be the Master, and not one who says so.
    pub(crate) fn may_be_master(&self, agent: &AgentId) -> bool {
        self.master_home.as_deref().is_none_or(|home| machine_of(&agent.name) == home)
    }

    fn properties(&self) -> Vec<Property> {
        let property =
            |name: &str, value: u64| Property { name: name.to_owned(), value: Term::Bare(value.to_string()) };
        let job = self.job.map(|job| property("job", job.into()));
        std::iter::once(property("work", self.work.0)).chain(job).collect()
    }

    /// What an agent offers in this work: services of these types, each by these protocols.
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

    /// What the Master of this work is found by.
    pub(crate) fn master_template(&self) -> DfAgentDescription {
        let work = self.properties().into_iter().take(1).collect();
        let kind = Some(service_type::MASTER.to_owned());
        let service = ServiceDescription { service_type: kind, properties: work, ..ServiceDescription::default() };
        DfAgentDescription { services: vec![service], ..DfAgentDescription::default() }
    }
}

/// The services of a Master: what it keeps for its agents stands beside it.
pub(crate) const MASTER_SERVICES: [(&str, &[&str]); 3] = [
    (service_type::MASTER, &[protocol::SUBSCRIBE, protocol::CONTRACT_NET, protocol::REQUEST]),
    (service_type::BLACKBOARD, &[protocol::SUBSCRIBE]),
    (service_type::MODEL_REPOSITORY, &[protocol::REQUEST]),
];
/// Those of an Analyst.
pub(crate) const ANALYST_SERVICES: [(&str, &[&str]); 1] = [(service_type::ANALYST, &[protocol::REQUEST])];
/// Those of a Render Agent.
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
    /// The text of a page; none of any row.
    fn as_ref(&self) -> &str {
        match self {
            Self::Page(text) => text,
            _ => "",
        }
    }
}
