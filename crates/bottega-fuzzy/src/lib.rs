//! Fuzzy control: linguistic variables, Mamdani inference, and the Fuzzy Control Language of IEC 61131-7.
//!
//! A [`FunctionBlock`] is parsed from text, its inputs are mapped to the intervals found at run time
//! ([`FunctionBlock::layout_inputs`]), and it is evaluated. The meaning of its variables does not matter here.
//!
//! The decision that shaped this crate: membership functions are piecewise linear, so the aggregate of all rules is
//! too, and its center of gravity is computed exactly, piece by piece. There is no sampling step to choose, and equal
//! inputs give bit-identical outputs: only +, −, ·, / and the square root are used.
//!
//! ```
//! use bottega_fuzzy::FunctionBlock;
//! let block = FunctionBlock::parse(
//!     "FUNCTION_BLOCK fan
//!      VAR_INPUT heat : REAL; END_VAR
//!      VAR_OUTPUT speed : REAL; END_VAR
//!      FUZZIFY heat TERM cold := (10, 1) (30, 0); TERM hot := (10, 0) (30, 1); END_FUZZIFY
//!      DEFUZZIFY speed TERM slow := 0; TERM fast := 100; METHOD : COGS; DEFAULT := 0; END_DEFUZZIFY
//!      RULEBLOCK all
//!        RULE 1 : IF heat IS cold THEN speed IS slow;
//!        RULE 2 : IF heat IS hot THEN speed IS fast;
//!      END_RULEBLOCK
//!      END_FUNCTION_BLOCK",
//! )?;
//! let outputs = block.evaluate(&[("heat", 25.0)])?;
//! assert_eq!(outputs.get("speed"), Some(75.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Modules
//!
//! | subject | files |
//! |---|---|
//! | the parts of a function block | `src/block.rs`, `src/membership.rs`, `src/operators.rs` |
//! | parsing and printing of FCL, with positions of errors | `src/fcl/` |
//! | inference | `src/evaluate.rs`, `src/aggregate.rs` |
//! | checks for contradictory rules, dead rules and gaps | `src/verify/` |

mod aggregate;
mod block;
mod evaluate;
mod fcl;
mod limits;
mod membership;
mod operators;
mod verify;

pub use aggregate::Aggregate;
pub use block::{
    Conclusion, Condition, FunctionBlock, InputVariable, LayoutError, OutputVariable, Rule, RuleBlock, Term,
};
pub use evaluate::{EvaluateError, Explanation, FiredRule, Outputs};
pub use fcl::{Document, FclError, FclErrorKind, Position, parse_document};
pub use limits::Limits;
pub use membership::Membership;
pub use operators::{Accumulation, Activation, And, Method, Or};
pub use verify::{DeadReason, Hole, Warning, WarningKind};
