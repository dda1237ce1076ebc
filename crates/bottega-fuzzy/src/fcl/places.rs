//! Positions of a function block's parts in its text, kept apart from the block.

use super::error::Position;

/// Positions of a block's parts, in the order of the parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Places {
    /// The block's first keyword.
    pub(crate) block: Option<Position>,
    pub(crate) inputs: Vec<VariablePlaces>,
    pub(crate) outputs: Vec<VariablePlaces>,
    /// The keywords of all rules of all rule blocks.
    pub(crate) rules: Vec<Position>,
}

/// Positions of a variable's parts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct VariablePlaces {
    /// The position of the variable's declaration.
    pub(crate) at: Position,
    /// The names of the variable's terms.
    pub(crate) terms: Vec<Position>,
}
