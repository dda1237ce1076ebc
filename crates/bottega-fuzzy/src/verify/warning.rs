//! Warnings about rule bases.

use std::fmt::{self, Display, Formatter};

use crate::Position;

/// A warning: something allowed, but probably unintended.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// The line and column of the rule, term or variable, or of the block for [`WarningKind::Unexamined`].
    pub at: Position,
    /// The kind of warning.
    pub kind: WarningKind,
}

/// The kind of a warning, with the variables, terms and rules concerned. Rules are named by their labels.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "each is one sentence, below")]
pub enum WarningKind {
    /// Two rules of a rule block have the same label.
    LabelTwice {
        /// The label that is used twice.
        label: String,
        /// The name of the rule block.
        block: String,
    },
    /// A term has degree 0 in the whole range of its variable.
    EmptySet {
        /// The name of the variable.
        variable: String,
        /// The name of the term.
        term: String,
        /// `true`: the variable is an output, and the term has no area; `false`: it is an input.
        output: bool,
    },
    /// No rule names the term, though rules name other terms of the variable.
    UnusedTerm {
        /// The name of the variable.
        variable: String,
        /// The name of the term.
        term: String,
    },
    /// No rule has a condition on the input.
    UnusedInput(String),
    /// No rule has a conclusion about the output.
    SilentOutput {
        /// The name of the output.
        output: String,
        /// The value that the output always has; `None`: it never has one.
        default: Option<f64>,
    },
    /// The rule never has an effect.
    DeadRule {
        /// The label of the rule.
        label: String,
        /// The reason why it has no effect.
        reason: DeadReason,
    },
    /// One of two rules fires at least as strongly as the other for all input values, and they conclude different terms
    /// for one output. `first` equals `second`: one rule concludes both.
    Contradiction {
        /// The label of the rule that comes first in the text.
        first: String,
        /// The label of the other rule.
        second: String,
        /// The name of the output.
        output: String,
        /// The terms that `first` and `second` conclude.
        terms: [String; 2],
        /// `true`: both rules always fire equally strongly.
        same_condition: bool,
    },
    /// The rule `second` has the conclusions of `first` and is redundant: it never fires more strongly, or it has an
    /// equivalent condition and counts twice.
    Repeated {
        /// The label of the rule that is kept.
        first: String,
        /// The label of the redundant rule.
        second: String,
        /// `true`: with this accumulation, or in another rule block, the conclusion counts twice; `false`: `second`
        /// changes nothing.
        counts_twice: bool,
    },
    /// For some input values no rule concludes anything about an output that has no default.
    Hole(Hole),
    /// The block is too large for the budget of verification: other warnings about it may be missing.
    Unexamined,
}

/// The reason why a rule has no effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeadReason {
    /// The weight of the rule is 0.
    Weight,
    /// The condition of the rule has degree 0 for all input values.
    Condition,
}

/// A box of input values for which no rule concludes anything about an output without a default.
#[derive(Clone, Debug, PartialEq)]
pub struct Hole {
    /// The name of the output.
    pub output: String,
    /// The relevant inputs, each with its least and greatest value in the box; infinite where the box has no end.
    /// Inputs not listed may have any value in their ranges.
    pub sides: Vec<(String, f64, f64)>,
    /// Number of further cells of the grid of input values in which no rule fires; 0 except in the last box that is
    /// reported for the output.
    pub further_cells: u64,
}

impl WarningKind {
    /// Returns a short identifier for programs, like that of a lint.
    pub fn code(&self) -> &'static str {
        match self {
            Self::LabelTwice { .. } => "label-twice",
            Self::EmptySet { .. } => "empty-set",
            Self::UnusedTerm { .. } => "unused-term",
            Self::UnusedInput(_) => "unused-input",
            Self::SilentOutput { .. } => "silent-output",
            Self::DeadRule { .. } => "dead-rule",
            Self::Contradiction { .. } => "contradiction",
            Self::Repeated { .. } => "repeated-rule",
            Self::Hole(_) => "hole",
            Self::Unexamined => "unexamined",
        }
    }
}

impl Display for Warning {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.at, self.kind)
    }
}

impl Display for WarningKind {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::LabelTwice { label, block } => write!(f, "the label `{label}` is used twice in `{block}`"),
            Self::EmptySet { variable, term, output: false } => {
                write!(f, "the term `{term}` of `{variable}` holds for no value in its range")
            }
            Self::EmptySet { variable, term, output: true } => {
                write!(
                    f,
                    "the term `{term}` of `{variable}` has no area in its range: rules that conclude it say nothing"
                )
            }
            Self::UnusedTerm { variable, term } => write!(f, "no rule names the term `{term}` of `{variable}`"),
            Self::UnusedInput(input) => write!(f, "no rule asks for the input `{input}`"),
            Self::SilentOutput { output, default: Some(value) } => {
                write!(f, "no rule speaks of the output `{output}`: it is {value} always")
            }
            Self::SilentOutput { output, default: None } => {
                write!(f, "no rule speaks of the output `{output}`: it never has a value")
            }
            Self::DeadRule { label, reason: DeadReason::Weight } => {
                write!(f, "rule {label} says nothing: its weight is 0")
            }
            Self::DeadRule { label, reason: DeadReason::Condition } => {
                write!(f, "rule {label} can never fire: no values of the inputs meet its condition")
            }
            Self::Contradiction { first, second, output, terms: [a, b], same_condition } => {
                if first == second {
                    return write!(f, "rule {first} contradicts itself: it says both `{a}` and `{b}` of `{output}`");
                }
                write!(f, "rule {second} contradicts rule {first}: ")?;
                if *same_condition {
                    write!(f, "under the same condition")?;
                } else {
                    write!(f, "wherever one of them fires the other does at least as strongly")?;
                }
                write!(f, ", {first} says `{a}` and {second} says `{b}` of `{output}`")
            }
            Self::Repeated { first, second, counts_twice: true } => {
                write!(f, "rule {second} repeats rule {first}, which then counts twice")
            }
            Self::Repeated { first, second, counts_twice: false } => {
                write!(f, "rule {second} changes nothing: rule {first} says the same, always at least as strongly")
            }
            Self::Hole(hole) => write!(f, "{hole}"),
            Self::Unexamined => {
                write!(f, "the block is too large to be verified completely: dead or contradictory rules may remain")
            }
        }
    }
}

impl Display for Hole {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "no rule speaks of `{}`, which has no DEFAULT, ", self.output)?;
        for (i, (input, low, high)) in self.sides.iter().enumerate() {
            write!(f, "{}", if i == 0 { "where " } else { " and " })?;
            match (low.is_finite(), high.is_finite()) {
                (true, true) if low == high => write!(f, "`{input}` is {low}")?,
                (true, true) => write!(f, "`{input}` is between {low} and {high}")?,
                (true, false) => write!(f, "`{input}` is above {low}")?,
                _ => write!(f, "`{input}` is below {high}")?,
            }
        }
        if self.sides.is_empty() {
            write!(f, "anywhere")?;
        }
        match self.further_cells {
            0 => Ok(()),
            1 => write!(f, "; nor in one further place"),
            more => write!(f, "; nor in {more} further places"),
        }
    }
}
