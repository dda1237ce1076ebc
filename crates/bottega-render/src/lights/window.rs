//! A table of densities over the unit square that can be sampled within any axis-parallel window.
//!
//! With a summed-area table, the integral over a window takes four lookups, and sampling it two searches (Bitterli, Novák
//! and Jarosz 2015, *Portal-Masked Environment Map Sampling*, §4).

/// Lower and upper corner of a window of the unit square.
pub(super) type UnitWindow = [[f64; 2]; 2];

/// A density that is constant in each cell of a grid.
#[derive(Clone, Debug)]
pub(super) struct WindowTable {
    columns: usize,
    rows: usize,
    values: Vec<f32>,
    /// Integral from the origin to each corner of a cell: (columns + 1) × (rows + 1).
    sums: Vec<f64>,
}

impl WindowTable {
    /// Creates the table.
    ///
    /// - `values`: row by row, not negative.
    pub(super) fn new(values: Vec<f32>, columns: usize, rows: usize) -> Self {
        let area = 1.0 / (columns * rows) as f64;
        let mut sums = vec![0.0; (columns + 1) * (rows + 1)];
        for row in 0..rows {
            let mut sum = 0.0;
            for column in 0..columns {
                sum += f64::from(values[row * columns + column]) * area;
                sums[(row + 1) * (columns + 1) + column + 1] = sums[row * (columns + 1) + column + 1] + sum;
            }
        }
        Self { columns, rows, values, sums }
    }

    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.values) + size_of_val(&*self.sums)
    }

    /// Returns the value at a point.
    pub(super) fn value(&self, [x, y]: [f64; 2]) -> f32 {
        let column = ((x * self.columns as f64) as usize).min(self.columns - 1);
        let row = ((y * self.rows as f64) as usize).min(self.rows - 1);
        self.values[row * self.columns + column]
    }

    /// Returns the integral over a window.
    pub(super) fn integral(&self, [low, high]: UnitWindow) -> f64 {
        let sum = self.sum(high[0], high[1]) - self.sum(low[0], high[1]) - self.sum(high[0], low[1])
            + self.sum(low[0], low[1]);
        sum.max(0.0)
    }

    /// Returns the integral from the origin to a point: bilinear within a cell, since the values are constant.
    fn sum(&self, x: f64, y: f64) -> f64 {
        let (x, y) = (x * self.columns as f64, y * self.rows as f64);
        let (column, row) = ((x as usize).min(self.columns - 1), (y as usize).min(self.rows - 1));
        let (dx, dy) = (x - column as f64, y - row as f64);
        let corner = |i: usize, j: usize| self.sums[(row + j) * (self.columns + 1) + column + i];
        let upper = corner(0, 0) * (1.0 - dx) + corner(1, 0) * dx;
        let lower = corner(0, 1) * (1.0 - dx) + corner(1, 1) * dx;
        upper * (1.0 - dy) + lower * dy
    }

    /// Draws a point in a window with density value ∕ [`integral`](Self::integral). `None`: the window is empty or dark.
    pub(super) fn sample(&self, window: UnitWindow, u: [f32; 2]) -> Option<[f64; 2]> {
        let [low, high] = window;
        let x = invert(self.columns, [low[0], high[0]], u[0], |x| self.integral([low, [x, high[1]]]))?;
        // Within a column of cells, the density along y does not depend on x
        let column = ((x * self.columns as f64) as usize).min(self.columns - 1);
        let strip = [column as f64 / self.columns as f64, (column + 1) as f64 / self.columns as f64];
        let y = invert(self.rows, [low[1], high[1]], u[1], |y| self.integral([[strip[0], low[1]], [strip[1], y]]))?;
        Some([x, y])
    }
}

/// Returns the position in a range where `sum`, which grows from 0 and is linear between the borders of `cells` cells,
/// reaches the fraction `u` of its final value. `None`: it stays 0.
fn invert(cells: usize, [low, high]: [f64; 2], u: f32, sum: impl Fn(f64) -> f64) -> Option<f64> {
    let total = sum(high);
    if !(total > 0.0 && high > low) {
        return None;
    }
    let wanted = f64::from(u) * total;
    // Find the first border of a cell where the sum exceeds the wanted value
    let border = |cell: usize| (cell as f64 / cells as f64).clamp(low, high);
    let (mut below, mut above) = ((low * cells as f64) as usize, ((high * cells as f64).ceil() as usize).min(cells));
    while above - below > 1 {
        let middle = (below + above) / 2;
        if sum(border(middle)) > wanted { above = middle } else { below = middle }
    }
    let (start, end) = (border(below), border(above));
    let (before, after) = (sum(start), sum(end));
    let share = if after > before { ((wanted - before) / (after - before)).clamp(0.0, 1.0) } else { 0.5 };
    Some(start + (end - start) * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> WindowTable {
        WindowTable::new((0..8 * 4).map(|i| ((i * 7) % 5) as f32).collect(), 8, 4)
    }

    #[test]
    fn integrals_over_windows_are_those_of_the_values() {
        let table = table();
        let window = [[0.13, 0.22], [0.71, 0.9]];
        let mut sum = 0.0;
        for i in 0..1000 {
            for j in 0..1000 {
                let x = window[0][0] + (window[1][0] - window[0][0]) * (f64::from(i) + 0.5) / 1000.0;
                let y = window[0][1] + (window[1][1] - window[0][1]) * (f64::from(j) + 0.5) / 1000.0;
                sum += f64::from(table.value([x, y])) * 1e-6;
            }
        }
        let area = (window[1][0] - window[0][0]) * (window[1][1] - window[0][1]);
        let integral = table.integral(window);
        assert!((integral - sum * area).abs() < 1e-3 * integral, "{integral} {}", sum * area);
        assert_eq!(table.integral([[0.3, 0.3], [0.3, 0.9]]), 0.0);
    }

    #[test]
    fn places_are_drawn_by_the_values_within_the_window() {
        let table = table();
        let window = [[0.13, 0.22], [0.71, 0.9]];
        let integral = table.integral(window);
        // Integrate a test function in both ways
        let f = |[x, y]: [f64; 2]| x * x + 0.5 * y;
        let (mut by_table, mut by_grid) = (0.0, 0.0);
        for i in 0..400u16 {
            for j in 0..400u16 {
                let u = [(f32::from(i) + 0.5) / 400.0, (f32::from(j) + 0.5) / 400.0];
                let place = table.sample(window, u).unwrap();
                assert!((0..2).all(|axis| place[axis] >= window[0][axis] && place[axis] <= window[1][axis]));
                assert!(table.value(place) > 0.0, "{place:?}");
                by_table += f(place) * integral / 160_000.0;
                let place = [0, 1].map(|axis| {
                    let [low, high] = [window[0][axis], window[1][axis]];
                    low + (high - low) * f64::from(u[axis])
                });
                by_grid += f(place) * f64::from(table.value(place)) * (0.58 * 0.68) / 160_000.0;
            }
        }
        assert!((by_table / by_grid - 1.0).abs() < 2e-3, "{by_table} {by_grid}");
        assert!(table.sample([[0.5, 0.5], [0.5, 0.6]], [0.5; 2]).is_none());
    }
}
