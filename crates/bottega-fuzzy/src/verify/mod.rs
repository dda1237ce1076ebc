//! Verification of rule bases: warnings about what is allowed, but probably unintended.
//!
//! Every valid text can be evaluated, but its rules may contradict each other, never fire, or leave an output without a
//! value. A warning about a rule holds for all values of the inputs, see [`grid`]. What cannot be decided within a
//! bounded time is not reported, and a warning says so.

mod grid;
mod hole;
mod pair;
mod warning;

use grid::{Axis, AxisGrid, ConditionDegree, leaves};
pub use warning::{DeadReason, Hole, Warning, WarningKind};

use crate::{
    Document, FunctionBlock, Position,
    aggregate::{ActiveOutput, Aggregate, aggregate},
    block::{OutputVariable, Rule, RuleBlock},
    fcl::Places,
    membership::Membership,
    operators::{Accumulation, Activation},
};

/// Maximum number of terms evaluated for all blocks of a text: a second or two.
const WORK_MAX: u64 = 20_000_000;

impl Document {
    /// Verifies all blocks. Returns the warnings, in the order of the text; none if nothing was found. The search has a
    /// budget: if a block exceeds it, one of them is [`WarningKind::Unexamined`].
    pub fn verify(&self) -> Vec<Warning> {
        let mut work = WORK_MAX;
        let mut warnings = Vec::new();
        for (block, places) in self.blocks.iter().zip(&self.places) {
            let axes: Vec<_> = block.inputs.iter().map(Axis::new).collect();
            let mut verifier = Verifier::new(block, places, &axes, work);
            verifier.names();
            verifier.sets();
            verifier.rules();
            verifier.pairs();
            verifier.holes();
            work = verifier.work;
            warnings.append(&mut verifier.warnings);
        }
        warnings.sort_by_key(|warning| warning.at);
        warnings
    }
}

/// A rule with its block, for the operators.
#[derive(Clone, Copy)]
struct Placed<'a> {
    block: &'a RuleBlock,
    rule: &'a Rule,
    at: Position,
}

struct Verifier<'a> {
    block: &'a FunctionBlock,
    places: &'a Places,
    rules: Vec<Placed<'a>>,
    /// For each rule, false if it is known never to fire.
    alive: Vec<bool>,
    axes: &'a [Option<Axis>],
    /// Remaining number of terms that may be evaluated.
    work: u64,
    warnings: Vec<Warning>,
}

impl<'a> Verifier<'a> {
    fn new(block: &'a FunctionBlock, places: &'a Places, axes: &'a [Option<Axis>], work: u64) -> Self {
        let placed = block.rule_blocks.iter().flat_map(|block| block.rules.iter().map(move |rule| (block, rule)));
        let rules: Vec<_> = placed.zip(&places.rules).map(|((block, rule), &at)| Placed { block, rule, at }).collect();
        let alive = vec![true; rules.len()];
        Self { block, places, rules, alive, axes, work, warnings: Vec::new() }
    }

    fn warn(&mut self, at: Position, kind: WarningKind) {
        self.warnings.push(Warning { at, kind });
    }

    /// Subtracts work from the budget. False if too little is left, which is reported once.
    fn pay(&mut self, cost: u64) -> bool {
        if let Some(left) = self.work.checked_sub(cost) {
            self.work = left;
            return true;
        }
        self.unexamined();
        false
    }

    fn unexamined(&mut self) {
        if let Some(at) = self.places.block
            && !self.warnings.iter().any(|warning| warning.kind == WarningKind::Unexamined)
        {
            self.warn(at, WarningKind::Unexamined);
        }
    }

    /// Reports duplicate labels, and unused terms, inputs and outputs.
    fn names(&mut self) {
        let (block, places) = (self.block, self.places);
        let mut at = places.rules.iter();
        for rules in &block.rule_blocks {
            let mut seen = std::collections::BTreeSet::new();
            for (rule, &at) in rules.rules.iter().zip(&mut at) {
                if !seen.insert(rule.label.to_ascii_lowercase()) {
                    let kind = WarningKind::LabelTwice { label: rule.label.clone(), block: rules.name.clone() };
                    self.warn(at, kind);
                }
            }
        }
        let mut used_terms: Vec<Vec<bool>> = block.inputs.iter().map(|input| vec![false; input.terms.len()]).collect();
        let mut said: Vec<Vec<bool>> = block.outputs.iter().map(|output| vec![false; output.terms.len()]).collect();
        for rule in block.rules() {
            mark_used(&rule.condition, &mut used_terms);
            rule.conclusions.iter().for_each(|conclusion| said[conclusion.output][conclusion.term] = true);
        }
        for ((input, used), places) in block.inputs.iter().zip(&used_terms).zip(&places.inputs) {
            if !used.contains(&true) {
                self.warn(places.at, WarningKind::UnusedInput(input.name.clone()));
            } else {
                self.unused(&input.name, &input.terms, used, &places.terms);
            }
        }
        for ((output, used), places) in block.outputs.iter().zip(&said).zip(&places.outputs) {
            if !used.contains(&true) {
                let (output, default) = (output.name.clone(), output.default);
                self.warn(places.at, WarningKind::SilentOutput { output, default });
            } else {
                self.unused(&output.name, &output.terms, used, &places.terms);
            }
        }
    }

    fn unused(&mut self, variable: &str, terms: &[crate::Term], used: &[bool], places: &[Position]) {
        for ((term, _), &at) in terms.iter().zip(used).zip(places).filter(|((_, used), _)| !**used) {
            self.warn(at, WarningKind::UnusedTerm { variable: variable.to_owned(), term: term.name.clone() });
        }
    }

    /// Reports terms with degree 0 in the whole range of their variable.
    fn sets(&mut self) {
        let (block, places) = (self.block, self.places);
        let mut empty = |variable: &str, term: &crate::Term, output: bool, at: Position| {
            let (variable, term) = (variable.to_owned(), term.name.clone());
            self.warnings.push(Warning { at, kind: WarningKind::EmptySet { variable, term, output } });
        };
        for (input, places) in block.inputs.iter().zip(&places.inputs) {
            let range = input.range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            for (term, &at) in input.terms.iter().zip(&places.terms) {
                if !holds_within(&term.membership, range) {
                    empty(&input.name, term, false, at);
                }
            }
        }
        for (output, places) in block.outputs.iter().zip(&places.outputs) {
            for (term, &at) in output.terms.iter().zip(&places.terms) {
                if !has_area(&term.membership, output) {
                    empty(&output.name, term, true, at);
                }
            }
        }
    }

    /// Reports rules that can never fire.
    fn rules(&mut self) {
        for index in 0..self.rules.len() {
            let Placed { block, rule, at } = self.rules[index];
            let reason = if rule.weight == 0.0 {
                Some(DeadReason::Weight)
            } else {
                (self.fires(block, rule) == Some(false)).then_some(DeadReason::Condition)
            };
            if let Some(reason) = reason {
                self.alive[index] = false;
                self.warn(at, WarningKind::DeadRule { label: rule.label.clone(), reason });
            }
        }
    }

    /// Returns true if a condition has a degree above 0 anywhere. `None`: too expensive.
    fn fires(&mut self, block: &RuleBlock, rule: &Rule) -> Option<bool> {
        let cost = leaves(&rule.condition);
        let Some(grid) = AxisGrid::over(self.axes, [&rule.condition]) else {
            self.unexamined();
            return None;
        };
        let mut place = ConditionDegree::new(self.block.inputs.len());
        let (mut looks, mut fires) = (0, false);
        for index in grid.scattered().take((self.work / cost) as usize) {
            place.go(&grid, index);
            looks += 1;
            fires = place.degree(block, rule) > 0.0;
            if fires {
                break;
            }
        }
        let whole = looks == grid.len;
        let paid = self.pay(looks * cost) && (fires || whole);
        if !paid {
            self.unexamined();
        }
        paid.then_some(fires)
    }
}

fn mark_used(condition: &crate::Condition, used_terms: &mut [Vec<bool>]) {
    use crate::Condition;
    match condition {
        Condition::Is { input, term } | Condition::IsNot { input, term } => used_terms[*input][*term] = true,
        Condition::Not(part) => mark_used(part, used_terms),
        Condition::And(parts) | Condition::Or(parts) => parts.iter().for_each(|part| mark_used(part, used_terms)),
    }
}

/// Returns true if a term has a degree above 0 somewhere in a range.
fn holds_within(membership: &Membership, (low, high): (f64, f64)) -> bool {
    match membership {
        Membership::Singleton(at) => (low..=high).contains(at),
        Membership::Linear(points) => {
            let inside = points.iter().any(|&(x, y)| y > 0.0 && (low..=high).contains(&x));
            // Between two points the degree is above 0 if it is at either one; the ends decide the rest
            inside || [low, high].iter().any(|&end| membership.degree(end) > 0.0)
        }
    }
}

/// Returns true if rules that conclude a term have an effect on the output.
fn has_area(membership: &Membership, output: &OutputVariable) -> bool {
    let one = ActiveOutput { term: membership, activation: Activation::Min, degree: 1.0 };
    match aggregate(Accumulation::Max, output.declared_range(), &[one]) {
        Aggregate::Singletons(_) => true,
        Aggregate::Linear(corners) => {
            corners.windows(2).any(|pair| pair[0].0 < pair[1].0 && pair[0].1 + pair[1].1 > 0.0)
        }
    }
}
