//! The Start Service: what a new agent asks first (MAGarRO, section 3.1; FIPA00001, service root).

use super::{
    management::{FailureReason, Function, ManagementContent, Outcome, RefuseReason, ServiceEntry},
    service::{Functions, NoResult},
};
use crate::{AgentId, Time};

/// The most basic services of a platform.
pub const BASIC_SERVICES_MAX: usize = 256;

/// The basic services of a platform. A second supply under a used identifier is a failure: an entry that agents
/// already hold must not change its meaning.
#[derive(Clone, Debug, Default)]
pub struct StartService {
    entries: Vec<ServiceEntry>,
}

impl StartService {
    /// With the services that are there from the start, as the platform knows them.
    pub fn new(entries: Vec<ServiceEntry>) -> Self {
        Self { entries }
    }

    fn supply(&mut self, entry: &ServiceEntry) -> Result<Outcome, NoResult> {
        const OBJECT: &str = "service-directory-entry";
        for (missing, parameter) in [
            (entry.id.is_empty(), "service-id"),
            (entry.service_type.is_empty(), "service-type"),
            (entry.addresses.is_empty(), "service-locator"),
        ] {
            if missing {
                return Err(RefuseReason::MissingParameter(OBJECT, parameter).into());
            }
        }
        if self.entries.iter().any(|other| other.id == entry.id) {
            return Err(FailureReason::AlreadyRegistered.into());
        }
        if self.entries.len() >= BASIC_SERVICES_MAX {
            return Err(FailureReason::InternalError("no room for more services".to_owned()).into());
        }
        self.entries.push(entry.clone());
        Ok(Outcome::Done)
    }
}

impl Functions for StartService {
    fn perform(
        &mut self,
        _now: Time,
        _asker: &AgentId,
        function: &Function,
        _requests: &mut Vec<(AgentId, ManagementContent)>,
    ) -> Result<Outcome, NoResult> {
        match function {
            Function::GetServiceRoot => Ok(Outcome::ServiceRoot(self.entries.clone())),
            Function::SupplyBasicService(entry) => self.supply(entry),
            _ => Err(RefuseReason::UnsupportedFunction.into()),
        }
    }
}
