//! Holes: input values for which no rule concludes anything about an output.

use super::{
    Placed, Verifier,
    grid::{AxisGrid, ConditionDegree, leaves},
    warning::{Hole, WarningKind},
};

/// Maximum number of boxes reported per output; the rest is counted.
const HOLES_MAX: usize = 4;

impl Verifier<'_> {
    /// Reports the holes of all outputs that have neither a default nor a rule for all cases.
    pub(super) fn holes(&mut self) {
        for index in 0..self.block.outputs.len() {
            if self.block.outputs[index].default.is_none() {
                self.holes_of(index);
            }
        }
    }

    fn holes_of(&mut self, output: usize) {
        let speaks = |placed: &Placed<'_>| placed.rule.conclusions.iter().any(|conclusion| conclusion.output == output);
        let alive = self.rules.iter().zip(&self.alive).filter(|(_, alive)| **alive).map(|(placed, _)| *placed);
        let rules: Vec<Placed<'_>> = alive.filter(speaks).collect();
        if rules.is_empty() {
            // Reported already: the output has no rules, or all of them are dead
            return;
        }
        let Some(grid) = AxisGrid::over(self.axes, rules.iter().map(|placed| &placed.rule.condition)) else {
            return self.unexamined();
        };
        let Some(mut empty) = self.empty_cells(&grid, &rules) else { return };
        let mut holes = Vec::new();
        while let Some(found) = empty.iter().position(|empty| *empty)
            && holes.len() < HOLES_MAX
        {
            holes.push(self.grow(&grid, found, &mut empty, output));
        }
        if let Some(last) = holes.last_mut() {
            last.further_cells = empty.iter().filter(|empty| **empty).count() as u64;
        }
        let at = self.places.outputs[output].at;
        holes.into_iter().for_each(|hole| self.warn(at, WarningKind::Hole(hole)));
    }

    /// Returns for each cell whether no rule fires there. `None`: too expensive.
    fn empty_cells(&mut self, grid: &AxisGrid<'_>, rules: &[Placed<'_>]) -> Option<Vec<bool>> {
        let mut place = ConditionDegree::new(self.block.inputs.len());
        let mut empty = vec![false; grid.len as usize];
        // Try the rule that fired in the last cell first
        let mut last = 0;
        for index in (0..grid.len).filter(|&index| grid.cells(index).all(|(_, cell)| cell.in_range)) {
            place.go(grid, index);
            let mut cost = 0;
            let fires = |&which: &usize| {
                cost += leaves(&rules[which].rule.condition);
                place.degree(rules[which].block, rules[which].rule) > 0.0
            };
            match std::iter::once(last).chain(0..rules.len()).find(fires) {
                Some(which) => last = which,
                None => empty[index as usize] = true,
            }
            if !self.pay(cost) {
                return None;
            }
        }
        Some(empty)
    }

    /// Grows a cell to a box of empty cells and marks them as reported.
    fn grow(&self, grid: &AxisGrid<'_>, from: usize, empty: &mut [bool], output: usize) -> Hole {
        let counts: Vec<usize> = grid.axes.iter().map(|(_, axis)| axis.cells.len()).collect();
        let mut rest = from;
        let mut sides: Vec<(usize, usize)> = Vec::with_capacity(counts.len());
        for count in &counts {
            sides.push((rest % count, rest % count));
            rest /= count;
        }
        for axis in 0..sides.len() {
            let slab = |sides: &[(usize, usize)], at: usize| {
                let mut slab = sides.to_vec();
                slab[axis] = (at, at);
                cells_of(&slab, &counts).all(|cell| empty[cell])
            };
            while sides[axis].0 > 0 && slab(&sides, sides[axis].0 - 1) {
                sides[axis].0 -= 1;
            }
            while sides[axis].1 + 1 < counts[axis] && slab(&sides, sides[axis].1 + 1) {
                sides[axis].1 += 1;
            }
        }
        cells_of(&sides, &counts).for_each(|cell| empty[cell] = false);
        let bounds = grid.axes.iter().zip(&sides).filter_map(|((input, axis), &(low, high))| {
            let outside = |range: std::ops::Range<usize>| axis.cells[range].iter().all(|cell| !cell.in_range);
            let whole = outside(0..low) && outside(high + 1..axis.cells.len());
            let name = self.block.inputs[*input].name.clone();
            (!whole).then(|| (name, axis.cells[low].low, axis.cells[high].high))
        });
        let (output, sides) = (self.block.outputs[output].name.clone(), bounds.collect());
        Hole { output, sides, further_cells: 0 }
    }
}

/// Returns the cells of a box, given by its first and last cell along each axis.
fn cells_of(sides: &[(usize, usize)], counts: &[usize]) -> impl Iterator<Item = usize> {
    let total: usize = sides.iter().map(|(low, high)| high - low + 1).product();
    (0..total).map(move |mut k| {
        let (mut cell, mut stride) = (0, 1);
        for ((low, high), count) in sides.iter().zip(counts) {
            let width = high - low + 1;
            cell += (low + k % width) * stride;
            k /= width;
            stride *= count;
        }
        cell
    })
}
