//! The Directory Facilitator: yellow pages with leases (FIPA00023).

use std::{collections::BTreeMap, time::Duration};

use super::{
    management::{DfAgentDescription, FailureReason, Function, ManagementContent, Outcome, RefuseReason},
    service::{Functions, NoResult},
};
use crate::{AgentId, Time};

/// The most entries of a directory.
pub const DESCRIPTIONS_MAX: usize = 1 << 16;

const OBJECT: &str = "df-agent-description";

/// What agents offer. An agent may enter, change and take out only what it offers itself.
#[derive(Clone, Debug, Default)]
pub struct Df {
    entries: BTreeMap<AgentId, DfAgentDescription>,
    /// The longest lease that is granted. `None`: any, also one without end.
    lease_max: Option<Duration>,
}

impl Df {
    /// An empty directory that grants leases of no more than so long.
    pub fn new(lease_max: Option<Duration>) -> Self {
        Self { entries: BTreeMap::new(), lease_max }
    }

    fn own_name(asker: &AgentId, description: &DfAgentDescription) -> Result<AgentId, NoResult> {
        match &description.name {
            None => Err(RefuseReason::MissingParameter(OBJECT, "name").into()),
            Some(name) if name == asker => Ok(name.clone()),
            Some(_) => Err(RefuseReason::Unauthorised.into()),
        }
    }

    /// Enters a description, with the lease that is granted.
    fn enter(&mut self, now: Time, name: AgentId, description: &DfAgentDescription) -> Result<Outcome, NoResult> {
        for service in &description.services {
            for (missing, parameter) in [(service.name.is_none(), "name"), (service.service_type.is_none(), "type")] {
                if missing {
                    return Err(RefuseReason::MissingParameter("service-description", parameter).into());
                }
            }
        }
        if description.lease_time.is_some_and(|end| end <= now) {
            return Err(RefuseReason::UnrecognisedParameterValue(OBJECT, "lease-time").into());
        }
        let most = self.lease_max.map(|lease| now + lease);
        let lease_time = match (description.lease_time, most) {
            (Some(wanted), Some(most)) => Some(wanted.min(most)),
            (wanted, most) => wanted.or(most),
        };
        let entry = DfAgentDescription { lease_time, ..description.clone() };
        self.entries.insert(name, entry.clone());
        Ok(Outcome::Entered(entry))
    }
}

impl Functions for Df {
    fn perform(
        &mut self,
        now: Time,
        asker: &AgentId,
        function: &Function,
        _requests: &mut Vec<(AgentId, ManagementContent)>,
    ) -> Result<Outcome, NoResult> {
        match function {
            Function::Register(description) => {
                let name = Self::own_name(asker, description)?;
                if self.entries.contains_key(&name) {
                    return Err(FailureReason::AlreadyRegistered.into());
                }
                if self.entries.len() >= DESCRIPTIONS_MAX {
                    return Err(FailureReason::InternalError("no room for more entries".to_owned()).into());
                }
                self.enter(now, name, description)
            }
            Function::Modify(description) => {
                let name = Self::own_name(asker, description)?;
                if !self.entries.contains_key(&name) {
                    return Err(FailureReason::NotRegistered.into());
                }
                self.enter(now, name, description)
            }
            Function::Deregister(description) => {
                let name = Self::own_name(asker, description)?;
                self.entries.remove(&name).ok_or(FailureReason::NotRegistered)?;
                Ok(Outcome::Done)
            }
            Function::Search(template, constraints) => {
                let found = self.entries.values().filter(|entry| template.matches(entry));
                Ok(Outcome::Offers(found.take(constraints.results_max(DESCRIPTIONS_MAX)).cloned().collect()))
            }
            _ => Err(RefuseReason::UnsupportedFunction.into()),
        }
    }

    fn tick(&mut self, now: Time) {
        self.entries.retain(|_, entry| entry.lease_time.is_none_or(|end| now < end));
    }

    fn next_deadline(&self) -> Option<Time> {
        self.entries.values().filter_map(|entry| entry.lease_time).min()
    }
}
