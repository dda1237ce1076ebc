//! Conversion of the ontology `fipa-agent-management` between SL and [`ManagementContent`](super::ManagementContent).
//!
//! Names of objects, functions and parameters are compared without case, and unknown parameters are ignored: other
//! platforms add their own.

mod print;
mod read;

pub(super) use print::{agent_term, ams_description, df_description, service_entry};
pub use print::{print_content, print_content_of};
pub(super) use read::{Object, read_agent, read_ams_description, read_df_description, read_service_entry};
pub use read::{Unread, read_content};

pub(super) const AMS_DESCRIPTION: &str = "ams-agent-description";
pub(super) const DF_DESCRIPTION: &str = "df-agent-description";
pub(super) const SERVICE_DESCRIPTION: &str = "service-description";
pub(super) const SERVICE_ENTRY: &str = "service-directory-entry";
