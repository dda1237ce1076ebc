//! The Start Service: the first contact of a new agent (MAGarRO, section 3.1; FIPA00001, service root).

use std::collections::BTreeMap;

use super::{
    management::{FailureReason, Function, Outcome, RefuseReason, ServiceEntry, largest},
    ontology::{SERVICE_ENTRY, read_service_entry, service_entry},
    service::{Change, Functions, NoResult, Said, ServiceOutbox, Step},
    signature::{name_of_request, signed, written_by},
};
use crate::{Revision, Time, sl};

/// Maximum number of basic services of a platform.
pub const BASIC_SERVICES_MAX: usize = 256;

const PREFIX: &str = "start/";

/// The basic services of a platform: the functions of its Start Service. A second supply with a used identifier fails:
/// the meaning of an entry that agents already hold must not change.
#[derive(Clone, Debug, Default)]
pub struct StartService {
    /// The services from the configuration.
    own: Vec<ServiceEntry>,
    /// The supplied services by identifier, with the names of their requests.
    supplied: BTreeMap<String, (ServiceEntry, Option<String>)>,
}

impl StartService {
    /// Makes a Start Service with these initial services.
    pub fn new(own: Vec<ServiceEntry>) -> Self {
        Self { own, supplied: BTreeMap::new() }
    }

    fn supply(&self, request: &Said, entry: &ServiceEntry) -> Result<Step, NoResult> {
        for (missing, parameter) in [
            (entry.id.is_empty(), "service-id"),
            (entry.service_type.is_empty(), "service-type"),
            (entry.addresses.is_empty(), "service-locator"),
        ] {
            if missing {
                return Err(RefuseReason::missing(SERVICE_ENTRY, parameter).into());
            }
        }
        let name = name_of_request(request);
        if name.is_some() && self.supplied.get(&entry.id).is_some_and(|(known, by)| known == entry && *by == name) {
            // A repetition of the same request
            return Ok(Step::Done(Outcome::Done));
        }
        if self.own.iter().any(|other| other.id == entry.id) || self.supplied.contains_key(&entry.id) {
            return Err(FailureReason::AlreadyRegistered.into());
        }
        if self.own.len() + self.supplied.len() >= BASIC_SERVICES_MAX {
            return Err(FailureReason::InternalError("no room for more services".to_owned()).into());
        }
        let text = sl::print_term(&signed(service_entry(entry), request));
        let change = Change { key: format!("{PREFIX}{}", entry.id).into(), text };
        Ok(Step::Write(change, Outcome::Done))
    }
}

impl Functions for StartService {
    const PREFIXES: &'static [&'static str] = &[PREFIX];

    fn learn(&mut self, _now: Time, key: &str, _revision: Revision, text: &str, _todo: &mut ServiceOutbox) {
        let Some(id) = key.strip_prefix(PREFIX) else { return };
        let read = |term| Some((read_service_entry(&term).ok()?, written_by(SERVICE_ENTRY, &term)));
        match sl::parse_term(text).ok().and_then(read) {
            Some(entry) => _ = self.supplied.insert(id.to_owned(), entry),
            None => _ = self.supplied.remove(id),
        }
    }

    fn perform(
        &mut self,
        _now: Time,
        request: &Said,
        function: &Function,
        _: &mut ServiceOutbox,
    ) -> Result<Step, NoResult> {
        match function {
            Function::GetServiceRoot => {
                let all = self.own.iter().chain(self.supplied.values().map(|(entry, _)| entry));
                Ok(Step::Done(Outcome::ServiceRoot(all.cloned().collect())))
            }
            Function::SupplyBasicService(entry) => self.supply(request, entry),
            other => Err(RefuseReason::UnsupportedFunction(other.word().into()).into()),
        }
    }

    fn too_large(&self, function: &Function) -> RefuseReason {
        let Function::SupplyBasicService(entry) = function else {
            return RefuseReason::UnsupportedFunction(function.word().into());
        };
        let locator = entry.addresses.iter().map(String::len).sum();
        let sizes =
            [("service-locator", locator), ("service-type", entry.service_type.len()), ("service-id", entry.id.len())];
        largest(SERVICE_ENTRY, &sizes)
    }
}
