//! The grid of input values on which rule bases are verified.
//!
//! Every term is linear between the points of all terms of its input. An axis has a cell at each of those points, some
//! between each two, and one beyond either end. Whether degrees combined by MIN, MAX, PROD or ASUM are 0 is constant
//! within a cell, so the results about firing are exact; under BDIF and BSUM, and where degrees are compared with each
//! other, they are as accurate as the cells are small.

use crate::block::{Condition, InputVariable, Rule, RuleBlock};
use crate::{evaluate, membership::Membership};

/// Number of cells between two points of an axis.
const BETWEEN: usize = 3;
/// Maximum number of cells of an axis.
const AXIS_CELLS_MAX: usize = 1024;
/// Maximum number of cells of a grid that is examined completely.
pub(super) const GRID_CELLS_MAX: u64 = 1 << 19;

/// A cell of an axis: a point of a term, or an interval between two points.
pub(super) struct AxisStretch {
    pub(super) low: f64,
    pub(super) high: f64,
    /// True if the stretch lies in the input's declared range, or none is declared.
    pub(super) in_range: bool,
    /// The degree of each term.
    grades: Vec<f64>,
}

/// The cells of an input, in ascending order.
pub(super) struct Axis {
    pub(super) cells: Vec<AxisStretch>,
}

impl Axis {
    /// `None` if the terms have too many points.
    pub(super) fn new(input: &InputVariable) -> Option<Self> {
        let mut points: Vec<f64> = input
            .terms
            .iter()
            .flat_map(|term| match &term.membership {
                Membership::Singleton(at) => vec![*at],
                Membership::Linear(points) => points.iter().map(|point| point.0).collect(),
            })
            .chain(input.range.into_iter().flat_map(|(low, high)| [low, high]))
            .collect();
        points.sort_by(f64::total_cmp);
        points.dedup();
        if points.len() * (BETWEEN + 1) > AXIS_CELLS_MAX {
            return None;
        }
        let (first, last) = (*points.first()?, *points.last()?);
        let mut cells = vec![cell(input, f64::NEG_INFINITY, first, first - 1.0 - first.abs())];
        for (i, &x) in points.iter().enumerate() {
            cells.push(cell(input, x, x, x));
            let Some(&next) = points.get(i + 1) else { break };
            let part = |k: f64| x + (next - x) * (k / BETWEEN as f64);
            cells.extend((0..BETWEEN).map(|k| {
                let (low, high) = (k as f64, (k + 1) as f64);
                cell(input, part(low), part(high), part(0.5 * (low + high)))
            }));
        }
        cells.push(cell(input, last, f64::INFINITY, last + 1.0 + last.abs()));
        Some(Self { cells })
    }
}

fn cell(input: &InputVariable, low: f64, high: f64, at: f64) -> AxisStretch {
    let in_range = input.range.is_none_or(|(least, greatest)| (least..=greatest).contains(&at));
    let grades = input.terms.iter().map(|term| term.membership.degree(at)).collect();
    AxisStretch { low, high, in_range, grades }
}

/// The product of some axes.
pub(super) struct AxisGrid<'a> {
    /// The indices of the inputs, with their axes.
    pub(super) axes: Vec<(usize, &'a Axis)>,
    /// The number of cells.
    pub(super) len: u64,
}

impl<'a> AxisGrid<'a> {
    /// Makes the grid over all inputs in some conditions. `None`: one of them has no axis, or there are too many
    /// cells.
    pub(super) fn over<'c>(axes: &'a [Option<Axis>], of: impl IntoIterator<Item = &'c Condition>) -> Option<Self> {
        let mut inputs = Vec::new();
        of.into_iter().for_each(|condition| mentioned(condition, &mut inputs));
        inputs.sort_unstable();
        inputs.dedup();
        let axes = inputs.into_iter().map(|input| Some((input, axes[input].as_ref()?))).collect::<Option<Vec<_>>>()?;
        let len = axes.iter().try_fold(1_u64, |len, (_, axis)| len.checked_mul(axis.cells.len() as u64))?;
        (len <= GRID_CELLS_MAX).then_some(Self { axes, len })
    }

    /// Returns the cells of the axes that meet at a grid position, with their inputs.
    pub(super) fn cells(&self, mut index: u64) -> impl Iterator<Item = (usize, &'a AxisStretch)> {
        self.axes.iter().map(move |(input, axis)| {
            let count = axis.cells.len() as u64;
            let cell = &axis.cells[(index % count) as usize];
            index /= count;
            (*input, cell)
        })
    }

    /// Returns all positions, in an order with neighbors far apart, so that counterexamples are found early.
    pub(super) fn scattered(&self) -> impl Iterator<Item = u64> + use<'a> {
        let len = self.len;
        let near = (len as f64 * 0.618_033_988_749_895) as u64;
        let stride = (near.max(1)..).find(|stride| gcd(*stride, len) == 1).unwrap_or(1);
        (0..len).scan(0, move |index, _| {
            *index = (*index + stride) % len;
            Some(*index)
        })
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The degree of a rule's condition at a grid position, without its weight.
pub(super) struct ConditionDegree<'a> {
    /// By input; empty for inputs outside the grid.
    grades: Vec<&'a [f64]>,
}

impl<'a> ConditionDegree<'a> {
    pub(super) fn new(inputs: usize) -> Self {
        Self { grades: vec![&[]; inputs] }
    }

    /// Moves to a position of a grid, which must contain the inputs of all conditions evaluated afterwards.
    pub(super) fn go(&mut self, grid: &AxisGrid<'a>, index: u64) {
        for (input, cell) in grid.cells(index) {
            self.grades[input] = &cell.grades;
        }
    }

    pub(super) fn degree(&self, block: &RuleBlock, rule: &Rule) -> f64 {
        evaluate::degree(block, &rule.condition, &|input: usize, term: usize| self.grades[input][term])
    }
}

/// Appends the inputs of a condition, in order of their first use.
fn mentioned(condition: &Condition, inputs: &mut Vec<usize>) {
    match condition {
        Condition::Is { input, .. } | Condition::IsNot { input, .. } => inputs.push(*input),
        Condition::Not(part) => mentioned(part, inputs),
        Condition::And(parts) | Condition::Or(parts) => parts.iter().for_each(|part| mentioned(part, inputs)),
    }
}

/// Returns the number of terms in a condition: the cost of evaluating it.
pub(super) fn leaves(condition: &Condition) -> u64 {
    match condition {
        Condition::Is { .. } | Condition::IsNot { .. } => 1,
        Condition::Not(part) => leaves(part),
        Condition::And(parts) | Condition::Or(parts) => parts.iter().map(leaves).sum(),
    }
}
