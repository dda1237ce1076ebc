//! Sparse cells of a grid: bricks of 8 × 8 × 8 cells, of which empty ones are not stored.
//!
//! The layout is that of a leaf in OpenVDB (Museth 2013, *VDB: High-Resolution Sparse Volumes with Dynamic Topology*),
//! below a table with an entry for each brick.

use super::error::GridError;
use crate::color::Spectrum;

/// Cells along each side of a brick.
pub(crate) const BRICK_SIDE: u32 = 8;
/// Cells of a brick.
pub(crate) const BRICK_CELLS: usize = 512;
/// The table's entry for a brick whose cells are all 0.
pub(crate) const EMPTY_BRICK: u32 = u32::MAX;

/// The cells of a grid, in bricks.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bricks {
    /// Number of bricks along x, y and z.
    count: [u32; 3],
    /// Values per cell: 1, or 3 for colours.
    channels: usize,
    /// Index of each brick's cells; [`EMPTY_BRICK`]: none are stored. Bricks along x first, then y, then z. Several
    /// entries may share cells.
    table: Vec<u32>,
    /// Values of the stored bricks, those of a cell adjacent; cells along z first, then y, then x.
    values: Vec<f32>,
    /// Greatest value of each stored brick, per channel.
    maxima: Vec<Spectrum>,
}

impl Bricks {
    /// Makes the cells of a grid.
    ///
    /// - `size`: cells along x, y and z, above 0.
    /// - `table`: an entry for each brick, also for those that the size cuts.
    /// - `values`: finite and at least 0.
    ///
    /// # Errors
    /// The table or the values do not match the size.
    pub(super) fn new(size: [u32; 3], channels: usize, table: Vec<u32>, values: Vec<f32>) -> Result<Self, GridError> {
        let count = size.map(|side| side.div_ceil(BRICK_SIDE));
        let needed = count.iter().try_fold(1_usize, |product, &side| product.checked_mul(side as usize));
        if needed != Some(table.len()) {
            return Err(GridError::Count { cells: needed.unwrap_or(usize::MAX), values: table.len() });
        }
        let stored = values.len() / (BRICK_CELLS * channels);
        let is_known = |&entry: &u32| entry == EMPTY_BRICK || (entry as usize) < stored;
        if !values.len().is_multiple_of(BRICK_CELLS * channels) || !table.iter().all(is_known) {
            return Err(GridError::Bricks { stored });
        }
        let greatest = |brick: &[f32]| brick.chunks_exact(channels).map(color).fold(Spectrum::ZERO, Spectrum::max);
        let maxima = values.chunks_exact(BRICK_CELLS * channels).map(greatest).collect();
        Ok(Self { count, channels, table, values, maxima })
    }

    /// Returns the table of bricks.
    pub(crate) fn table(&self) -> &[u32] {
        &self.table
    }

    /// Returns the values of the stored bricks.
    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns the values per cell.
    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.table) + size_of_val(&*self.values) + size_of_val(&*self.maxima)
    }

    /// Returns the value of a cell within the grid.
    #[inline]
    pub(super) fn cell(&self, cell: [usize; 3]) -> Spectrum {
        match self.brick(cell.map(|place| place / BRICK_SIDE as usize)) {
            EMPTY_BRICK => Spectrum::ZERO,
            brick => self.stored(brick, cell),
        }
    }

    /// Returns the eight cells between `first` and `first + 1` if one brick has them all, in the order of x, y, z with x
    /// fastest; `None` if they lie in several bricks or beyond the edge.
    #[inline]
    pub(super) fn corners(&self, first: [i64; 3]) -> Option<[Spectrum; 8]> {
        let side = i64::from(BRICK_SIDE);
        let is_within = |axis: usize| {
            let cell = first[axis];
            cell >= 0 && cell < i64::from(self.count[axis]) * side && cell % side != side - 1
        };
        if !(is_within(0) && is_within(1) && is_within(2)) {
            return None;
        }
        let cell = first.map(|place| place as usize);
        let brick = self.brick(cell.map(|place| place / BRICK_SIDE as usize));
        if brick == EMPTY_BRICK {
            return Some([Spectrum::ZERO; 8]);
        }
        let corner = |index: usize| {
            self.stored(brick, [cell[0] + (index & 1), cell[1] + (index >> 1 & 1), cell[2] + (index >> 2)])
        };
        Some([0, 1, 2, 3, 4, 5, 6, 7].map(corner))
    }

    /// Returns an upper bound of the cells between two corners, both included, per channel.
    pub(super) fn max_within(&self, first: [usize; 3], last: [usize; 3]) -> Spectrum {
        let side = BRICK_SIDE as usize;
        let bricks = |axis: usize| first[axis] / side..=last[axis] / side;
        let mut most = Spectrum::ZERO;
        for z in bricks(2) {
            for y in bricks(1) {
                for x in bricks(0) {
                    let place = [x, y, z];
                    let brick = self.brick(place);
                    if brick == EMPTY_BRICK || self.maxima[brick as usize].cmple(most).all() {
                        continue;
                    }
                    let from = [0, 1, 2].map(|axis| first[axis].max(place[axis] * side));
                    let to = [0, 1, 2].map(|axis| last[axis].min(place[axis] * side + side - 1));
                    most = most.max(self.max_in_brick(brick, from, to));
                }
            }
        }
        most
    }

    /// Returns the sum of all cells, per channel.
    pub(super) fn sum(&self) -> glam::DVec3 {
        let cells =
            |brick: u32| &self.values[brick as usize * BRICK_CELLS * self.channels..][..BRICK_CELLS * self.channels];
        let sum = |brick: u32| {
            cells(brick).chunks_exact(self.channels).map(|cell| color(cell).as_dvec3()).sum::<glam::DVec3>()
        };
        self.table.iter().filter(|&&brick| brick != EMPTY_BRICK).map(|&brick| sum(brick)).sum()
    }

    fn max_in_brick(&self, brick: u32, from: [usize; 3], to: [usize; 3]) -> Spectrum {
        if [0, 1, 2].iter().all(|&axis| to[axis] - from[axis] == BRICK_SIDE as usize - 1) {
            return self.maxima[brick as usize];
        }
        let mut most = Spectrum::ZERO;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    most = most.max(self.stored(brick, [x, y, z]));
                }
            }
        }
        most
    }

    /// Returns the table's entry for a brick.
    #[inline]
    fn brick(&self, place: [usize; 3]) -> u32 {
        let [x, y, z] = place;
        self.table[(z * self.count[1] as usize + y) * self.count[0] as usize + x]
    }

    /// Returns the value of a cell of a stored brick.
    #[inline]
    fn stored(&self, brick: u32, cell: [usize; 3]) -> Spectrum {
        let [x, y, z] = cell.map(|place| place % BRICK_SIDE as usize);
        let index = (brick as usize * BRICK_CELLS + (x * 8 + y) * 8 + z) * self.channels;
        color(&self.values[index..index + self.channels])
    }
}

/// Returns the value of a cell of one or three numbers.
#[inline]
pub(super) fn color(cell: &[f32]) -> Spectrum {
    match *cell {
        [r, g, b] => Spectrum::new(r, g, b),
        _ => Spectrum::splat(cell[0]),
    }
}
