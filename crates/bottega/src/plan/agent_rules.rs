//! The rules of a picture's agents.

use bottega_farm::{EngineChoice, Expert};

use crate::{
    engines::{agent_rules, choice_rules},
    error::Error,
    request::Request,
    rules::{engine_choice, experts},
};

/// The rules by which agents choose the parameters and the engine of zones.
#[derive(Clone, Debug)]
pub struct AgentRules {
    /// The rule sets of the agents, which carry them in turn; at least one.
    pub experts: Vec<Expert>,
    /// The rules that choose the engine of each zone; `None`: there is only one engine.
    pub choice: Option<EngineChoice>,
    /// Warnings about the rules.
    pub notes: Vec<String>,
}

impl AgentRules {
    /// Reads the rules of a request.
    ///
    /// # Errors
    /// A file of rules cannot be read or used.
    pub fn of(request: &Request) -> Result<Self, Error> {
        let (experts, notes) = experts(agent_rules(request)?)?;
        let choice = choice_rules(request)?.map(engine_choice).transpose()?;
        Ok(Self { experts, choice, notes })
    }

    /// Returns the built-in rules, for work that no agent does.
    pub fn built_in() -> Self {
        Self { experts: vec![Expert::path_tracing()], choice: None, notes: Vec::new() }
    }

    /// Moves the rule set of a machine to the front.
    ///
    /// - `turn`: index of the rule set, modulo their number.
    pub fn turned(mut self, turn: usize) -> Self {
        let turn = turn % self.experts.len();
        self.experts.rotate_left(turn);
        self
    }
}
