//! Mamdani inference: fuzzification, aggregation, weighting, activation, accumulation, defuzzification.

use std::fmt;

use crate::{
    aggregate::{ActiveOutput, Aggregate, aggregate, defuzzify},
    block::{Condition, FunctionBlock, RuleBlock},
    operators::Accumulation,
};

/// An error in evaluating a block.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluateError {
    /// A value was given for this name, which no input has.
    #[error("the function block has no input `{0}`")]
    UnknownInput(String),
    /// No value was given for the input of this name.
    #[error("the input `{0}` has no value")]
    MissingInput(String),
    /// The value of the input of this name is NaN.
    #[error("the value of the input `{0}` is not a number")]
    NotANumber(String),
    /// The number of values given to [`FunctionBlock::evaluate_indexed`] is wrong.
    #[error("{given} values for {wanted} inputs")]
    WrongCount {
        /// Number of values given.
        given: usize,
        /// Number of inputs.
        wanted: usize,
    },
}

/// The values of all outputs of a function block, by one evaluation.
#[derive(Clone, Debug, PartialEq)]
pub struct Outputs {
    names: Vec<String>,
    values: Vec<Option<f64>>,
}

impl Outputs {
    /// Returns the value of an output, by its name without case. `None`: there is no such output, or the rules
    /// concluded nothing about it within its range and it has no default.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.values[self.names.iter().position(|output| output.eq_ignore_ascii_case(name))?]
    }

    /// Returns the values in the order of [`FunctionBlock::outputs`]. `None`: the rules concluded nothing about the
    /// output within its range, and it has no default.
    pub fn values(&self) -> &[Option<f64>] {
        &self.values
    }

    /// Returns these outputs, in which those without a value keep that of an earlier evaluation of the same block: the
    /// meaning of `DEFAULT := NC`, no change.
    #[must_use]
    pub fn or_unchanged(mut self, before: &Self) -> Self {
        for (value, before) in self.values.iter_mut().zip(&before.values) {
            *value = value.or(*before);
        }
        self
    }
}

/// A rule that fired, with its degree.
#[derive(Clone, Debug, PartialEq)]
pub struct FiredRule {
    /// The rule's label.
    pub label: String,
    /// The degree of the rule's condition times its weight; above 0.
    pub degree: f64,
    /// The conclusions of the rule, as `output IS term`.
    pub conclusions: Vec<String>,
}

/// An explanation of an evaluation: the degrees of terms and rules that led to the outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// For each input, in order of declaration, its name and its terms with degrees above 0.
    pub inputs: Vec<(String, Vec<(String, f64)>)>,
    /// The rules that fired, the strongest first; of equal ones the first in the text.
    pub rules: Vec<FiredRule>,
    /// The accumulated conclusions for each output, in the order of [`FunctionBlock::outputs`].
    pub aggregates: Vec<Aggregate>,
    /// The values of the outputs.
    pub outputs: Outputs,
}

impl FunctionBlock {
    /// Evaluates the rules and returns the values of all outputs. Values outside of an input's range are allowed:
    /// beyond its outermost points a term keeps the degree that it has there; a singleton has degree 0. Evaluations are
    /// independent, see [`Outputs::or_unchanged`].
    ///
    /// - `inputs`: each input's name, without case, and its value, in any order. Of several values of one input the
    ///   last counts.
    ///
    /// # Errors
    /// The block has no such input, an input of the block has no value, or a value is NaN.
    pub fn evaluate(&self, inputs: &[(&str, f64)]) -> Result<Outputs, EvaluateError> {
        self.evaluate_indexed(&self.in_order(inputs)?)
    }

    /// Like [`Self::evaluate`], with the values in the order of [`FunctionBlock::inputs`]. Returns the values of all
    /// outputs.
    ///
    /// # Errors
    /// The number of values is wrong, or a value is NaN.
    pub fn evaluate_indexed(&self, values: &[f64]) -> Result<Outputs, EvaluateError> {
        let grades = self.grades(values)?;
        Ok(self.outputs_of(&self.degrees(&grades)))
    }

    /// Evaluates the rules as [`Self::evaluate`] does. Returns the outputs with the degrees of the inputs' terms, the
    /// rules that fired, and the aggregate for each output.
    ///
    /// # Errors
    /// As for [`Self::evaluate`].
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
        let aggregates = (0..self.outputs.len()).map(|output| {
            let (accumulation, activated) = self.activated(output, &degrees);
            aggregate(accumulation, self.outputs[output].declared_range(), &activated)
        });
        let (aggregates, outputs) = (aggregates.collect(), self.outputs_of(&degrees));
        Ok(Explanation { inputs: inputs.collect(), rules, aggregates, outputs })
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

    /// Fuzzifies: returns the degree of each term of each input.
    fn grades(&self, values: &[f64]) -> Result<Vec<Vec<f64>>, EvaluateError> {
        if values.len() != self.inputs.len() {
            return Err(EvaluateError::WrongCount { given: values.len(), wanted: self.inputs.len() });
        }
        let mut grades = Vec::with_capacity(values.len());
        for (input, &value) in self.inputs.iter().zip(values) {
            if value.is_nan() {
                return Err(EvaluateError::NotANumber(input.name.clone()));
            }
            grades.push(input.grades(value));
        }
        Ok(grades)
    }

    /// Returns the weighted degree of each rule.
    fn degrees(&self, grades: &[Vec<f64>]) -> Vec<f64> {
        let grade = |input: usize, term: usize| grades[input][term];
        let of = |block: &RuleBlock, condition: &Condition| degree(block, condition, &grade);
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
        let (accumulation, activated) = self.activated(index, degrees);
        defuzzify(output.method, accumulation, output.declared_range(), &activated).or(output.default)
    }

    /// Returns the activated terms of an output, with their accumulation.
    fn activated(&self, index: usize, degrees: &[f64]) -> (Accumulation, Vec<ActiveOutput<'_>>) {
        let output = &self.outputs[index];
        let accumulation = self.accumulation_of(index);
        let mut activated: Vec<ActiveOutput<'_>> = Vec::new();
        let rules = self.rule_blocks.iter().flat_map(|block| block.rules.iter().map(move |rule| (block, rule)));
        for ((block, rule), &degree) in rules.zip(degrees).filter(|(_, degree)| **degree > 0.0) {
            for conclusion in rule.conclusions.iter().filter(|conclusion| conclusion.output == index) {
                let term = &output.terms[conclusion.term].membership;
                add(accumulation, ActiveOutput { term, activation: block.activation, degree }, &mut activated);
            }
        }
        (accumulation, activated)
    }

    /// Returns the accumulation of an output: its own, or else that of the first block with rules on it.
    pub(crate) fn accumulation_of(&self, index: usize) -> Accumulation {
        let speaks = |block: &&RuleBlock| {
            block.rules.iter().any(|rule| rule.conclusions.iter().any(|conclusion| conclusion.output == index))
        };
        let of_rules = || self.rule_blocks.iter().find(speaks).map(|block| block.accumulation);
        self.outputs[index].accumulation.or_else(of_rules).unwrap_or_default()
    }
}

/// Adds a conclusion. Under MAX, the stronger one of two on the same term replaces the other.
fn add<'a>(accumulation: Accumulation, one: ActiveOutput<'a>, activated: &mut Vec<ActiveOutput<'a>>) {
    use crate::membership::Membership;
    let same = |other: &&mut ActiveOutput<'a>| {
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

/// Returns the degree to which a condition holds.
///
/// - `grade`: the degree of a term of an input, by their indices.
pub(crate) fn degree(block: &RuleBlock, condition: &Condition, grade: &impl Fn(usize, usize) -> f64) -> f64 {
    let of = |part: &Condition| degree(block, part, grade);
    match condition {
        Condition::Is { input, term } => grade(*input, *term),
        Condition::IsNot { input, term } => 1.0 - grade(*input, *term),
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
        for (name, aggregate) in self.outputs.names.iter().zip(&self.aggregates) {
            let (Aggregate::Singletons(points) | Aggregate::Linear(points)) = aggregate;
            let points: Vec<String> = points.iter().map(|(x, y)| format!("({x:.4}, {y:.4})")).collect();
            writeln!(
                f,
                "{name} is, together, {}",
                if points.is_empty() { "nothing".into() } else { points.join(" ") }
            )?;
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
