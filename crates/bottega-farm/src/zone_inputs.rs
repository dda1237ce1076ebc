//! The inputs that the farm's rules have of a zone, and why a set of rules cannot be used for that.

use bottega_fuzzy::{EvaluateError, FclError, FunctionBlock, LayoutError};

use crate::{InputRanges, Interval, Technique, ZoneRow};

/// The paper's name for the ratio of complexity and size, which is [`ZoneRow::complexity_density`].
pub(crate) const COMPLEXITY: &str = "complexity";
/// Neighbor Difference.
pub(crate) const NEIGHBOR_DIFFERENCE: &str = "neighbor_difference";
/// Size in pixels.
pub(crate) const SIZE: &str = "size";

/// Why a set of rules cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ExpertError {
    /// The text is no FCL.
    #[error("cannot read the rules")]
    Fcl(#[from] FclError),
    /// It asks for something that the farm does not know of a zone.
    #[error("the rules have an input `{name}`; a zone has only {}", .known.join(", "))]
    UnknownInput {
        /// Its name.
        name: String,
        /// What is known.
        known: &'static [&'static str],
    },
    /// It does not say which engine suits a zone.
    #[error("the rules do not decide `leaning`, which engine suits a zone, but {}", .found.join(", "))]
    NoLeaning {
        /// What they decide.
        found: Vec<String>,
    },
    /// It decides nothing that the technique knows.
    #[error(
        "the rules decide nothing that means something in {}, but {}; it knows {}",
        .technique.name(), .found.join(", "), .technique.outputs().iter().map(|one| one.name).collect::<Vec<_>>().join(", ")
    )]
    NoOutput {
        /// The technique that they were meant for.
        technique: Technique,
        /// What they decide.
        found: Vec<String>,
    },
    /// The rules cannot be laid out over the scene.
    #[error("the rules cannot be laid out over the scene")]
    Layout(#[from] LayoutError),
    /// The rules cannot be evaluated.
    #[error("the rules cannot be evaluated")]
    Evaluate(#[from] EvaluateError),
}

/// Rules with the terms of their inputs laid out over what the zones of a work are like.
pub(crate) fn laid_out(rules: &FunctionBlock, ranges: &InputRanges) -> Result<FunctionBlock, LayoutError> {
    let mut rules = rules.clone();
    let &InputRanges { complexity_density, neighbor_difference, size } = ranges;
    let ranges = [(COMPLEXITY, complexity_density), (NEIGHBOR_DIFFERENCE, neighbor_difference), (SIZE, size)];
    for (name, Interval { min, max }) in ranges {
        if rules.input_index(name).is_some() {
            rules.layout_inputs(name, min, max)?;
        }
    }
    Ok(rules)
}

/// What rules may ask of a zone.
pub(crate) fn zone_values(zone: &ZoneRow, difference: f64) -> [(&'static str, f64); 3] {
    let size = zone.size() as f64;
    [(COMPLEXITY, zone.complexity_density()), (NEIGHBOR_DIFFERENCE, difference), (SIZE, size)]
}
