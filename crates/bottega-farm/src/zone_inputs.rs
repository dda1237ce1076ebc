//! Inputs of the farm's rules, and errors of unsuitable rules.

use bottega_fuzzy::{EvaluateError, FclError, FunctionBlock, LayoutError};

use crate::{InputRanges, Interval, Technique, ZoneRow};

/// The input for the complexity/size ratio, as the paper names it: [`ZoneRow::complexity_density`].
pub(crate) const COMPLEXITY: &str = "complexity";
/// The input for the Neighbor Difference.
pub(crate) const NEIGHBOR_DIFFERENCE: &str = "neighbor_difference";
/// The input for the size in pixels.
pub(crate) const SIZE: &str = "size";

/// The reason why a set of rules cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ExpertError {
    /// The text is not valid FCL.
    #[error("cannot read the rules")]
    Fcl(#[from] FclError),
    /// The rules have an unknown input.
    #[error("the rules have an input `{name}`; a zone has only {}", .known.join(", "))]
    UnknownInput {
        /// The name of the input.
        name: String,
        /// The known inputs.
        known: &'static [&'static str],
    },
    /// The rules lack the output by which they choose.
    #[error("the rules have no output `{output}`, which chooses the {of}, but {}", .found.join(", "))]
    NoChoice {
        /// The name of that output.
        output: &'static str,
        /// The subject of the choice: the engine or the technique.
        of: &'static str,
        /// The outputs that the rules have.
        found: Vec<String>,
    },
    /// The rules have no output that the technique knows.
    #[error(
        "no output of the rules applies to {}: they have {}; it uses {}",
        .technique.name(), .found.join(", "), .technique.outputs().iter().map(|one| one.name).collect::<Vec<_>>().join(", ")
    )]
    NoOutput {
        /// The technique for which the rules should decide.
        technique: Technique,
        /// The outputs that the rules have.
        found: Vec<String>,
    },
    /// The fuzzy sets cannot be laid out over the ranges of the scene.
    #[error("cannot fit the rules to the scene")]
    Layout(#[from] LayoutError),
    /// The rules cannot be evaluated.
    #[error("the rules cannot be evaluated")]
    Evaluate(#[from] EvaluateError),
}

/// Checks that rules have only known inputs.
///
/// # Errors
/// [`ExpertError::UnknownInput`].
pub fn check_inputs(rules: &FunctionBlock, known: &'static [&'static str]) -> Result<(), ExpertError> {
    let is_unknown = |name: &str| !known.iter().any(|input| input.eq_ignore_ascii_case(name));
    match rules.inputs().iter().find(|input| is_unknown(&input.name)) {
        Some(unknown) => Err(ExpertError::UnknownInput { name: unknown.name.clone(), known }),
        None => Ok(()),
    }
}

/// Checks that rules have the output by which they choose.
///
/// - `of`: the subject of the choice, for the error.
///
/// # Errors
/// [`ExpertError::NoChoice`].
pub fn check_output(rules: &FunctionBlock, output: &'static str, of: &'static str) -> Result<(), ExpertError> {
    if rules.outputs().iter().any(|known| known.name.eq_ignore_ascii_case(output)) {
        return Ok(());
    }
    let found = rules.outputs().iter().map(|output| output.name.clone()).collect();
    Err(ExpertError::NoChoice { output, of, found })
}

/// Returns the rules with the sets of their inputs laid out over the ranges of a work.
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

/// Returns the inputs of a zone, by name.
pub(crate) fn zone_values(zone: &ZoneRow, difference: f64) -> [(&'static str, f64); 3] {
    let size = zone.size() as f64;
    [(COMPLEXITY, zone.complexity_density()), (NEIGHBOR_DIFFERENCE, difference), (SIZE, size)]
}
