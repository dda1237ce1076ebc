//! The parts of a function block. The parser validates them, so every block can be evaluated.

use crate::{
    membership::Membership,
    operators::{Accumulation, Activation, And, Method, Or},
};

/// A linguistic value of a variable, such as `big`.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The name of the term, as written; compared without case.
    pub name: String,
    /// The degree to which each number belongs to the term.
    pub membership: Membership,
}

/// An input variable of a block, with its linguistic values.
#[derive(Clone, Debug, PartialEq)]
pub struct InputVariable {
    /// The name of the variable, as written; compared without case.
    pub name: String,
    /// The linguistic values of the variable.
    pub terms: Vec<Term>,
    /// The declared interval. `None`: from the least to the greatest point of the terms.
    pub range: Option<(f64, f64)>,
    /// The interval found at run time, onto which the declared one is mapped.
    pub(crate) found: Option<(f64, f64)>,
}

/// An output variable of a block, with its linguistic values and its method of defuzzification.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputVariable {
    /// The name of the variable, as written; compared without case.
    pub name: String,
    /// The linguistic values of the variable; either all are singletons, or none is.
    pub terms: Vec<Term>,
    /// The declared interval. `None`: from the least to the greatest point of the terms.
    pub range: Option<(f64, f64)>,
    /// The method of defuzzification.
    pub method: Method,
    /// The accumulation, if declared at the output and not at the rules.
    pub accumulation: Option<Accumulation>,
    /// The value of the variable if the rules conclude nothing about it; `None`: no value, so that the caller keeps the
    /// one before (`DEFAULT := NC`, or no `DEFAULT`).
    pub default: Option<f64>,
}

/// The condition of a rule. Numbers are indices of the block's inputs and of their terms.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "named as in the language")]
pub enum Condition {
    /// The value of an input belongs to a term.
    Is {
        /// Index of the input in [`FunctionBlock::inputs`].
        input: usize,
        /// Index of the term in [`InputVariable::terms`].
        term: usize,
    },
    /// The value of an input does not belong to a term: 1 − the degree of [`Condition::Is`].
    IsNot {
        /// Index of the input in [`FunctionBlock::inputs`].
        input: usize,
        /// Index of the term in [`InputVariable::terms`].
        term: usize,
    },
    /// Negation: 1 − the degree of the condition.
    Not(Box<Condition>),
    /// Conjunction of two or more conditions.
    And(Vec<Condition>),
    /// Disjunction of two or more conditions.
    Or(Vec<Condition>),
}

/// The conclusion of a rule. Numbers are indices of the block's outputs and of their terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "named as in the language")]
pub struct Conclusion {
    /// Index of the output in [`FunctionBlock::outputs`].
    pub output: usize,
    /// Index of the term in [`OutputVariable::terms`].
    pub term: usize,
}

/// A rule: IF condition THEN conclusions WITH weight.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The number or name of the rule, as written.
    pub label: String,
    /// The condition after `IF`.
    pub condition: Condition,
    /// The conclusions after `THEN`.
    pub conclusions: Vec<Conclusion>,
    /// The factor on the rule's degree, 0..=1.
    pub weight: f64,
}

/// A block of rules with common operators.
#[derive(Clone, Debug, PartialEq)]
pub struct RuleBlock {
    /// The name of the block, as written.
    pub name: String,
    /// The operator for AND.
    pub and: And,
    /// The operator for OR.
    pub or: Or,
    /// The effect of a rule's degree on the term it concludes.
    pub activation: Activation,
    /// The accumulation, for outputs that declare no accumulation.
    pub accumulation: Accumulation,
    /// The rules, in the order of the file.
    pub rules: Vec<Rule>,
}

/// A function block: variables, their terms, and rules.
///
/// Made by [`FunctionBlock::parse`]. Its `Display` writes FCL that parses to an equal block, except for intervals found
/// at run time.
#[derive(Clone, Debug, PartialEq)]
pub struct FunctionBlock {
    pub(crate) name: String,
    pub(crate) inputs: Vec<InputVariable>,
    pub(crate) outputs: Vec<OutputVariable>,
    /// Variables of `VAR` sections, which are not used.
    pub(crate) locals: Vec<String>,
    pub(crate) rule_blocks: Vec<RuleBlock>,
}

/// An error of [`FunctionBlock::layout_inputs`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// The block has no input of this name.
    #[error("the function block has no input `{0}`")]
    UnknownInput(String),
    /// An end or the width of the interval is not finite, or its ends are swapped.
    #[error("[{min}, {max}] is not an interval for `{input}`: its ends must be finite and in order")]
    BadInterval {
        /// The name of the input.
        input: String,
        /// The lower end.
        min: f64,
        /// The upper end.
        max: f64,
    },
}

impl FunctionBlock {
    /// Returns the name of the block; may be empty.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the inputs in order of declaration.
    pub fn inputs(&self) -> &[InputVariable] {
        &self.inputs
    }

    /// Returns the outputs in order of declaration.
    pub fn outputs(&self) -> &[OutputVariable] {
        &self.outputs
    }

    /// Returns the blocks of rules, in order of declaration.
    pub fn rule_blocks(&self) -> &[RuleBlock] {
        &self.rule_blocks
    }

    /// Returns all rules of all blocks, in the order of the text.
    pub fn rules(&self) -> impl Iterator<Item = &Rule> {
        self.rule_blocks.iter().flat_map(|block| &block.rules)
    }

    /// Returns the index of an input in [`Self::inputs`], by its name without case. `None`: there is no such input.
    pub fn input_index(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|input| input.name.eq_ignore_ascii_case(name))
    }

    /// Returns the index of an output in [`Self::outputs`], by its name without case. `None`: there is no such output.
    pub fn output_index(&self, name: &str) -> Option<usize> {
        self.outputs.iter().position(|output| output.name.eq_ignore_ascii_case(name))
    }

    /// Lays the terms of an input out over the interval found at run time: maps its declared range linearly onto [min,
    /// max], with all terms in it (MAGarRO, section 3.4: "the partition of these variables is made by linear
    /// distribution"). If min = max, every value stands for the middle of the declared range.
    ///
    /// - `name`: the name of the input, without case.
    /// - `min`, `max`: the ends of the interval, in the unit of the input's values.
    ///
    /// # Errors
    /// There is no such input, or the interval is invalid: an end or the width is not finite, or min > max.
    pub fn layout_inputs(&mut self, name: &str, min: f64, max: f64) -> Result<(), LayoutError> {
        let index = self.input_index(name).ok_or_else(|| LayoutError::UnknownInput(name.to_owned()))?;
        // The width must not overflow either
        if !(min.is_finite() && max.is_finite() && (max - min).is_finite() && min <= max) {
            return Err(LayoutError::BadInterval { input: name.to_owned(), min, max });
        }
        self.inputs[index].found = Some((min, max));
        Ok(())
    }
}

/// Returns the interval from the least to the greatest point of the terms.
fn extent(terms: &[Term]) -> (f64, f64) {
    terms
        .iter()
        .map(|term| term.membership.extent())
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
        .expect("the reader takes no variable without a term")
}

impl InputVariable {
    /// Returns the interval in which the terms are declared: the declared range, or else from the least to the greatest
    /// point of the terms.
    pub fn declared_range(&self) -> (f64, f64) {
        self.range.unwrap_or_else(|| extent(&self.terms))
    }

    /// Returns the interval over which the terms lie: the one found at run time, or else the declared one.
    pub fn interval(&self) -> (f64, f64) {
        self.found.unwrap_or_else(|| self.declared_range())
    }

    /// Returns the degree of each term at a value of [`Self::interval`], 0..=1, in the order of `terms`.
    pub fn grades(&self, value: f64) -> Vec<f64> {
        let x = self.to_declared(value);
        self.terms.iter().map(|term| term.membership.degree(x)).collect()
    }

    /// Maps a position in the declared range to a value of the interval found at run time, and returns it. Without such
    /// an interval returns the position itself; if the declared range has no width, returns the lower end of the
    /// interval.
    pub fn laid_out(&self, x: f64) -> f64 {
        let Some((min, max)) = self.found else { return x };
        let (low, high) = self.declared_range();
        if low == high { min } else { min + (x - low) / (high - low) * (max - min) }
    }

    /// Maps a value to its position in the declared range: the inverse of [`Self::laid_out`]. If the interval found at
    /// run time has no width, returns the middle of the declared range.
    pub(crate) fn to_declared(&self, x: f64) -> f64 {
        let Some((min, max)) = self.found else { return x };
        let (low, high) = self.declared_range();
        if min == max {
            return low + 0.5 * (high - low);
        }
        low + (x - min) / (max - min) * (high - low)
    }
}

impl OutputVariable {
    /// Returns the interval of defuzzification: the declared range, or else from the least to the greatest point of the
    /// terms.
    ///
    /// # Panics
    /// If there is neither a declared range nor a term, or a term without a point; the parser makes no such variable.
    pub fn declared_range(&self) -> (f64, f64) {
        self.range.unwrap_or_else(|| extent(&self.terms))
    }
}
