//! The places of a function block's parts in its text, which a block itself does not need to know.

use super::error::Position;

/// The places of a block's parts, in the order of the parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Places {
    /// Of the block's first keyword.
    pub(crate) block: Option<Position>,
    pub(crate) inputs: Vec<VariablePlaces>,
    pub(crate) outputs: Vec<VariablePlaces>,
    /// Of the keywords of all rules of all rule blocks.
    pub(crate) rules: Vec<Position>,
}

/// The places of a variable's parts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct VariablePlaces {
    /// Of its declaration.
    pub(crate) at: Position,
    /// Of the names of its terms.
    pub(crate) terms: Vec<Position>,
}
