//! A density of directions as a histogram over the octahedral square.

use bottega_kernels::prefetch;
use glam::{Vec2, Vec3};

use super::octahedron::{direction_from_square, square_from_direction};

/// Cells along one side of the square.
pub(super) const SIDE: usize = 32;
/// Cells of the square.
pub(super) const CELLS: usize = SIDE * SIDE;
/// Sum of the weights of all cells.
const TOTAL: u16 = u16::MAX;
/// Area of a cell within [−1, 1]².
const CELL_AREA: f32 = 4.0 / CELLS as f32;

/// A piecewise constant density over the square, in integers so that sums are exact.
///
/// A search counts how many of [`SIDE`] adjacent numbers are at most a target: a few loads and comparisons of vectors.
#[derive(Clone, Debug)]
#[repr(C)]
pub(super) struct Directions {
    /// Cumulative weight at the end of each row.
    rows: [u16; SIDE],
    /// Cumulative weight before each cell, row by row.
    cumulative: [u16; CELLS + 1],
}

/// Returns how many of the ascending numbers are at most `target`, at most [`SIDE`] − 1.
#[inline(always)]
fn not_above(ends: &[u16; SIDE], target: u16) -> usize {
    usize::from(ends.iter().map(|&end| u16::from(end <= target)).sum::<u16>()).min(SIDE - 1)
}

/// A quadtree density over the square, in Morton order.
///
/// A region has few samples; the larger region around it has more. The share of each quarter in its square is that of
/// the samples, mixed with that of the larger region, weighted as [`PRIOR_COUNT`] samples. So a square hit by a single
/// heavy sample is not trusted, and one hit often is.
#[derive(Clone, Debug)]
pub(super) struct Pyramid {
    /// Probability of the squares of all levels, the whole first; each level sums to 1.
    mass: [f32; SQUARES],
}

/// Number of squares of all levels.
const SQUARES: usize = (4 * CELLS - 1) / 3;
/// Index of the first cell.
const FIRST_CELL: usize = SQUARES - CELLS;
/// Weight of the larger region, in samples; see [`Pyramid`].
const PRIOR_COUNT: f32 = 4.0;

impl Pyramid {
    /// Returns the uniform density over the sphere.
    pub(super) fn uniform() -> Self {
        let mut mass = [0.0; SQUARES];
        for cell in 0..CELLS {
            mass[FIRST_CELL + morton(cell)] = solid_angle(cell) / (4.0 * std::f32::consts::PI);
        }
        Self::summed(mass)
    }

    /// Fills the upper levels with the sums of the lower ones.
    fn summed(mut mass: [f32; SQUARES]) -> Self {
        for square in (0..FIRST_CELL).rev() {
            mass[square] = mass[4 * square + 1..4 * square + 5].iter().sum();
        }
        Self { mass }
    }

    /// Learns a density from samples (cell and weight) and the density `around` of a larger region.
    pub(super) fn learnt(around: &Self, records: impl Iterator<Item = (usize, f32)>) -> Self {
        // Sum weights and squared weights of all levels
        let (mut mass, mut squares) = ([0.0_f32; SQUARES], [0.0_f32; SQUARES]);
        for (cell, weight) in records {
            let cell = FIRST_CELL + morton(cell);
            mass[cell] += weight;
            squares[cell] += weight * weight;
        }
        let (seen, squares) = (Self::summed(mass).mass, Self::summed(squares).mass);
        // Divide each square between its quarters
        let mut out = Self { mass: [0.0; SQUARES] };
        out.mass[0] = 1.0;
        for square in 0..FIRST_CELL {
            // Effective number of samples: as many with equal weights are equally reliable
            let count = if squares[square] > 0.0 { seen[square] * (seen[square] / squares[square]) } else { 0.0 };
            for part in 4 * square + 1..4 * square + 5 {
                let prior = around.mass[part] / around.mass[square].max(f32::MIN_POSITIVE);
                let share = if count > 0.0 { seen[part] / seen[square] } else { 0.0 };
                out.mass[part] = out.mass[square] * (count * share + PRIOR_COUNT * prior) / (count + PRIOR_COUNT);
            }
        }
        out
    }

    /// Returns the probability of a cell.
    pub(super) fn cell(&self, cell: usize) -> f32 {
        self.mass[FIRST_CELL + morton(cell)]
    }
}

/// Returns the position of a cell in Morton order: the interleaved bits of its row and column.
fn morton(cell: usize) -> usize {
    let (x, y) = (cell % SIDE, cell / SIDE);
    (0..SIDE.ilog2()).fold(0, |place, bit| place | (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1))
}

/// Returns the cell of a unit direction, and the factor by which a density over the square is divided for one per solid
/// angle.
pub(super) fn place_of(w: Vec3) -> (u16, f32) {
    let (place, s) = square_from_direction(w);
    (cell_at(place) as u16, s * s * s)
}

/// Returns the cell of a position in [−1, 1]².
#[inline(always)]
fn cell_at(place: Vec2) -> usize {
    let along = |x: f32| (((x + 1.0) * (0.5 * SIDE as f32)) as usize).min(SIDE - 1);
    along(place.y) * SIDE + along(place.x)
}

/// Returns the solid angle of a cell in sr, by its center.
pub(super) fn solid_angle(cell: usize) -> f32 {
    let along = |i: usize| (2 * i + 1) as f32 / SIDE as f32 - 1.0;
    let (_, s) = direction_from_square(Vec2::new(along(cell % SIDE), along(cell / SIDE)));
    s * s * s * CELL_AREA
}

impl Directions {
    /// Creates a density from nonnegative weights; `None`: all are 0, or not finite.
    pub(super) fn new(weights: &[f32; CELLS]) -> Option<Self> {
        let sum: f64 = weights.iter().map(|&weight| f64::from(weight)).sum();
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        let mut cumulative = [0; CELLS + 1];
        let mut before = 0.0;
        for (cell, &weight) in weights.iter().enumerate() {
            before += f64::from(weight);
            cumulative[cell + 1] = (before / sum * f64::from(TOTAL) + 0.5) as u16;
        }
        cumulative[CELLS] = TOTAL;
        Self::from_cumulative(cumulative)
    }

    /// Returns the cumulative weights of the cells, row by row; the first is 0.
    pub(super) fn cumulative(&self) -> [u16; CELLS + 1] {
        self.cumulative
    }

    /// Creates a density from cumulative weights. `None`: not valid.
    pub(super) fn from_cumulative(cumulative: [u16; CELLS + 1]) -> Option<Self> {
        let is_sound = cumulative[0] == 0 && cumulative[CELLS] == TOTAL && cumulative.is_sorted();
        is_sound.then(|| Self { rows: std::array::from_fn(|row| cumulative[(row + 1) * SIDE]), cumulative })
    }

    /// Prefetches the ends of the rows.
    #[inline(always)]
    pub(super) fn request(&self) {
        prefetch(&self.rows, SIDE - 1);
    }

    /// Returns the density of a unit direction, in sr⁻¹.
    #[inline(always)]
    pub(super) fn pdf(&self, w: Vec3) -> f32 {
        let (place, s) = square_from_direction(w);
        let cell = cell_at(place);
        self.weight(cell) / (s * s * s)
    }

    /// Returns the density of a cell, per area of the square.
    #[inline(always)]
    pub(super) fn weight(&self, cell: usize) -> f32 {
        f32::from(self.cumulative[cell + 1] - self.cumulative[cell]) * (1.0 / (TOTAL as f32 * CELL_AREA))
    }

    /// Samples a direction, and returns it with its density in sr⁻¹. Preserves stratification: the first number selects
    /// the row and the position in it, the second the column.
    #[inline(always)]
    pub(super) fn sample(&self, u: [f32; 2]) -> (Vec3, f32) {
        // A target below the total lies in a cell that is not empty
        // Select the row
        let target = (u[0] * f32::from(TOTAL)).min(f32::from(TOTAL) - 0.01);
        let row = not_above(&self.rows, target as u16);
        let (low, high) = (f32::from(self.cumulative[row * SIDE]), f32::from(self.cumulative[(row + 1) * SIDE]));
        let y = (target - low) / (high - low);
        // Select the column
        let target = (low + u[1] * (high - low)).min(high - 0.01);
        let (before, ends) = self.cumulative[row * SIDE..].split_at(1);
        let ends: &[u16; SIDE] = ends.first_chunk().unwrap_or(&self.rows);
        let column = not_above(ends, target as u16);
        let cell = row * SIDE + column;
        let low = f32::from(if column == 0 { before[0] } else { ends[column - 1] });
        let high = f32::from(ends[column]);
        let x = (target - low) / (high - low);
        // Map the position to a direction
        let along = |i: usize, part: f32| (i as f32 + part) * (2.0 / SIDE as f32) - 1.0;
        let (w, s) = direction_from_square(Vec2::new(along(cell % SIDE, x), along(row, y)));
        (w, self.weight(cell) / (s * s * s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::uniform_sphere;

    fn numbers() -> impl Iterator<Item = [f32; 2]> {
        // Spread evenly at every scale, as a grid is not (Roberts 2018, The R2 sequence).
        let part = |i: u32, step: f64| (f64::from(i) * step).fract() as f32;
        (0..40_000).map(move |i| [part(i, 0.754_877_666_246_692_7), part(i, 0.569_840_290_998_053_2)])
    }

    /// A density with a peak, a slope and holes.
    fn example() -> Directions {
        let mut weights = [0.0; CELLS];
        for (cell, weight) in weights.iter_mut().enumerate() {
            *weight = if cell % 3 == 0 { 0.0 } else { 1.0 + cell as f32 * 0.02 };
        }
        weights[77] = 300.0;
        Directions::new(&weights).unwrap()
    }

    #[test]
    fn the_density_integrates_to_one() {
        let directions = example();
        let integral: f64 = numbers()
            .map(|u| f64::from(directions.pdf(uniform_sphere(u))) * 4.0 * std::f64::consts::PI / 40_000.0)
            .sum();
        assert!((integral - 1.0).abs() < 0.02, "{integral}");
    }

    #[test]
    fn samples_follow_the_density() {
        let directions = example();
        let mut counts = [0.0; CELLS];
        for u in numbers() {
            let (w, pdf) = directions.sample(u);
            assert!(w.is_normalized() && pdf > 0.0);
            counts[usize::from(place_of(w).0)] += 1.0 / 40_000.0;
        }
        for (cell, &count) in counts.iter().enumerate() {
            let expected = directions.weight(cell) * CELL_AREA;
            // The numbers are not random: each cell is right to within a few of them along its edges.
            assert!((count - expected).abs() < 0.1 * expected + 6e-4, "{cell}: {count} {expected}");
        }
        for u in [[0.0, 0.0], [1.0 - f32::EPSILON / 2.0, 1.0 - f32::EPSILON / 2.0]] {
            assert!(directions.sample(u).1 > 0.0);
        }
    }

    #[test]
    fn nothing_makes_no_density() {
        assert!(Directions::new(&[0.0; CELLS]).is_none());
        assert!(Directions::new(&[f32::INFINITY; CELLS]).is_none());
    }
}
