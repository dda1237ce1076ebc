//! Expert rules as data for web pages and programs: terms as points, rules as text, and the result for a zone with its reasons.

use bottega_farm::{InputRanges, Optimization};
use bottega_fuzzy::{FunctionBlock, Membership, Term};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{error::Error, events::ZoneEvent, request::RulesText, rules::Source};

/// Names of the inputs that rules can use.
const COMPLEXITY: &str = "complexity";
const NEIGHBOR_DIFFERENCE: &str = "neighbor_difference";
const SIZE: &str = "size";
const OPTIMIZATION_LEVEL: &str = "optimization_level";

/// The intervals of the rule inputs in a picture, and the optimization level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RuleInputs {
    /// Interval of the complexity per pixel: minimum, maximum.
    pub complexity: [f64; 2],
    /// Interval of the neighbor difference: minimum, maximum.
    pub neighbor_difference: [f64; 2],
    /// Interval of the size in pixels: minimum, maximum.
    pub size: [f64; 2],
    /// Optimization level, 1 to 5. `null`: optimization is off, and rules are not evaluated.
    pub level: Option<f64>,
}

impl RuleInputs {
    /// Makes the inputs of a work from the intervals of its zones' values and its degree of optimization.
    pub fn new(ranges: &InputRanges, optimization: Optimization) -> Self {
        let InputRanges { complexity_density, neighbor_difference, size } = *ranges;
        Self {
            complexity: [complexity_density.min, complexity_density.max],
            neighbor_difference: [neighbor_difference.min, neighbor_difference.max],
            size: [size.min, size.max],
            level: optimization.rule_input(),
        }
    }
}

/// A term of a linguistic variable, such as `big`.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TermView {
    /// Name of the term.
    pub name: String,
    /// The membership function as points (value, degree), linear in between and constant outside. One point: a singleton.
    pub points: Vec<[f64; 2]>,
}

/// An input or output of a set of rules.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct VariableView {
    /// Name of the variable.
    pub name: String,
    /// The interval over which the variable's terms lie: minimum, maximum.
    pub range: [f64; 2],
    /// The terms of the variable.
    pub terms: Vec<TermView>,
}

/// A rule as text.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RuleView {
    /// Number or name of the rule.
    pub label: String,
    /// The text of the rule: `IF … THEN …`.
    pub text: String,
}

/// A rule set with its variables.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RuleSetView {
    /// Name of the rule set.
    pub name: String,
    /// The input variables of the rules.
    pub inputs: Vec<VariableView>,
    /// The output variables of the rules.
    pub outputs: Vec<VariableView>,
    /// The rules, in the order of the text.
    pub rules: Vec<RuleView>,
}

/// The value of an input for a zone.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct InputValue {
    /// Name of the input.
    pub name: String,
    /// The crisp value of the input.
    pub value: f64,
    /// The terms with a degree of membership above 0, and that degree.
    pub terms: Vec<(String, f64)>,
}

/// A rule that fires for a zone.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FiringRule {
    /// Number or name of the rule.
    pub label: String,
    /// Degree of firing, 0 to 1.
    pub degree: f64,
    /// The text of the rule: `IF … THEN …`.
    pub text: String,
}

/// The result of a rule set for a zone, with its reasons.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RuleVerdict {
    /// Name of the rule set.
    pub set: String,
    /// The inputs with their values.
    pub inputs: Vec<InputValue>,
    /// The rules that fire, strongest first.
    pub rules: Vec<FiringRule>,
    /// Each output with its value; `null`: no rule concludes about it.
    pub outputs: Vec<(String, Option<f64>)>,
}

/// Returns the function block of a rule set, with its inputs scaled to the intervals of a picture if given.
fn block(text: &RulesText, inputs: Option<&RuleInputs>) -> Result<FunctionBlock, Error> {
    let mut block = Source::of(text.clone())?.block(None)?.clone();
    let Some(inputs) = inputs else { return Ok(block) };
    for (name, [min, max]) in
        [(COMPLEXITY, inputs.complexity), (NEIGHBOR_DIFFERENCE, inputs.neighbor_difference), (SIZE, inputs.size)]
    {
        if block.input_index(name).is_some() {
            block.layout_inputs(name, min, max).map_err(|error| Error::usage(error.to_string(), ""))?;
        }
    }
    Ok(block)
}

/// Returns the rules of a block in their order: label and text.
fn rule_texts(block: &FunctionBlock) -> Vec<RuleView> {
    let text_of_block = block.to_string();
    let lines = text_of_block.lines().filter_map(|line| line.trim().strip_prefix("RULE "));
    let rule = |line: &str| {
        let (label, text) = line.split_once(" : ")?;
        Some(RuleView { label: label.to_owned(), text: text.trim_end_matches(';').to_owned() })
    };
    lines.filter_map(rule).collect()
}

fn terms(terms: &[Term], place: impl Fn(f64) -> f64) -> Vec<TermView> {
    let points = |membership: &Membership| match membership {
        Membership::Singleton(at) => vec![[place(*at), 1.0]],
        Membership::Linear(points) => points.iter().map(|(x, y)| [place(*x), *y]).collect(),
    };
    terms.iter().map(|term| TermView { name: term.name.clone(), points: points(&term.membership) }).collect()
}

impl RuleSetView {
    /// Makes the view of a rule set, its inputs scaled to the intervals of a picture if given.
    ///
    /// # Errors
    /// The text is not a valid rule set, or its inputs cannot be scaled.
    pub fn new(text: &RulesText, inputs: Option<&RuleInputs>) -> Result<Self, Error> {
        let block = block(text, inputs)?;
        let pair = |(low, high): (f64, f64)| [low, high];
        let inputs = block.inputs().iter().map(|input| VariableView {
            name: input.name.clone(),
            range: pair(input.interval()),
            terms: terms(&input.terms, |x| input.laid_out(x)),
        });
        let outputs = block.outputs().iter().map(|output| VariableView {
            name: output.name.clone(),
            range: pair(output.declared_range()),
            terms: terms(&output.terms, |x| x),
        });
        let (inputs, outputs) = (inputs.collect(), outputs.collect());
        Ok(Self { name: block.name().to_owned(), inputs, outputs, rules: rule_texts(&block) })
    }
}

impl RuleVerdict {
    /// Evaluates a rule set for a zone, and returns its verdict. `None`: optimization is off, or the zone's neighbor difference
    /// is unknown.
    ///
    /// # Errors
    /// The text is not a valid rule set, or the rules cannot be evaluated.
    pub fn new(text: &RulesText, inputs: &RuleInputs, zone: &ZoneEvent) -> Result<Option<Self>, Error> {
        let Some((level, difference)) = inputs.level.zip(zone.neighbor_difference) else { return Ok(None) };
        let block = block(text, Some(inputs))?;
        let density = zone.complexity / (zone.size as f64).max(1.0);
        let known = [
            (COMPLEXITY, density),
            (NEIGHBOR_DIFFERENCE, difference),
            (SIZE, zone.size as f64),
            (OPTIMIZATION_LEVEL, level),
        ];
        let inputs: Vec<(&str, f64)> =
            known.into_iter().filter(|(name, _)| block.input_index(name).is_some()).collect();
        let why = block.explain(&inputs).map_err(|error| Error::usage(error.to_string(), ""))?;
        let texts = rule_texts(&block);
        let text_of = |label: &str| texts.iter().find(|rule| rule.label == label).map(|rule| rule.text.clone());
        let value_of =
            |name: &str| inputs.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, value)| *value);
        Ok(Some(Self {
            set: block.name().to_owned(),
            inputs: why
                .inputs
                .into_iter()
                .filter_map(|(name, terms)| Some(InputValue { value: value_of(&name)?, name, terms }))
                .collect(),
            rules: why
                .rules
                .into_iter()
                .map(|rule| FiringRule {
                    text: text_of(&rule.label).unwrap_or_else(|| rule.conclusions.join(", ")),
                    label: rule.label,
                    degree: rule.degree,
                })
                .collect(),
            outputs: block
                .outputs()
                .iter()
                .zip(why.outputs.values())
                .map(|(output, value)| (output.name.clone(), *value))
                .collect(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::request::RulesSource;

    fn built_in() -> RulesText {
        RulesSource::File(Path::new("path-tracing").to_owned()).read().unwrap()
    }

    const INPUTS: RuleInputs =
        RuleInputs { complexity: [0.5, 4.0], neighbor_difference: [0.0, 2.0], size: [64.0, 4096.0], level: Some(4.0) };

    #[test]
    fn a_rule_set_is_shown_over_the_range_of_its_inputs() {
        let shown = RuleSetView::new(&built_in(), Some(&INPUTS)).unwrap();
        let size = shown.inputs.iter().find(|input| input.name.eq_ignore_ascii_case(SIZE)).unwrap();
        assert_eq!(size.range, [64.0, 4096.0]);
        assert!(size.terms.iter().flat_map(|term| &term.points).all(|[_, degree]| (0.0..=1.0).contains(degree)));
        assert!(
            shown.rules.len() > 20 && shown.rules.iter().all(|rule| rule.text.starts_with("IF ")),
            "{:?}",
            shown.rules
        );
        assert!(!shown.outputs.is_empty());
        let declared = RuleSetView::new(&built_in(), None).unwrap();
        assert_ne!(declared.inputs, shown.inputs);
    }

    #[test]
    fn a_verdict_says_which_rules_fire_and_why() {
        let zone = ZoneEvent { size: 1000, complexity: 3000.0, neighbor_difference: Some(0.3), ..ZoneEvent::default() };
        let verdict = RuleVerdict::new(&built_in(), &INPUTS, &zone).unwrap().unwrap();
        assert!(!verdict.rules.is_empty() && verdict.rules[0].degree >= verdict.rules.last().unwrap().degree);
        let complexity = verdict.inputs.iter().find(|input| input.name.eq_ignore_ascii_case(COMPLEXITY)).unwrap();
        assert!(complexity.value == 3.0 && !complexity.terms.is_empty(), "{complexity:?}");
        assert!(verdict.outputs.iter().any(|(_, value)| value.is_some()));
        let off = RuleInputs { level: None, ..INPUTS };
        assert_eq!(RuleVerdict::new(&built_in(), &off, &zone).unwrap(), None);
        assert_eq!(RuleVerdict::new(&built_in(), &INPUTS, &ZoneEvent::default()).unwrap(), None);
    }
}
