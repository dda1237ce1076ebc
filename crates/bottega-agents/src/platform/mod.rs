//! The services of a FIPA platform: Start Service, Agent Management System, Directory Facilitator; and the life cycle
//! of agents.
//!
//! All answer `fipa-request` messages with [`ManagementContent`]. An act that is not a request is not understood; a
//! request that is not supported, not allowed or badly formed is refused and nothing has changed; what then goes wrong
//! is a failure; else the answer is an inform (FIPA00023). What they know is in the store: see [`Service`].

mod ams;
mod ams_pages;
mod df;
mod life_cycle;
mod management;
mod ontology;
mod service;
mod signature;
mod standard_agent;
mod start;

pub use ams::{AGENTS_MAX, Ams, AmsConfig, HTTP_TRANSPORT, NODES_MAX};
pub use ams_pages::AmsPages;
pub use df::{
    DESCRIPTION_BYTES_MAX, DESCRIPTIONS_MAX, DIRECTORY_BYTES_MAX, Df, DfConfig, RESULTS_BYTES_MAX, RESULTS_MAX,
};
pub use life_cycle::{LifeCycleState, Transition};
pub use management::{
    AmsAgentDescription, CarriesManagement, DfAgentDescription, FailureReason, Function, LifeCycleRequest,
    ManagementContent, Name, NotUnderstoodReason, ONTOLOGY, Outcome, PlatformDescription, Property, RefuseReason,
    SearchConstraints, ServiceDescription, ServiceEntry,
};
pub use ontology::{Unread, print_content, print_content_of, read_content};
pub use service::{Change, ENTRY_BYTES_MAX, Functions, NoResult, Said, Service, ServiceOutbox, Step};
pub use standard_agent::{KEPT_MESSAGES_MAX, StandardAgent};
pub use start::{BASIC_SERVICES_MAX, StartService};
