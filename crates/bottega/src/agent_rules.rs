//! The rules of a picture's agents.

use bottega_farm::{EngineChoice, Expert};

use crate::{
    engines::entry,
    error::Error,
    request::{IntegratorChoice, Request, RulesText},
    rule_texts::rule_texts,
    rules::{engine_choice, experts, technique_choice},
    technique_choice::TechniqueChoice,
};

/// The texts of the rules of a request.
#[derive(Clone, Debug, Default)]
pub struct RuleTexts {
    /// The rules of the agents; empty: the built-in ones.
    pub agents: Vec<RulesText>,
    /// The rules that choose the engine of each zone; `None`: there is only one engine.
    pub choice: Option<RulesText>,
    /// The rules that choose between paths and photons; `None`: the request does not leave this to rules.
    pub technique: Option<RulesText>,
}

impl RuleTexts {
    /// Reads the texts: those of the request, else those of the external engine.
    ///
    /// # Errors
    /// A file of rules cannot be read, or there is no such engine.
    pub fn of(request: &Request) -> Result<Self, Error> {
        let agents = if !request.work.rules.is_empty() || request.engine.is_builtin() {
            rule_texts(&request.work.rules)?
        } else {
            let (name, is_mixed) = request.engine.other()?;
            // With two engines only the default rules suit both.
            let of_engine =
                if is_mixed { None } else { RulesText::of_engine(&entry(&request.engine.manifests, name)?)? };
            of_engine.into_iter().collect()
        };
        let has_choice = request.engine.names.len() > 1;
        let choice = has_choice
            .then(|| RulesText::or_built_in(request.engine.rules.as_ref(), EngineChoice::RULES_NAME))
            .transpose()?;
        let is_auto = request.integrator.method == Some(IntegratorChoice::Auto);
        let technique = is_auto
            .then(|| RulesText::or_built_in(request.integrator.rules.as_ref(), TechniqueChoice::RULES_NAME))
            .transpose()?;
        Ok(Self { agents, choice, technique })
    }
}

/// The rules by which agents choose the parameters, the engine and the technique of zones.
#[derive(Clone, Debug)]
pub struct AgentRules {
    /// The rule sets of the agents, which carry them in turn; at least one.
    pub experts: Vec<Expert>,
    /// The rules that choose the engine of each zone; `None`: there is only one engine.
    pub choice: Option<EngineChoice>,
    /// The rules that choose between paths and photons; `None`: the request does not leave this to rules.
    pub technique: Option<TechniqueChoice>,
    /// Warnings about the rules.
    pub notes: Vec<String>,
    /// The texts that these rules were read from, for other machines; empty for built-in rules.
    pub texts: RuleTexts,
}

impl AgentRules {
    /// Reads the rules of a request.
    ///
    /// # Errors
    /// A file of rules cannot be read or used.
    pub fn of(request: &Request) -> Result<Self, Error> {
        let texts = RuleTexts::of(request)?;
        let (experts, notes) = experts(texts.agents.clone())?;
        let choice = texts.choice.clone().map(engine_choice).transpose()?;
        let technique = texts.technique.clone().map(technique_choice).transpose()?;
        Ok(Self { experts, choice, technique, notes, texts })
    }

    /// Returns the built-in rules, for work that no agent does.
    pub fn built_in() -> Self {
        let experts = vec![Expert::path_tracing()];
        Self { experts, choice: None, technique: None, notes: Vec::new(), texts: RuleTexts::default() }
    }

    /// Returns the rules with the rule set of this machine in front.
    ///
    /// - `turn`: index of that rule set, modulo their number.
    pub fn turned(mut self, turn: usize) -> Self {
        let turn = turn % self.experts.len();
        self.experts.rotate_left(turn);
        self
    }
}
