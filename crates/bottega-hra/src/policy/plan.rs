//! The fluid plan: the assignment of primitives to resources with which all finish together.
//!
//! Work is treated as a fluid: a resource of kind r needs t(r, p) per item of primitive p, there are n(r) of the kind,
//! and b(p) items wait. Find times x(r, p) with Σₚ x(r, p) ≤ n(r) that maximize λ = minₚ Σᵣ x(r, p) / (t(r, p) · b(p));
//! the work ends after 1/λ. This is a small linear program, solved by the simplex method (Dantzig; Bland's rule if it
//! stalls). Its dual gives each primitive a price, at which each resource does the primitive that pays best per hour. This is
//! Ricardo's comparative advantage: a resource does not do what it does faster than others, but what it does least
//! badly. It also keeps less capable resources busy: for the more capable ones other work pays better.

use super::time::Time;
use crate::Primitive;

const COUNT: usize = Primitive::COUNT;

/// A table with an entry per primitive.
pub(crate) type ByPrimitive<T> = [T; COUNT];

/// Smaller numbers are rounding errors; all rates are scaled to at most 1.
const TINY: f64 = 1e-12;
/// Maximum number of pivots; about two per row are needed.
const PIVOTS_MAX: usize = 2_000;

/// Resources of one kind.
#[derive(Clone, Debug)]
pub(crate) struct ResourceKind {
    /// Nanoseconds per item; infinite for unsupported primitives.
    pub(crate) times: ByPrimitive<f64>,
    /// Number of resources of this kind.
    pub(crate) count: f64,
}

impl ResourceKind {
    /// Returns true if a resource with these times is of the kind: it supports the same primitives, within a fifth of
    /// the speed.
    pub(crate) fn is_like(&self, times: &ByPrimitive<f64>) -> bool {
        self.times.iter().zip(times).all(|(own, time)| {
            own == time || (own.is_finite() && time.is_finite() && (0.8..=1.25).contains(&(own / time)))
        })
    }

    /// Adds a resource, and its times to the mean.
    pub(crate) fn add(&mut self, times: &ByPrimitive<f64>) {
        self.count += 1.0;
        for (own, time) in self.times.iter_mut().zip(times).filter(|(own, _)| own.is_finite()) {
            *own += (time - *own) / self.count;
        }
    }
}

/// A solution: shares of time, and prices.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FluidPlan {
    /// By kind: the share of a resource's time for each primitive.
    pub(crate) shares: Vec<ByPrimitive<f64>>,
    /// Value of an item, in nanoseconds: all resources together earn the value of all work in the planned time.
    pub(crate) prices: ByPrimitive<f64>,
    /// Nanoseconds until everything is done.
    pub(crate) time_ns: f64,
}

/// Plans a backlog of items. Primitives that no resource supports, or without waiting items, are left out.
pub(crate) fn plan(kinds: &[ResourceKind], backlog: &ByPrimitive<f64>) -> FluidPlan {
    let rate = |r: usize, p: usize| {
        let time = kinds[r].times[p] * backlog[p];
        if time.is_finite() && time > 0.0 { 1.0 / time } else { 0.0 }
    };
    let alive: Vec<usize> = (0..COUNT).filter(|&p| (0..kinds.len()).any(|r| rate(r, p) > 0.0)).collect();
    let mut plan = FluidPlan { shares: vec![[0.0; COUNT]; kinds.len()], prices: [0.0; COUNT], time_ns: 0.0 };
    if alive.is_empty() {
        return plan;
    }
    let pairs: Vec<(usize, usize)> = (0..kinds.len())
        .flat_map(|r| (0..alive.len()).map(move |row| (r, row)))
        .filter(|&(r, row)| rate(r, alive[row]) > 0.0)
        .collect();
    let fastest = pairs.iter().map(|&(r, row)| rate(r, alive[row])).fold(0.0, f64::max);
    let mut tableau = Tableau::new(alive.len() + kinds.len(), 1 + pairs.len());
    for row in 0..alive.len() {
        *tableau.at(row, 0) = 1.0; // λ less what is done is at most 0.
    }
    for (column, &(r, row)) in (1..).zip(&pairs) {
        *tableau.at(row, column) = -rate(r, alive[row]) / fastest;
        *tableau.at(alive.len() + r, column) = 1.0;
    }
    for (r, kind) in kinds.iter().enumerate() {
        *tableau.limit(alive.len() + r) = kind.count;
    }
    tableau.maximize_first();
    let values = tableau.values();
    plan.time_ns = 1.0 / (values[0] * fastest);
    for (&value, &(r, row)) in values[1..].iter().zip(&pairs) {
        plan.shares[r][alive[row]] = (value / kinds[r].count).clamp(0.0, 1.0);
    }
    for (row, &p) in alive.iter().enumerate() {
        plan.prices[p] =
            tableau.price(row) / backlog[p] * plan.time_ns * kinds.iter().map(|kind| kind.count).sum::<f64>();
    }
    plan
}

/// A linear program: maximize the first variable, with rows ≤ limits and all variables at least 0.
struct Tableau {
    rows: usize,
    columns: usize,
    /// The cells: rows of `columns` + `rows` + 1 numbers (variables, slacks, limit); the objective is the last row.
    cells: Vec<f64>,
    basis: Vec<usize>,
}

impl Tableau {
    fn new(rows: usize, columns: usize) -> Self {
        let width = columns + rows + 1;
        let mut tableau = Self { rows, columns, cells: vec![0.0; width * (rows + 1)], basis: Vec::new() };
        for row in 0..rows {
            *tableau.at(row, columns + row) = 1.0;
            tableau.basis.push(columns + row);
        }
        *tableau.at(rows, 0) = -1.0;
        tableau
    }

    fn width(&self) -> usize {
        self.columns + self.rows + 1
    }

    fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        let width = self.width();
        &mut self.cells[row * width + column]
    }

    fn limit(&mut self, row: usize) -> &mut f64 {
        self.at(row, self.width() - 1)
    }

    fn get(&self, row: usize, column: usize) -> f64 {
        self.cells[row * self.width() + column]
    }

    fn maximize_first(&mut self) {
        for pivots in 0..PIVOTS_MAX {
            let objective = |column: usize| self.get(self.rows, column);
            let mut gaining = (0..self.width() - 1).filter(|&column| objective(column) < -TINY);
            // Choose the steepest column; after a while the first (Bland), which cannot cycle
            let entering = if pivots < PIVOTS_MAX / 2 {
                gaining.min_by(|&a, &b| objective(a).total_cmp(&objective(b)))
            } else {
                gaining.next()
            };
            let Some(column) = entering else { return };
            let bound = |row: &usize| self.get(*row, self.width() - 1) / self.get(*row, column);
            let leaving = (0..self.rows)
                .filter(|&row| self.get(row, column) > TINY)
                .min_by(|a, b| bound(a).total_cmp(&bound(b)).then(self.basis[*a].cmp(&self.basis[*b])));
            let Some(row) = leaving else { return };
            self.pivot(row, column);
        }
    }

    fn pivot(&mut self, row: usize, column: usize) {
        let width = self.width();
        let pivot = self.get(row, column);
        let pivot_row: Vec<f64> = self.cells[row * width..][..width].iter().map(|cell| cell / pivot).collect();
        for (other, cells) in self.cells.chunks_exact_mut(width).enumerate() {
            let factor = cells[column];
            if other == row {
                cells.copy_from_slice(&pivot_row);
            } else if factor != 0.0 {
                cells.iter_mut().zip(&pivot_row).for_each(|(cell, pivot)| *cell -= factor * pivot);
            }
        }
        self.basis[row] = column;
    }

    fn values(&self) -> Vec<f64> {
        let mut values = vec![0.0; self.columns];
        for (row, &variable) in self.basis.iter().enumerate().filter(|&(_, &variable)| variable < self.columns) {
            values[variable] = self.get(row, self.width() - 1);
        }
        values
    }

    /// Returns the dual value of a row.
    fn price(&self, row: usize) -> f64 {
        self.get(self.rows, self.columns + row).max(0.0)
    }
}

/// Divides `total` items among resources with costs `(fixed, per item)` in nanoseconds so that all that get any finish
/// at the same time, except for rounding to whole items. `None` stands for a resource that gets nothing.
///
/// A resource that cannot start before the others are done gets nothing. All zero without resources.
pub(crate) fn split(total: u64, costs: &[Option<(f64, f64)>]) -> Vec<u64> {
    let usable = |cost: &(f64, f64)| cost.0 >= 0.0 && cost.0.is_finite() && cost.1 > 0.0 && cost.1.is_finite();
    let mut order: Vec<(usize, f64, f64)> = (0..costs.len())
        .filter_map(|index| costs[index].filter(usable).map(|(fixed, per_item)| (index, fixed, per_item)))
        .collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    let starts: Vec<(f64, f64)> = order.iter().map(|&(_, fixed, per_item)| (fixed, 1.0 / per_item)).collect();
    let end = water_level(&starts, total as f64);
    let mut shares = vec![0; costs.len()];
    let mut left = total;
    let mut parts: Vec<(usize, f64)> = Vec::new();
    for (index, fixed, per_item) in order {
        let exact = ((end - fixed) / per_item).clamp(0.0, left as f64);
        shares[index] = (exact as u64).min(left);
        left -= shares[index];
        parts.push((index, exact.fract() / per_item));
    }
    // The remainder of rounding goes to those cut most, in time
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    for &(index, _) in parts.iter().cycle().take(if parts.is_empty() { 0 } else { left.min(1 << 16) as usize }) {
        shares[index] += 1;
        left -= 1;
    }
    if let Some(&(index, _)) = parts.first() {
        shares[index] += left;
    }
    shares
}

/// Returns the time at which `amount` is done by workers with `(start, speed)`, in the order of their starts.
pub(crate) fn water_level(workers: &[(f64, f64)], amount: f64) -> f64 {
    let (mut speed, mut level, mut done) = (0.0, 0.0, 0.0);
    for &(start, own) in workers {
        if speed > 0.0 && done + (start - level) * speed >= amount {
            break;
        }
        if speed > 0.0 {
            done += (start - level) * speed;
        }
        level = start;
        speed += own;
    }
    if speed > 0.0 { level + (amount - done).max(0.0) / speed } else { f64::INFINITY }
}

/// A plan, with its execution so far.
pub(super) struct PlannedPacket {
    pub(super) plan: FluidPlan,
    pub(super) valid_until: Time,
    pub(super) live: ByPrimitive<bool>,
    /// By resource: its row in the plan.
    pub(super) rows: Vec<usize>,
    /// By resource and primitive: planned time minus time spent, in nanoseconds.
    pub(super) owed: Vec<ByPrimitive<f64>>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn kinds(rows: &[&[f64]]) -> Vec<ResourceKind> {
        let times = |row: &[f64]| std::array::from_fn(|p| row.get(p).copied().unwrap_or(f64::INFINITY));
        rows.iter().map(|row| ResourceKind { times: times(row), count: 1.0 }).collect()
    }

    fn backlog(items: &[f64]) -> ByPrimitive<f64> {
        std::array::from_fn(|p| items.get(p).copied().unwrap_or(0.0))
    }

    #[test]
    fn each_does_what_it_does_least_badly() {
        // The first is faster at both, but much faster at the first primitive.
        let plan = plan(&kinds(&[&[1.0, 4.0], &[10.0, 5.0]]), &backlog(&[100.0, 100.0]));
        assert!(plan.shares[1][1] > 0.999, "{plan:?}");
        // 100 of the first take 100 ns; then both do the second at 1/4 + 1/5: T = 100 + (100 − 100/5) · 4 / (1 + 4/5).
        let best = 100.0 + 80.0 / (0.25 + 0.2);
        assert!((plan.time_ns / best - 1.0).abs() < 1e-9, "{plan:?}, {best}");
    }

    #[test]
    fn who_can_do_one_thing_alone_is_left_it() {
        let inf = f64::INFINITY;
        let plan = plan(&kinds(&[&[1.0, 1.0], &[1.0, inf]]), &backlog(&[50.0, 50.0]));
        assert_eq!((plan.shares[0][0], plan.shares[1][0]), (0.0, 1.0), "{plan:?}");
    }

    #[test]
    fn a_split_ends_together() {
        let costs = [Some((0.0, 10.0)), Some((2_000.0, 1.0)), None, Some((1e9, 1.0))];
        let shares = split(10_000, &costs);
        assert_eq!(shares.iter().sum::<u64>(), 10_000);
        assert_eq!((shares[2], shares[3]), (0, 0));
        let (first, second) = (10.0 * shares[0] as f64, 2_000.0 + shares[1] as f64);
        assert!((first / second - 1.0).abs() < 0.02, "{shares:?}");
        assert_eq!(split(7, &[None]), [0]);
    }

    proptest! {
        /// By weak duality no plan ends before Σₚ w(p) b(p) / Σᵣ n(r) maxₚ w(p) / t(r, p), whatever the prices w.
        #[test]
        fn no_plan_could_end_sooner(
            rows in prop::collection::vec(
                (prop::collection::vec(prop_oneof![3 => 1.0_f64..100.0, 1 => Just(f64::INFINITY)], 4), 1_u32..20), 1..9),
            items in prop::collection::vec(1.0_f64..1e6, 4),
        ) {
            let kinds: Vec<ResourceKind> = rows.iter().map(|(row, count)| {
                ResourceKind { count: f64::from(*count), ..kinds(&[row])[0].clone() }
            }).collect();
            let backlog = backlog(&items);
            let plan = plan(&kinds, &backlog);
            let possible: Vec<usize> = (0..4).filter(|&p| kinds.iter().any(|kind| kind.times[p].is_finite())).collect();
            for shares in &plan.shares {
                prop_assert!(shares.iter().sum::<f64>() <= 1.0 + 1e-9);
            }
            for &p in &possible {
                let speed: f64 = kinds.iter().zip(&plan.shares).map(|(kind, shares)| {
                    if shares[p] > 0.0 { kind.count * shares[p] / kind.times[p] } else { 0.0 }
                }).sum();
                prop_assert!(speed * plan.time_ns >= backlog[p] * (1.0 - 1e-6), "{:?}", plan);
            }
            if !possible.is_empty() {
                let worth: f64 = possible.iter().map(|&p| plan.prices[p] * backlog[p]).sum();
                let income: f64 = kinds.iter().map(|kind| {
                    kind.count * possible.iter().map(|&p| plan.prices[p] / kind.times[p]).fold(0.0, f64::max)
                }).sum();
                prop_assert!(plan.time_ns <= worth / income * (1.0 + 1e-6), "{:?} {}", plan, worth / income);
            }
        }

        #[test]
        fn splits_give_everything_away_and_end_together(
            total in 20_000_u64..1 << 40,
            costs in prop::collection::vec((0.0_f64..1e5, 1.0_f64..100.0), 1..9),
        ) {
            let shares = split(total, &costs.iter().copied().map(Some).collect::<Vec<_>>());
            prop_assert_eq!(shares.iter().sum::<u64>(), total);
            let ends = shares.iter().zip(&costs).filter(|(share, _)| **share > 0)
                .map(|(&share, cost)| cost.0 + cost.1 * share as f64);
            let (first, last) = ends.fold((f64::INFINITY, 0.0_f64), |(a, b), end| (a.min(end), b.max(end)));
            prop_assert!(last - first <= 0.02 * last, "{:?}", shares);
        }
    }
}
