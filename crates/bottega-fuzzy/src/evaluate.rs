//! Mamdani inference: fuzzify, aggregate, weigh, activate, accumulate, defuzzify.

use std::fmt;

use crate::{
    aggregate::{Activated, defuzzify},
    block::{Condition, FunctionBlock, RuleBlock},
    operators::Accumulation,
};

/// Why a block could not be evaluated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluateError {
    /// A value for a variable that is no input.
    #[error("the function block has no input `{0}`")]
    UnknownInput(String),
    /// An input without a value.
    #[error("the input `{0}` has no value")]
    MissingInput(String),
    /// A value that is not a number.
    #[error("the value of the input `{0}` is not a number")]
    NotANumber(String),
    /// [`FunctionBlock::evaluate_indexed`] was given too few or too many.
    #[error("{given} values for {wanted} inputs")]
    WrongCount {
        /// How many came.
        given: usize,
        /// How many inputs there are.
        wanted: usize,
    },
}

/// The values of all outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Outputs {
    names: Vec<String>,
    values: Vec<Option<f64>>,
}

impl Outputs {
    /// The value of an output, by its name without case. `None`: there is no such output, or no rule on it fired and
    /// it has no default.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.values[self.names.iter().position(|output| output.eq_ignore_ascii_case(name))?]
    }

    /// The values in the order of [`FunctionBlock::outputs`].
    pub fn values(&self) -> &[Option<f64>] {
        &self.values
    }

    /// Where an output has no value, takes the one it had: the meaning of `DEFAULT := NC`, no change.
    #[must_use]
    pub fn or_unchanged(mut self, before: &Self) -> Self {
        for (value, before) in self.values.iter_mut().zip(&before.values) {
            *value = value.or(*before);
        }
        self
    }
}

/// How much a rule had to say.
#[derive(Clone, Debug, PartialEq)]
pub struct FiredRule {
    /// The rule's label.
    pub label: String,
    /// How much its condition held, times its weight; above 0.
    pub degree: f64,
    /// What it concluded, as `output IS term`.
    pub conclusions: Vec<String>,
}

/// Why the outputs are what they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// For each input its name, and each of its terms with the degree to which it holds, where above 0.
    pub inputs: Vec<(String, Vec<(String, f64)>)>,
    /// The rules that fired, the strongest first; of equal ones the first in the text.
    pub rules: Vec<FiredRule>,
    /// The result.
    pub outputs: Outputs,
}

impl FunctionBlock {
    /// Evaluates the rules. Every input needs a value, in any order; values outside of the range are answered by the
    /// shoulders of the terms. Nothing is remembered between evaluations, see [`Outputs::or_unchanged`].
    ///
    /// # Errors
    /// An unknown, missing or NaN input.
    pub fn evaluate(&self, inputs: &[(&str, f64)]) -> Result<Outputs, EvaluateError> {
        self.evaluate_indexed(&self.in_order(inputs)?)
    }

    /// The same with the values in the order of [`FunctionBlock::inputs`].
    ///
    /// # Errors
    /// A wrong number of values, or a NaN.
    pub fn evaluate_indexed(&self, values: &[f64]) -> Result<Outputs, EvaluateError> {
        let grades = self.grades(values)?;
        Ok(self.outputs_of(&self.degrees(&grades)))
    }

    /// Evaluates the rules and says which of them fired, and how strongly.
    ///
    /// # Errors
    /// As [`Self::evaluate`].
    pub fn explain(&self, inputs: &[(&str, f64)]) -> Result<Explanation, EvaluateError> {
        let grades = self.grades(&self.in_order(inputs)?)?;
        let degrees = self.degrees(&grades);
        let conclusion = |output: usize, term: usize| {
            format!("{} IS {}", self.outputs[output].name, self.outputs[output].terms[term].name)
        };
        let mut rules: Vec<FiredRule> = self
            .rules()
            .zip(&degrees)
            .filter(|(_, degree)| **degree > 0.0)
            .map(|(rule, &degree)| FiredRule {
                label: rule.label.clone(),
                degree,
                conclusions: rule.conclusions.iter().map(|c| conclusion(c.output, c.term)).collect(),
            })
            .collect();
        rules.sort_by(|a, b| b.degree.total_cmp(&a.degree));
        let inputs = self.inputs.iter().zip(&grades).map(|(input, grades)| {
            let held = input.terms.iter().zip(grades).filter(|(_, grade)| **grade > 0.0);
            (input.name.clone(), held.map(|(term, grade)| (term.name.clone(), *grade)).collect())
        });
        Ok(Explanation { inputs: inputs.collect(), rules, outputs: self.outputs_of(&degrees) })
    }

    fn in_order(&self, inputs: &[(&str, f64)]) -> Result<Vec<f64>, EvaluateError> {
        let mut values = vec![None; self.inputs.len()];
        for (name, value) in inputs {
            let index = self.input_index(name).ok_or_else(|| EvaluateError::UnknownInput((*name).to_owned()))?;
            values[index] = Some(*value);
        }
        let missing = |index: usize| EvaluateError::MissingInput(self.inputs[index].name.clone());
        values.into_iter().enumerate().map(|(index, value)| value.ok_or_else(|| missing(index))).collect()
    }

    /// Fuzzifies: the degree of each term of each input.
    fn grades(&self, values: &[f64]) -> Result<Vec<Vec<f64>>, EvaluateError> {
        if values.len() != self.inputs.len() {
            return Err(EvaluateError::WrongCount { given: values.len(), wanted: self.inputs.len() });
        }
        let mut grades = Vec::with_capacity(values.len());
        for (input, &value) in self.inputs.iter().zip(values) {
            if value.is_nan() {
                return Err(EvaluateError::NotANumber(input.name.clone()));
            }
            let x = input.to_declared(value);
            grades.push(input.terms.iter().map(|term| term.membership.degree(x)).collect());
        }
        Ok(grades)
    }

    /// The degree of each rule, weighed.
    fn degrees(&self, grades: &[Vec<f64>]) -> Vec<f64> {
        let of = |block: &RuleBlock, condition: &Condition| degree(block, condition, grades);
        self.rule_blocks
            .iter()
            .flat_map(|block| block.rules.iter().map(move |rule| of(block, &rule.condition) * rule.weight))
            .collect()
    }

    fn outputs_of(&self, degrees: &[f64]) -> Outputs {
        let values = (0..self.outputs.len()).map(|output| self.value_of(output, degrees));
        Outputs { values: values.collect(), names: self.outputs.iter().map(|output| output.name.clone()).collect() }
    }

    fn value_of(&self, index: usize, degrees: &[f64]) -> Option<f64> {
        let output = &self.outputs[index];
        let mut accumulation = output.accumulation;
        let mut activated: Vec<Activated<'_>> = Vec::new();
        let rules = self.rule_blocks.iter().flat_map(|block| block.rules.iter().map(move |rule| (block, rule)));
        for ((block, rule), &degree) in rules.zip(degrees) {
            for conclusion in rule.conclusions.iter().filter(|conclusion| conclusion.output == index) {
                // The first block that speaks of the output decides, where the output itself does not.
                let accumulation = *accumulation.get_or_insert(block.accumulation);
                if degree > 0.0 {
                    let term = &output.terms[conclusion.term].membership;
                    let one = Activated { term, activation: block.activation, degree };
                    add(accumulation, one, &mut activated);
                }
            }
        }
        let accumulation = accumulation.unwrap_or_default();
        defuzzify(output.method, accumulation, output.declared_range(), &activated).or(output.default)
    }
}

/// Adds a conclusion. Under MAX, of two on the same function the stronger one covers the other.
fn add<'a>(accumulation: Accumulation, one: Activated<'a>, activated: &mut Vec<Activated<'a>>) {
    use crate::membership::Membership;
    let same = |other: &&mut Activated<'a>| {
        std::ptr::eq(other.term, one.term)
            && other.activation == one.activation
            && accumulation == Accumulation::Max
            && matches!(one.term, Membership::Linear(_))
    };
    match activated.iter_mut().find(same) {
        Some(other) => other.degree = other.degree.max(one.degree),
        None => activated.push(one),
    }
}

fn degree(block: &RuleBlock, condition: &Condition, grades: &[Vec<f64>]) -> f64 {
    let of = |part: &Condition| degree(block, part, grades);
    match condition {
        Condition::Is { input, term } => grades[*input][*term],
        Condition::IsNot { input, term } => 1.0 - grades[*input][*term],
        Condition::Not(part) => 1.0 - of(part),
        Condition::And(parts) => parts.iter().map(of).fold(1.0, |a, b| block.and.join(a, b)),
        Condition::Or(parts) => parts.iter().map(of).fold(0.0, |a, b| block.or.join(a, b)),
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, terms) in &self.inputs {
            let terms: Vec<String> = terms.iter().map(|(term, grade)| format!("{term} {grade:.3}")).collect();
            writeln!(f, "{name} is {}", terms.join(", "))?;
        }
        for rule in &self.rules {
            writeln!(f, "rule {} fires at {:.3}: {}", rule.label, rule.degree, rule.conclusions.join(", "))?;
        }
        for (name, value) in self.outputs.names.iter().zip(&self.outputs.values) {
            match value {
                Some(value) => writeln!(f, "{name} = {value}")?,
                None => writeln!(f, "{name} has no value")?,
            }
        }
        Ok(())
    }
}
