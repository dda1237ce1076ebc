//! The services of a FIPA platform: Start Service, Agent Management System and Directory Facilitator; and the life
//! cycle of agents.
//!
//! All answer `fipa-request` messages with [`ManagementContent`]; the DF also answers subscriptions. Other performatives
//! are not understood; a request that is unsupported, unauthorized or malformed is refused without any change; later
//! errors are failures; otherwise the answer is an inform (FIPA00023). The knowledge of the services is in the store, as
//! entries that are called the platform's *pages*: see [`Service`].

mod ams;
mod ams_pages;
mod df;
mod life_cycle;
mod management;
mod ontology;
mod page;
mod service;
mod signature;
mod standard_agent;
mod start;

pub use ams::{AGENTS_MAX, Ams, AmsConfig, HTTP_TRANSPORT, NODES_MAX};
pub use ams_pages::{AmsPages, read_white_page};
pub use df::{
    DESCRIPTION_BYTES_MAX, DESCRIPTIONS_MAX, DIRECTORY_BYTES_MAX, Df, DfConfig, RESULTS_BYTES_MAX, RESULTS_MAX,
    read_yellow_page,
};
pub use life_cycle::{LifeCycleState, Transition};
pub use management::{
    AmsAgentDescription, CarriesManagement, DfAgentDescription, FailureReason, Function, LifeCycleRequest,
    ManagementContent, Name, NotUnderstoodReason, ONTOLOGY, Outcome, PlatformDescription, Property, RefuseReason,
    SearchConstraints, ServiceDescription, ServiceEntry,
};
pub use ontology::{Unread, print_content, print_content_of, read_content};
pub use page::{Page, PageAsk, directory_request};
pub use service::{Change, ENTRY_BYTES_MAX, Functions, NoResult, Said, Service, ServiceOutbox, Step};
pub use standard_agent::{KEPT_MESSAGES_MAX, StandardAgent};
pub use start::{BASIC_SERVICES_MAX, StartService};

/// The key prefixes of the entries of Start Service, AMS and DF.
pub const PAGE_FOLDERS: [&str; 3] = ["start/", "ams/", "df/"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folders_are_those_that_the_services_mirror() {
        let mirrored = [StartService::PREFIXES, Ams::PREFIXES, Df::PREFIXES].concat();
        assert_eq!(mirrored, PAGE_FOLDERS);
    }
}
