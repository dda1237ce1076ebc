//! Comparison of two rules: contradictions and repetitions.

use super::{
    Placed, Verifier,
    grid::{AxisGrid, ConditionDegree, leaves},
    warning::WarningKind,
};
use crate::{
    block::{Conclusion, Rule},
    membership::Membership,
    operators::{Accumulation, Method},
};

/// Degrees that differ by less are equal: they may have been combined in another order.
const TOLERANCE: f64 = 1e-12;

impl Verifier<'_> {
    /// Reports contradictory and repeated rules; for each rule the first of each kind.
    pub(super) fn pairs(&mut self) {
        for second in 0..self.rules.len() {
            self.itself(second);
            let mut findings = RuleFindings { contradiction: false, repetition: false };
            for first in 0..second {
                let both_fire = self.alive[first] && self.alive[second];
                if both_fire && !self.pair(first, second, &mut findings) {
                    return;
                }
            }
        }
    }

    /// Reports a rule with two different conclusions about one output.
    fn itself(&mut self, index: usize) {
        let Placed { rule, at, .. } = self.rules[index];
        if let Some((a, b)) = self.at_odds(rule, rule) {
            let label = rule.label.as_str();
            let kind = self.contradiction(label, label, a, b, true);
            self.warn(at, kind);
        }
    }

    /// Compares two rules. False if the budget is used up.
    fn pair(&mut self, first: usize, second: usize, findings: &mut RuleFindings) -> bool {
        let (a, b) = (self.rules[first], self.rules[second]);
        let odds = self.at_odds(a.rule, b.rule).filter(|_| !findings.contradiction);
        let same = same_conclusions(a.rule, b.rule) && !findings.repetition;
        if odds.is_none() && !same {
            return true;
        }
        let Some(order) = self.compare(a, b, |_| 1.0) else { return self.work > 0 };
        if let Some((one, other)) = odds
            && (order.below || order.above)
        {
            let kind = self.contradiction(&a.rule.label, &b.rule.label, one, other, order.below && order.above);
            self.warn(b.at, kind);
            findings.contradiction = true;
        }
        if same {
            findings.repetition = self.repetition(a, b, order);
        }
        self.work > 0
    }

    /// Reports whether one of two rules with the same conclusions is redundant.
    fn repetition(&mut self, a: Placed<'_>, b: Placed<'_>, unweighted: DegreeOrder) -> bool {
        let equal = unweighted.below && unweighted.above;
        let (stays, goes, counts_twice) = if self.covered(a) && std::ptr::eq(a.block, b.block) {
            // The stronger rule covers the other
            let order = self.compare(a, b, |rule| rule.weight);
            match order {
                Some(DegreeOrder { above: true, .. }) => (a, b, false),
                Some(DegreeOrder { below: true, .. }) => (b, a, false),
                _ => return false,
            }
        } else if equal {
            (a, b, true)
        } else {
            return false;
        };
        let (first, second) = (stays.rule.label.clone(), goes.rule.label.clone());
        self.warn(goes.at, WarningKind::Repeated { first, second, counts_twice });
        true
    }

    /// Returns true if for all outputs of a rule the strongest rule covers weaker ones with the same conclusions.
    fn covered(&self, placed: Placed<'_>) -> bool {
        placed.rule.conclusions.iter().all(|conclusion| {
            let output = &self.block.outputs[conclusion.output];
            let is_singleton = matches!(output.terms[conclusion.term].membership, Membership::Singleton(_));
            let by_maximum = matches!(output.method, Method::Lm | Method::Rm | Method::Mm);
            self.block.accumulation_of(conclusion.output) == Accumulation::Max && (by_maximum || !is_singleton)
        })
    }

    /// Returns different terms that two rules conclude for one output.
    fn at_odds(&self, a: &Rule, b: &Rule) -> Option<(Conclusion, Conclusion)> {
        let differ = |a: &Conclusion, b: &Conclusion| {
            let terms = &self.block.outputs[a.output].terms;
            a.output == b.output && terms[a.term].membership != terms[b.term].membership
        };
        a.conclusions.iter().find_map(|one| Some((*one, *b.conclusions.iter().find(|other| differ(one, other))?)))
    }

    fn contradiction(&self, first: &str, second: &str, a: Conclusion, b: Conclusion, same: bool) -> WarningKind {
        let output = &self.block.outputs[a.output];
        WarningKind::Contradiction {
            first: first.to_owned(),
            second: second.to_owned(),
            output: output.name.clone(),
            terms: [a.term, b.term].map(|term| output.terms[term].name.clone()),
            same_condition: same,
        }
    }

    /// Returns the order of two rules' degrees over all values of the inputs. `None`: too expensive.
    fn compare(&mut self, a: Placed<'_>, b: Placed<'_>, weight: impl Fn(&Rule) -> f64) -> Option<DegreeOrder> {
        let cost = leaves(&a.rule.condition) + leaves(&b.rule.condition);
        let Some(grid) = AxisGrid::over(self.axes, [&a.rule.condition, &b.rule.condition]) else {
            self.unexamined();
            return None;
        };
        let mut place = ConditionDegree::new(self.block.inputs.len());
        let mut order = DegreeOrder { below: true, above: true };
        let mut looks = 0;
        for index in grid.scattered().take((self.work / cost) as usize) {
            place.go(&grid, index);
            looks += 1;
            let one = place.degree(a.block, a.rule) * weight(a.rule);
            let other = place.degree(b.block, b.rule) * weight(b.rule);
            order.below &= one <= other + TOLERANCE;
            order.above &= other <= one + TOLERANCE;
            if !order.below && !order.above {
                break;
            }
        }
        let decided = looks == grid.len || (!order.below && !order.above);
        let paid = self.pay(looks * cost) && decided;
        if !paid {
            self.work = 0;
            self.unexamined();
        }
        paid.then_some(order)
    }
}

/// The findings already reported for a rule.
struct RuleFindings {
    contradiction: bool,
    repetition: bool,
}

/// The order of two degrees over all input values.
#[derive(Clone, Copy)]
struct DegreeOrder {
    /// True if the first is never greater.
    below: bool,
    /// True if the first is never less.
    above: bool,
}

/// Returns true if two rules have the same conclusions, in any order.
fn same_conclusions(a: &Rule, b: &Rule) -> bool {
    let all_in = |a: &Rule, b: &Rule| a.conclusions.iter().all(|one| b.conclusions.contains(one));
    all_in(a, b) && all_in(b, a)
}
