//! Tables over the unit square, and warps of the square by densities.

use super::node::NodeWeights;

/// Values on a grid over the unit square, bilinear between its points.
#[derive(Clone, Debug, PartialEq)]
pub struct SquareTable {
    /// Columns and rows, each at least 2.
    pub(super) size: [usize; 2],
    /// Values, row by row.
    pub(super) values: Vec<f32>,
}

impl SquareTable {
    /// Returns the value at a point of the square.
    pub fn at(&self, p: [f32; 2]) -> f32 {
        let cell = Cell::at(self.size, p);
        cell.bilinear(|index| self.values[index])
    }
}

/// A cell of a grid over the unit square, and a point in it.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    /// Index of its first corner.
    first: usize,
    columns: usize,
    /// Column and row of the first corner.
    corner: [usize; 2],
    /// Place of the point in the cell, from 0 to 1.
    fraction: [f32; 2],
}

impl Cell {
    /// Finds the cell of a point. Points beyond the square count as on its edge.
    pub(super) fn at(size: [usize; 2], p: [f32; 2]) -> Self {
        let along = |axis: usize| {
            let position = p[axis].clamp(0.0, 1.0) * (size[axis] - 1) as f32;
            let index = (position as usize).min(size[axis] - 2);
            (index, position - index as f32)
        };
        let ((column, x), (row, y)) = (along(0), along(1));
        Self { first: row * size[0] + column, columns: size[0], corner: [column, row], fraction: [x, y] }
    }

    /// Returns the value at the point, from those at the corners by their index.
    pub(super) fn bilinear<T>(&self, value: impl Fn(usize) -> T) -> T
    where
        T: std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
    {
        let [x, y] = self.fraction;
        let (low, high) = (self.first, self.first + self.columns);
        (value(low) * (1.0 - x) + value(low + 1) * x) * (1.0 - y) + (value(high) * (1.0 - x) + value(high + 1) * x) * y
    }
}

/// Densities over the unit square, one for each node. Each is bilinear between the points of a grid. A warp turns even
/// points into points of such a density: first the row, by its share of the whole, then the place in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Warp {
    /// Columns and rows, each at least 2.
    pub(super) size: [usize; 2],
    /// Densities by node, row and column.
    pub(super) densities: Vec<f32>,
    /// Integrals over the row before each point of the grid, by node, row and column.
    in_rows: Vec<f32>,
    /// Integrals over the square before each row, by node and row.
    of_rows: Vec<f32>,
}

/// Scales each node's values so that they integrate to 1. Values that are 0 everywhere become 1.
pub(super) fn normalize(size: [usize; 2], values: &mut [f32]) {
    let [columns, rows] = size;
    for node in values.chunks_exact_mut(columns * rows) {
        // Points inside belong to two cells along each axis
        let weight = |index: usize, count: usize| if index == 0 || index == count - 1 { 0.5 } else { 1.0 };
        let weights = (0..columns * rows).map(|at| weight(at % columns, columns) * weight(at / columns, rows));
        let sum: f64 = node.iter().zip(weights).map(|(value, weight)| f64::from(*value) * weight).sum();
        let integral = sum / ((columns - 1) * (rows - 1)) as f64;
        let scaled = |value: f32| (f64::from(value) / integral) as f32;
        let is_sound = integral > 0.0 && node.iter().all(|value| scaled(*value).is_finite());
        node.iter_mut().for_each(|value| *value = if is_sound { scaled(*value) } else { 1.0 });
    }
}

impl Warp {
    /// Makes a warp.
    ///
    /// - `densities`: by node, row and column; not negative, and those of each node integrate to 1.
    pub(super) fn new(size: [usize; 2], densities: Vec<f32>) -> Self {
        let [columns, rows] = size;
        let mut in_rows = Vec::with_capacity(densities.len());
        let mut of_rows = Vec::with_capacity(densities.len() / columns);
        for node in densities.chunks_exact(columns * rows) {
            let (mut below, mut before_row) = (0.0, 0.0);
            for (index, row) in node.chunks_exact(columns).enumerate() {
                let mut sum = 0.0;
                in_rows.push(0.0);
                for pair in row.windows(2) {
                    sum += 0.5 * (f64::from(pair[0]) + f64::from(pair[1])) / (columns - 1) as f64;
                    in_rows.push(sum as f32);
                }
                if index > 0 {
                    below += 0.5 * (before_row + sum) / (rows - 1) as f64;
                }
                before_row = sum;
                of_rows.push(below as f32);
            }
        }
        Self { size, densities, in_rows, of_rows }
    }

    /// Returns the density at a point of the square.
    pub fn density(&self, nodes: &NodeWeights, p: [f32; 2]) -> f32 {
        Cell::at(self.size, p).bilinear(|index| self.density_of(nodes, index))
    }

    /// Returns the point that an even point `u` of the square becomes, and the density there.
    pub fn sample(&self, nodes: &NodeWeights, u: [f32; 2]) -> ([f32; 2], f32) {
        let [columns, rows] = self.size;
        // Find the cell of the row by the integral below it
        let below = |row: usize| nodes.mean(|node| self.of_rows[node * rows + row]);
        let y = u[1] * below(rows - 1);
        let row = interval(rows, y, below);
        let wholes = [row, row + 1].map(|row| self.in_row(nodes, (row + 1) * columns - 1));
        let up = inverse(wholes, (y - below(row)) * (rows - 1) as f32);
        // Find the cell of the column by the integral before it, at that height
        let before = |column: usize| {
            let [low, high] = [row, row + 1].map(|row| self.in_row(nodes, row * columns + column));
            low + (high - low) * up
        };
        let x = u[0] * before(columns - 1);
        let column = interval(columns, x, before);
        let sides = [column, column + 1].map(|column| {
            let [low, high] = [row, row + 1].map(|row| self.density_of(nodes, row * columns + column));
            low + (high - low) * up
        });
        let along = inverse(sides, (x - before(column)) * (columns - 1) as f32);
        let p = [(column as f32 + along) / (columns - 1) as f32, (row as f32 + up) / (rows - 1) as f32];
        (p, sides[0] + (sides[1] - sides[0]) * along)
    }

    /// Returns the even point that [`sample`](Self::sample) turns into `p`, and the density at `p`.
    pub fn invert(&self, nodes: &NodeWeights, p: [f32; 2]) -> ([f32; 2], f32) {
        let [columns, rows] = self.size;
        let cell = Cell::at(self.size, p);
        let ([column, row], [along, up]) = (cell.corner, cell.fraction);
        let sides = [column, column + 1].map(|column| {
            let [low, high] = [row, row + 1].map(|row| self.density_of(nodes, row * columns + column));
            low + (high - low) * up
        });
        let density = sides[0] + (sides[1] - sides[0]) * along;
        let before = |column: usize| {
            let [low, high] = [row, row + 1].map(|row| self.in_row(nodes, row * columns + column));
            low + (high - low) * up
        };
        let x = before(column) + integral(sides, along) / (columns - 1) as f32;
        let below = |row: usize| nodes.mean(|node| self.of_rows[node * rows + row]);
        let wholes = [row, row + 1].map(|row| self.in_row(nodes, (row + 1) * columns - 1));
        let y = below(row) + integral(wholes, up) / (rows - 1) as f32;
        ([share(x, before(columns - 1)), share(y, below(rows - 1))], density)
    }

    #[inline(always)]
    fn density_of(&self, nodes: &NodeWeights, index: usize) -> f32 {
        let stride = self.size[0] * self.size[1];
        nodes.mean(|node| self.densities[node * stride + index])
    }

    #[inline(always)]
    fn in_row(&self, nodes: &NodeWeights, index: usize) -> f32 {
        let stride = self.size[0] * self.size[1];
        nodes.mean(|node| self.in_rows[node * stride + index])
    }
}

/// Returns the interval of a grid of `count` points in which increasing values reach `x`.
#[inline(always)]
fn interval(count: usize, x: f32, value: impl Fn(usize) -> f32) -> usize {
    let (mut low, mut high) = (0, count - 1);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if value(middle) <= x {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Returns ∫₀ᵗ of a line from one end's value to the other's.
#[inline(always)]
fn integral([first, last]: [f32; 2], t: f32) -> f32 {
    t * (first + 0.5 * t * (last - first))
}

/// Returns the t in [0, 1] at which [`integral`] is `whole`.
#[inline(always)]
fn inverse([first, last]: [f32; 2], whole: f32) -> f32 {
    let root = (first * first + 2.0 * whole * (last - first)).max(0.0).sqrt();
    let divisor = first + root;
    if divisor > 0.0 { (2.0 * whole / divisor).clamp(0.0, 1.0) } else { 0.0 }
}

/// Returns the share of a part in a whole, in [0, 1]; 0 if the whole is 0.
#[inline(always)]
fn share(part: f32, whole: f32) -> f32 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measured::node::NodeGrid;

    /// Densities that differ much between two nodes, with a row and a column of zeros.
    fn warp() -> (NodeGrid, Warp) {
        let size = [5, 4];
        let value = |node: usize, row: usize, column: usize| match (row, column) {
            (2, _) if node == 0 => 0.0,
            (_, 0) => 0.0,
            _ => (1 + (7 * row + 3 * column + 5 * node) % 11) as f32,
        };
        let mut values: Vec<f32> = (0..40).map(|at| value(at / 20, at / 5 % 4, at % 5)).collect();
        normalize(size, &mut values);
        (NodeGrid::new(vec![0.0], vec![0.0, 1.0]).unwrap(), Warp::new(size, values))
    }

    #[test]
    fn inversion_leads_back_and_densities_integrate_to_one() {
        let (grid, warp) = warp();
        for theta in [0.0, 0.3, 1.0] {
            let nodes = grid.around(0.0, theta);
            let (steps, mut sum) = (64, 0.0);
            for at in 0..steps * steps {
                let u = [at % steps, at / steps].map(|i| (i as f32 + 0.5) / steps as f32);
                let (p, density) = warp.sample(&nodes, u);
                let (back, again) = warp.invert(&nodes, p);
                assert!((density - warp.density(&nodes, p)).abs() < 1e-4 * density, "{u:?}");
                assert!((density - again).abs() < 1e-4 * density, "{u:?}");
                assert!((0..2).all(|axis| (back[axis] - u[axis]).abs() < 1e-4), "{u:?} {back:?}");
                sum += warp.density(&nodes, u) / (steps * steps) as f32;
            }
            assert!((sum - 1.0).abs() < 2e-3, "{theta}: {sum}");
        }
    }

    #[test]
    fn a_table_is_bilinear() {
        let table = SquareTable { size: [2, 3], values: vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0] };
        assert_eq!(table.at([0.5, 0.25]), 1.5);
        assert_eq!(table.at([1.0, 1.0]), 5.0);
        assert_eq!(table.at([-1.0, 7.0]), 4.0);
    }

    #[test]
    fn black_nodes_are_even() {
        let mut values = vec![0.0; 4];
        normalize([2, 2], &mut values);
        assert_eq!(values, [1.0; 4]);
        let zeros = Warp::new([2, 2], vec![0.0; 4]);
        let nodes = NodeGrid::new(vec![0.0], vec![0.0]).unwrap().around(0.0, 0.0);
        assert_eq!(zeros.sample(&nodes, [0.3, 0.6]).1, 0.0);
        assert_eq!(zeros.invert(&nodes, [0.3, 0.6]), ([0.0; 2], 0.0));
    }
}
