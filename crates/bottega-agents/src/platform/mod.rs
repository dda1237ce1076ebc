//! The services of a FIPA platform: Start Service, Agent Management System, Directory Facilitator; and the life cycle
//! of agents.
//!
//! All answer `fipa-request` messages with [`ManagementContent`]. An act that is not a request is not understood; a
//! request that is not supported, not allowed or badly formed is refused and nothing has changed; what then goes wrong
//! is a failure; else the answer is an inform (FIPA00023).

mod ams;
mod df;
mod life_cycle;
mod management;
mod service;
mod standard_agent;
mod start;

pub use ams::{AGENTS_MAX, Ams};
pub use df::{DESCRIPTIONS_MAX, Df};
pub use life_cycle::{LifeCycleState, Transition};
pub use management::{
    AmsAgentDescription, CarriesManagement, DfAgentDescription, FailureReason, Function, LifeCycleRequest,
    ManagementContent, NotUnderstoodReason, ONTOLOGY, Outcome, PlatformDescription, Property, RefuseReason,
    SearchConstraints, ServiceDescription, ServiceEntry,
};
pub use service::{Functions, NoResult, Service};
pub use standard_agent::{KEPT_MESSAGES_MAX, StandardAgent};
pub use start::{BASIC_SERVICES_MAX, StartService};
