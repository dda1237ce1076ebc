//! The Start Service: what a new agent asks first (MAGarRO, section 3.1; FIPA00001, service root).

use std::collections::BTreeMap;

use super::{
    management::{FailureReason, Function, Outcome, RefuseReason, ServiceEntry},
    ontology::{SERVICE_ENTRY, read_service_entry, service_entry},
    service::{Change, Functions, NoResult, Said, Step, Todo},
};
use crate::{Revision, Time, sl};

/// The most basic services of a platform.
pub const BASIC_SERVICES_MAX: usize = 256;

const PREFIX: &str = "start/";

/// The basic services of a platform. A second supply under a used identifier is a failure: an entry that agents
/// already hold must not change its meaning.
#[derive(Clone, Debug, Default)]
pub struct StartService {
    /// Those that are there from the start.
    own: Vec<ServiceEntry>,
    /// Those that were supplied, by identifier.
    supplied: BTreeMap<String, ServiceEntry>,
}

impl StartService {
    /// With the services that are there from the start, as the platform knows them.
    pub fn new(own: Vec<ServiceEntry>) -> Self {
        Self { own, supplied: BTreeMap::new() }
    }

    fn supply(&self, entry: &ServiceEntry) -> Result<Step, NoResult> {
        for (missing, parameter) in [
            (entry.id.is_empty(), "service-id"),
            (entry.service_type.is_empty(), "service-type"),
            (entry.addresses.is_empty(), "service-locator"),
        ] {
            if missing {
                return Err(RefuseReason::missing(SERVICE_ENTRY, parameter).into());
            }
        }
        if self.own.iter().any(|other| other.id == entry.id) || self.supplied.contains_key(&entry.id) {
            return Err(FailureReason::AlreadyRegistered.into());
        }
        if self.own.len() + self.supplied.len() >= BASIC_SERVICES_MAX {
            return Err(FailureReason::InternalError("no room for more services".to_owned()).into());
        }
        let change =
            Change { key: format!("{PREFIX}{}", entry.id).into(), text: sl::print_term(&service_entry(entry)) };
        Ok(Step::Write(change, Outcome::Done))
    }
}

impl Functions for StartService {
    const PREFIXES: &'static [&'static str] = &[PREFIX];

    fn learn(&mut self, _now: Time, key: &str, _revision: Revision, text: &str, _todo: &mut Todo) {
        let Some(id) = key.strip_prefix(PREFIX) else { return };
        match sl::parse_term(text).ok().and_then(|term| read_service_entry(&term).ok()) {
            Some(entry) => _ = self.supplied.insert(id.to_owned(), entry),
            None => _ = self.supplied.remove(id),
        }
    }

    fn perform(&mut self, _now: Time, _: &Said, function: &Function, _: &mut Todo) -> Result<Step, NoResult> {
        match function {
            Function::GetServiceRoot => {
                let all = self.own.iter().chain(self.supplied.values());
                Ok(Step::Done(Outcome::ServiceRoot(all.cloned().collect())))
            }
            Function::SupplyBasicService(entry) => self.supply(entry),
            other => Err(RefuseReason::UnsupportedFunction(other.word().into()).into()),
        }
    }
}
