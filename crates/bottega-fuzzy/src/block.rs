//! The parts of a function block. Its reader checks them, so that whatever is here can be evaluated.

use crate::{
    membership::Membership,
    operators::{Accumulation, Activation, And, Method, Or},
};

/// A linguistic value: `big`.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Its name, as written; compared without case.
    pub name: String,
    /// How much a number belongs to it.
    pub membership: Membership,
}

/// A variable that comes in.
#[derive(Clone, Debug, PartialEq)]
pub struct InputVariable {
    /// Its name, as written; compared without case.
    pub name: String,
    /// Its values.
    pub terms: Vec<Term>,
    /// The declared interval. `None`: from the least to the greatest point of the terms.
    pub range: Option<(f64, f64)>,
    /// The interval found at run time, which is laid onto the declared one.
    pub(crate) found: Option<(f64, f64)>,
}

/// A variable that goes out.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputVariable {
    /// Its name, as written; compared without case.
    pub name: String,
    /// Its values; all singletons or none.
    pub terms: Vec<Term>,
    /// The declared interval. `None`: from the least to the greatest point of the terms.
    pub range: Option<(f64, f64)>,
    /// How its number is found.
    pub method: Method,
    /// How rules on it are joined, where that is said at the output and not at the rules.
    pub accumulation: Option<Accumulation>,
    /// Its value when no rule fires. `None`: no change.
    pub default: Option<f64>,
}

/// The condition of a rule. Numbers are indices of the block's inputs and of their terms.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "named as in the language")]
pub enum Condition {
    Is {
        input: usize,
        term: usize,
    },
    IsNot {
        input: usize,
        term: usize,
    },
    Not(Box<Condition>),
    /// Two or more.
    And(Vec<Condition>),
    /// Two or more.
    Or(Vec<Condition>),
}

/// The conclusion of a rule. Numbers are indices of the block's outputs and of their terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "named as in the language")]
pub struct Conclusion {
    pub output: usize,
    pub term: usize,
}

/// IF condition THEN conclusions WITH weight.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// Its number or name.
    pub label: String,
    /// When it fires.
    pub condition: Condition,
    /// What it says.
    pub conclusions: Vec<Conclusion>,
    /// How much it counts, 0..=1.
    pub weight: f64,
}

/// Rules under common operators.
#[derive(Clone, Debug, PartialEq)]
pub struct RuleBlock {
    /// Its name.
    pub name: String,
    /// How AND joins.
    pub and: And,
    /// How OR joins.
    pub or: Or,
    /// How degrees act on terms.
    pub activation: Activation,
    /// How rules on one output are joined, where the output does not say it.
    pub accumulation: Accumulation,
    /// The rules.
    pub rules: Vec<Rule>,
}

/// A function block: variables, their terms, and rules.
///
/// Made by [`FunctionBlock::parse`], written by its `Display`, which parses to an equal block; but intervals found at
/// run time are no part of the text.
#[derive(Clone, Debug, PartialEq)]
pub struct FunctionBlock {
    pub(crate) name: String,
    pub(crate) inputs: Vec<InputVariable>,
    pub(crate) outputs: Vec<OutputVariable>,
    /// Variables of `VAR` sections; nothing reads or writes them.
    pub(crate) locals: Vec<String>,
    pub(crate) rule_blocks: Vec<RuleBlock>,
}

/// Why an interval found at run time cannot be laid out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// No such input.
    #[error("the function block has no input `{0}`")]
    UnknownInput(String),
    /// The interval is none.
    #[error("[{min}, {max}] is no interval for `{input}`: its ends must be finite and in order")]
    BadInterval {
        /// Which input.
        input: String,
        /// The lower end.
        min: f64,
        /// The upper end.
        max: f64,
    },
}

impl FunctionBlock {
    /// The name of the block; may be empty.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The inputs in order of declaration.
    pub fn inputs(&self) -> &[InputVariable] {
        &self.inputs
    }

    /// The outputs in order of declaration.
    pub fn outputs(&self) -> &[OutputVariable] {
        &self.outputs
    }

    /// The blocks of rules.
    pub fn rule_blocks(&self) -> &[RuleBlock] {
        &self.rule_blocks
    }

    /// All rules of all blocks in order.
    pub fn rules(&self) -> impl Iterator<Item = &Rule> {
        self.rule_blocks.iter().flat_map(|block| &block.rules)
    }

    /// Where an input stands in [`Self::inputs`], by its name without case.
    pub fn input_index(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|input| input.name.eq_ignore_ascii_case(name))
    }

    /// Where an output stands in [`Self::outputs`], by its name without case.
    pub fn output_index(&self, name: &str) -> Option<usize> {
        self.outputs.iter().position(|output| output.name.eq_ignore_ascii_case(name))
    }

    /// Lays an input's terms out over the interval that was found at run time: its declared range is moved and
    /// stretched onto [min, max] with all terms in it (MAGarRO, section 3.4: "the partition of these variables is made
    /// by linear distribution"). Where min = max, every value stands for the middle of the declared range.
    ///
    /// # Errors
    /// No such input, or no finite interval.
    pub fn layout_inputs(&mut self, name: &str, min: f64, max: f64) -> Result<(), LayoutError> {
        let index = self.input_index(name).ok_or_else(|| LayoutError::UnknownInput(name.to_owned()))?;
        // A width that overflows is no width either.
        if !(min.is_finite() && max.is_finite() && (max - min).is_finite() && min <= max) {
            return Err(LayoutError::BadInterval { input: name.to_owned(), min, max });
        }
        self.inputs[index].found = Some((min, max));
        Ok(())
    }
}

/// The interval from the least to the greatest point of the terms.
fn extent(terms: &[Term]) -> (f64, f64) {
    terms
        .iter()
        .map(|term| term.membership.extent())
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
        .expect("the reader takes no variable without a term")
}

impl InputVariable {
    /// The interval in which the terms are declared.
    pub fn declared_range(&self) -> (f64, f64) {
        self.range.unwrap_or_else(|| extent(&self.terms))
    }

    /// The interval over which its terms lie: the one found at run time, or else the declared one.
    pub fn interval(&self) -> (f64, f64) {
        self.found.unwrap_or_else(|| self.declared_range())
    }

    /// The degree of each of its terms at a value, 0..=1, in their order.
    pub fn grades(&self, value: f64) -> Vec<f64> {
        let x = self.to_declared(value);
        self.terms.iter().map(|term| term.membership.degree(x)).collect()
    }

    /// The value that stands for a place in the declared range: where a point of a term lies once the terms are laid
    /// out. Where the interval found has no width, all stand at its one value.
    pub fn laid_out(&self, x: f64) -> f64 {
        let Some((min, max)) = self.found else { return x };
        let (low, high) = self.declared_range();
        if low == high { min } else { min + (x - low) / (high - low) * (max - min) }
    }

    /// The place in the declared range that a value stands for.
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
    /// The interval over which its number is found.
    pub fn declared_range(&self) -> (f64, f64) {
        self.range.unwrap_or_else(|| extent(&self.terms))
    }
}
