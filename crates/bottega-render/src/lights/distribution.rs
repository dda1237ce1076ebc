//! Tabulated densities on the unit square, and sampling by them.

/// Largest f32 below 1.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

/// A density on the unit square that is constant within each cell of a grid.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    /// Cumulative sums along each row, `[rows × (columns + 1)]`, from 0 to 1.
    pub(crate) conditional: Vec<f32>,
    /// Cumulative sums of the rows, `[rows + 1]`, from 0 to 1.
    pub(crate) marginal: Vec<f32>,
}

impl Cells {
    /// Creates the density; `None` if all cells are 0.
    pub(super) fn new(cells: &[f32], columns: usize, rows: usize) -> Option<Self> {
        let mut conditional = Vec::with_capacity(rows * (columns + 1));
        let row_sums: Vec<f64> = cells.chunks_exact(columns).map(|row| push_sums(&mut conditional, row)).collect();
        let row_sums: Vec<f32> = row_sums.into_iter().map(|sum| sum as f32).collect();
        let mut marginal = Vec::with_capacity(rows + 1);
        let total = push_sums(&mut marginal, &row_sums);
        (total > 0.0 && total.is_finite()).then_some(Self { columns, rows, conditional, marginal })
    }

    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.conditional) + size_of_val(&*self.marginal)
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.conditional[row * (self.columns + 1)..(row + 1) * (self.columns + 1)]
    }

    /// Draws a point; returns it with its density.
    pub(super) fn sample(&self, u: [f32; 2]) -> ([f32; 2], f32) {
        let (row, y, row_density) = invert(&self.marginal, u[1]);
        let (_, x, column_density) = invert(self.row(row), u[0]);
        ([x, y], row_density * column_density)
    }

    /// Returns the density at a point.
    pub(super) fn density(&self, [x, y]: [f32; 2]) -> f32 {
        let row = ((y * self.rows as f32) as usize).min(self.rows - 1);
        let column = ((x * self.columns as f32) as usize).min(self.columns - 1);
        let share = |sums: &[f32], i: usize| sums[i + 1] - sums[i];
        share(&self.marginal, row) * self.rows as f32 * share(self.row(row), column) * self.columns as f32
    }
}

/// Appends the cumulative sums of `values`, normalized from 0 to 1, and returns the sum. If it is 0, all values count as
/// equal.
fn push_sums(sums: &mut Vec<f32>, values: &[f32]) -> f64 {
    let total: f64 = values.iter().map(|&v| f64::from(v)).sum();
    let mut sum = 0.0;
    sums.push(0.0);
    for (i, &value) in values.iter().enumerate() {
        sum += f64::from(value);
        let share = if total > 0.0 { sum / total } else { (i + 1) as f64 / values.len() as f64 };
        sums.push(share as f32);
    }
    if let Some(last) = sums.last_mut() {
        *last = 1.0;
    }
    total
}

/// Inverts cumulative sums at `u`; returns the cell, the position in [0, 1), and the density there.
fn invert(sums: &[f32], u: f32) -> (usize, f32, f32) {
    let cells = sums.len() - 1;
    // Choose the last cell that starts at or below u: its share is positive, since the next one starts above u
    let cell = sums.partition_point(|&sum| sum <= u).clamp(1, cells) - 1;
    let share = sums[cell + 1] - sums[cell];
    let part = if share > 0.0 { (u - sums[cell]) / share } else { 0.5 };
    let place = ((cell as f32 + part) / cells as f32).min(ONE_BELOW);
    (cell, place, share * cells as f32)
}

/// A density that is bilinear between values at the centres of the cells of a grid: periodic along x, and constant beyond
/// the outer centres along y. It follows the interpolated picture, not only its texels.
#[derive(Clone, Debug)]
pub(crate) struct Bilinear {
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    /// Values `[rows × columns]`, with mean 1.
    pub(crate) values: Vec<f32>,
    /// Cumulative sums of the values along each row, `[rows × (columns + 1)]`: from the centre of the first column to
    /// those of the others and back to the first, divided by the number of columns.
    pub(crate) sums: Vec<f32>,
    /// Cumulative sums from the upper edge to the centre of each row and to the lower edge, `[rows + 2]`, from 0 to 1.
    pub(crate) marginal: Vec<f32>,
}

impl Bilinear {
    /// Creates the density; `None` if all values are 0.
    pub(super) fn new(mut values: Vec<f32>, columns: usize, rows: usize) -> Option<Self> {
        let total: f64 = values.iter().map(|&value| f64::from(value)).sum();
        let scale = values.len() as f64 / total;
        if !(total > 0.0 && scale.is_finite()) {
            return None;
        }
        values.iter_mut().for_each(|value| *value = (f64::from(*value) * scale) as f32);
        let mut sums = Vec::with_capacity(rows * (columns + 1));
        for row in values.chunks_exact(columns) {
            let mut sum = 0.0;
            sums.push(0.0);
            for (i, &value) in row.iter().enumerate() {
                let next = row[(i + 1) % columns];
                sum += 0.5 * (f64::from(value) + f64::from(next)) / columns as f64;
                sums.push(sum as f32);
            }
        }
        let mean = |row: usize| f64::from(sums[row * (columns + 1) + columns]);
        let mut marginal = vec![0.0];
        let mut sum = 0.5 * mean(0);
        marginal.push(sum);
        for row in 1..rows {
            sum += 0.5 * (mean(row - 1) + mean(row));
            marginal.push(sum);
        }
        sum += 0.5 * mean(rows - 1);
        let mut marginal: Vec<f32> = marginal.into_iter().map(|part| (part / sum) as f32).collect();
        marginal.push(1.0);
        Some(Self { columns, rows, values, sums, marginal })
    }

    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.values) + size_of_val(&*self.sums) + size_of_val(&*self.marginal)
    }

    fn row_sums(&self, row: usize) -> &[f32] {
        &self.sums[row * (self.columns + 1)..(row + 1) * (self.columns + 1)]
    }

    /// Returns the rows above and below a position between centres, and the weight of the lower one.
    fn rows_at(&self, y: f32) -> (usize, usize, f32) {
        let place = y * self.rows as f32 - 0.5;
        let above = place.max(0.0) as usize;
        let above = above.min(self.rows - 1);
        let below = (above + 1).min(self.rows - 1);
        (above, below, (place - above as f32).clamp(0.0, 1.0))
    }

    /// Draws a point; returns it with its density.
    pub(super) fn sample(&self, u: [f32; 2]) -> ([f32; 2], f32) {
        // Choose the interval of rows: interval k goes from the centre of row k − 1 to that of row k
        let intervals = self.marginal.len() - 1;
        let interval = self.marginal.partition_point(|&sum| sum <= u[1]).clamp(1, intervals) - 1;
        let start = self.marginal[interval];
        let share = self.marginal[interval + 1] - start;
        let part = if share > 0.0 { ((u[1] - start) / share).min(1.0) } else { 0.5 };
        let mean = |row: usize| self.row_sums(row)[self.columns];
        let y = if interval == 0 {
            0.5 * part
        } else if interval == self.rows {
            self.rows as f32 - 0.5 + 0.5 * part
        } else {
            interval as f32 - 0.5 + sample_linear(mean(interval - 1), mean(interval), part)
        };
        // Interpolate the sums of both rows
        let y = (y / self.rows as f32).min(ONE_BELOW);
        let (above, below, lower) = self.rows_at(y);
        let (upper_sums, lower_sums) = (self.row_sums(above), self.row_sums(below));
        let sum = |i: usize| upper_sums[i] + (lower_sums[i] - upper_sums[i]) * lower;
        let target = u[0] * sum(self.columns);
        let (mut first, mut last) = (0, self.columns);
        // Find the last centre whose sum is at or below the target
        while last - first > 1 {
            let middle = (first + last) / 2;
            if sum(middle) <= target {
                first = middle;
            } else {
                last = middle;
            }
        }
        let share = sum(first + 1) - sum(first);
        let part = if share > 0.0 { ((target - sum(first)) / share).clamp(0.0, 1.0) } else { 0.5 };
        let value = |column: usize| {
            let at = |row: usize| self.values[row * self.columns + column % self.columns];
            at(above) + (at(below) - at(above)) * lower
        };
        let x = (first as f32 + 0.5 + sample_linear(value(first), value(first + 1), part)) / self.columns as f32;
        let x = if x >= 1.0 { x - 1.0 } else { x };
        ([x, y], self.density([x, y]))
    }

    /// Returns the density at a point.
    pub(super) fn density(&self, [x, y]: [f32; 2]) -> f32 {
        let (above, below, lower) = self.rows_at(y);
        let place = x * self.columns as f32 + self.columns as f32 - 0.5;
        let first = place as usize;
        let right = place - first as f32;
        let (first, second) = (first % self.columns, (first + 1) % self.columns);
        let along = |row: usize| {
            let row = &self.values[row * self.columns..(row + 1) * self.columns];
            row[first] + (row[second] - row[first]) * right
        };
        along(above) + (along(below) - along(above)) * lower
    }
}

/// Draws a number in [0, 1] by a density that goes linearly from `a` to `b`.
fn sample_linear(a: f32, b: f32, u: f32) -> f32 {
    let root = (a * a + (b * b - a * a) * u).max(0.0).sqrt();
    if a + root > 0.0 { (u * (a + b) / (a + root)).clamp(0.0, 1.0) } else { u.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIDE: usize = 128;

    fn grid() -> impl Iterator<Item = [f32; 2]> {
        (0..SIDE * SIDE).map(|i| [i % SIDE, i / SIDE].map(|j| (j as f32 + 0.5) / SIDE as f32))
    }

    /// Compares the number of points in each cell of a coarse grid with the integral of the density over it.
    fn assert_drawn_by_density(
        sample: impl Fn([f32; 2]) -> ([f32; 2], f32),
        density: impl Fn([f32; 2]) -> f32,
    ) -> Result<(), TestCaseError> {
        const BINS: usize = 4;
        let (mut found, mut expected) = ([0.0; BINS * BINS], [0.0; BINS * BINS]);
        let bin = |[x, y]: [f32; 2]| (y * BINS as f32) as usize * BINS + (x * BINS as f32) as usize;
        let part = 1.0 / (SIDE * SIDE) as f32;
        for u in grid() {
            let (place, pdf) = sample(u);
            prop_assert!(place.iter().all(|x| (0.0..1.0).contains(x)), "{place:?}");
            prop_assert!((pdf - density(place)).abs() <= 1e-3 * pdf + 1e-6);
            found[bin(place)] += part;
            expected[bin(u)] += density(u) * part;
        }
        for (found, expected) in found.iter().zip(expected) {
            prop_assert!((found - expected).abs() < 0.012, "{found} {expected}");
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn places_are_drawn_by_the_density(
            columns in 1usize..9, rows in 1usize..9, values in prop::collection::vec(0.0f32..10.0, 64), dark in 0usize..8,
        ) {
            let mut values = values[..columns * rows].to_vec();
            values.iter_mut().take(dark).for_each(|value| *value = 0.0);
            if let Some(table) = Bilinear::new(values.clone(), columns, rows) {
                assert_drawn_by_density(|u| table.sample(u), |place| table.density(place))?;
            }
            // The midpoints of the coarse grid meet the borders of cells only if these divide it
            if let Some(table) = Cells::new(&values, columns, rows).filter(|_| 128 % columns == 0 && 128 % rows == 0) {
                assert_drawn_by_density(|u| table.sample(u), |place| table.density(place))?;
            }
        }
    }

    #[test]
    fn nothing_is_drawn_from_nothing() {
        assert!(Bilinear::new(vec![0.0; 6], 3, 2).is_none() && Cells::new(&[0.0; 6], 3, 2).is_none());
    }
}
