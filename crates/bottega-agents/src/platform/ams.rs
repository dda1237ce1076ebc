//! The Agent Management System: white pages and life cycle (FIPA00023).

use std::collections::BTreeMap;

use super::{
    LifeCycleState, Transition,
    management::{
        AmsAgentDescription, FailureReason, Function, LifeCycleRequest, ManagementContent, Outcome,
        PlatformDescription, RefuseReason,
    },
    service::{Functions, NoResult},
};
use crate::{AgentId, Time};

/// The most agents of a platform.
pub const AGENTS_MAX: usize = 1 << 16;

const OBJECT: &str = "ams-agent-description";

/// The agents of a platform.
///
/// An agent may enter, change and take out itself; what the `administrators` may do to all.
#[derive(Clone, Debug)]
pub struct Ams {
    platform: PlatformDescription,
    administrators: Vec<AgentId>,
    /// By name; each has a name and a state.
    agents: BTreeMap<AgentId, AmsAgentDescription>,
}

impl Ams {
    /// An AMS that knows nobody yet.
    pub fn new(platform: PlatformDescription, administrators: Vec<AgentId>) -> Self {
        Self { platform, administrators, agents: BTreeMap::new() }
    }

    /// Where an agent stands in its life, if it is known.
    pub fn state(&self, agent: &AgentId) -> Option<LifeCycleState> {
        self.agents.get(agent)?.state
    }

    /// The name in a description, if `asker` may touch its entry.
    fn authorised(&self, asker: &AgentId, description: &AmsAgentDescription) -> Result<AgentId, NoResult> {
        let Some(name) = &description.name else {
            return Err(RefuseReason::MissingParameter(OBJECT, "name").into());
        };
        if name == asker || self.administrators.contains(asker) {
            return Ok(name.clone());
        }
        Err(RefuseReason::Unauthorised.into())
    }

    fn register(&mut self, asker: &AgentId, description: &AmsAgentDescription) -> Result<Outcome, NoResult> {
        let name = self.authorised(asker, description)?;
        if self.agents.contains_key(&name) {
            return Err(FailureReason::AlreadyRegistered.into());
        }
        let state = description.state.unwrap_or(LifeCycleState::Active);
        if !matches!(state, LifeCycleState::Initiated | LifeCycleState::Active) {
            return Err(RefuseReason::UnrecognisedParameterValue(OBJECT, "state").into());
        }
        if self.agents.len() >= AGENTS_MAX {
            return Err(FailureReason::InternalError("no room for more agents".to_owned()).into());
        }
        self.agents.insert(name, AmsAgentDescription { state: Some(state), ..description.clone() });
        Ok(Outcome::Done)
    }

    fn modify(
        &mut self,
        asker: &AgentId,
        description: &AmsAgentDescription,
        requests: &mut Vec<(AgentId, ManagementContent)>,
    ) -> Result<Outcome, NoResult> {
        let name = self.authorised(asker, description)?;
        let Some(before) = self.agents.get(&name).and_then(|entry| entry.state) else {
            return Err(FailureReason::NotRegistered.into());
        };
        let after = description.state.unwrap_or(before);
        if after != before {
            let forbidden = RefuseReason::UnrecognisedParameterValue(OBJECT, "state");
            let transition = before.transition_to(after).ok_or(forbidden)?;
            let by_platform = self.administrators.contains(asker) && transition.by_platform();
            if !(by_platform || *asker == name && transition.by_agent()) {
                return Err(RefuseReason::Unauthorised.into());
            }
            let request = match transition {
                Transition::Suspend => Some(LifeCycleRequest::Suspend),
                Transition::Invoke | Transition::Resume | Transition::WakeUp | Transition::Execute => {
                    Some(LifeCycleRequest::Resume)
                }
                // The agent has done it by itself.
                Transition::Wait | Transition::Move => None,
            };
            requests.extend(request.map(|request| (name.clone(), ManagementContent::LifeCycle(request))));
        }
        self.agents.insert(name, AmsAgentDescription { state: Some(after), ..description.clone() });
        Ok(Outcome::Done)
    }

    fn terminate(
        &mut self,
        asker: &AgentId,
        agent: &AgentId,
        graceful: bool,
        requests: &mut Vec<(AgentId, ManagementContent)>,
    ) -> Result<Outcome, NoResult> {
        let description = AmsAgentDescription { name: Some(agent.clone()), ..Default::default() };
        self.authorised(asker, &description)?;
        // Destroy is the platform's alone.
        if !graceful && !self.administrators.contains(asker) {
            return Err(RefuseReason::Unauthorised.into());
        }
        if !self.agents.contains_key(agent) {
            return Err(FailureReason::NotRegistered.into());
        }
        let request = if graceful {
            // It stays known until it has taken itself out: it may ignore this.
            LifeCycleRequest::Quit
        } else {
            self.agents.remove(agent);
            LifeCycleRequest::Destroy
        };
        requests.push((agent.clone(), ManagementContent::LifeCycle(request)));
        Ok(Outcome::Done)
    }
}

impl Functions for Ams {
    fn perform(
        &mut self,
        _now: Time,
        asker: &AgentId,
        function: &Function,
        requests: &mut Vec<(AgentId, ManagementContent)>,
    ) -> Result<Outcome, NoResult> {
        match function {
            Function::RegisterAgent(description) => self.register(asker, description),
            Function::ModifyAgent(description) => self.modify(asker, description, requests),
            Function::DeregisterAgent(description) => {
                let name = self.authorised(asker, description)?;
                self.agents.remove(&name).ok_or(FailureReason::NotRegistered)?;
                Ok(Outcome::Done)
            }
            Function::SearchAgents(template, constraints) => {
                let found = self.agents.values().filter(|agent| template.matches(agent));
                Ok(Outcome::Agents(found.take(constraints.results_max(AGENTS_MAX)).cloned().collect()))
            }
            Function::TerminateAgent { agent, graceful } => self.terminate(asker, agent, *graceful, requests),
            Function::GetDescription => Ok(Outcome::Platform(self.platform.clone())),
            _ => Err(RefuseReason::UnsupportedFunction.into()),
        }
    }
}
