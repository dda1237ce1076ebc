//! Regular grids of values in space, dense or in bricks.

pub(crate) mod bricks;
mod error;

use std::sync::Arc;

use glam::{UVec3, Vec3};
use serde::{Deserialize, Serialize};

use self::bricks::{Bricks, color};
pub use self::error::GridError;
use crate::color::Spectrum;
use crate::values::VALUE_MAX;

/// Numbers or colours in the cells of a regular grid that fills the unit cube. All values are finite and at least 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Number of cells along x, y and z.
    size: [u32; 3],
    cells: GridCells,
    blend: Blend,
}

/// The values of a grid.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum GridCells {
    /// All of them.
    Dense {
        /// Values per cell: 1, or 3 for colours.
        channels: usize,
        /// Values, those of a cell adjacent; cells along x first, then y, then z.
        values: Vec<f32>,
    },
    /// Those that are not empty; clones share them.
    Bricks(Arc<Bricks>),
}

/// The interpolation between the centres of a grid's cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Blend {
    /// None: constant within a cell.
    Nearest,
    /// Linear; constant from the outermost centres to the edge.
    Linear,
    /// Linear; 0 beyond the edge, so the outermost cells fade.
    LinearFading,
}

/// Largest number of cells along an axis.
pub(crate) const GRID_SIDE_MAX: u32 = 1 << 16;

impl Grid {
    /// Returns a grid of colours, or of numbers if there is one value per cell. Values that are negative or not finite
    /// become 0; those above [`VALUE_MAX`](VALUE_MAX) become [`VALUE_MAX`](VALUE_MAX).
    ///
    /// - `size`: cells along x, y and z, 1 to 65536 each.
    /// - `values`: one or three per cell; cells along x first, then y, then z.
    ///
    /// # Errors
    /// The size is 0 or too large, or the number of values does not match it.
    pub fn new(size: [u32; 3], mut values: Vec<f32>, blend: Blend) -> Result<Self, GridError> {
        let cells = size.iter().try_fold(1usize, |product, &side| product.checked_mul(side as usize));
        let Some(cells) = cells.filter(|&cells| cells > 0 && size.iter().all(|&side| side <= GRID_SIDE_MAX)) else {
            return Err(GridError::Size(size));
        };
        let channels = match values.len() {
            count if count == cells => 1,
            count if cells.checked_mul(3) == Some(count) => 3,
            count => return Err(GridError::Count { cells, values: count }),
        };
        mend(&mut values);
        Ok(Self { size, cells: GridCells::Dense { channels, values }, blend })
    }

    /// Makes a grid of bricks of 8 × 8 × 8 cells. Values are mended as by [`Self::new`].
    ///
    /// - `size`: cells along x, y and z, multiples of 8, at most 65536 each.
    /// - `channels`: values per cell, 1 or 3.
    /// - `table`: the index of each brick's values, or [`EMPTY_BRICK`](bricks::EMPTY_BRICK); bricks along x first.
    /// - `values`: 512 · `channels` per stored brick, those of a cell adjacent; cells along z first.
    ///
    /// # Errors
    /// The size is 0, no multiple of 8 or too large, or the table or the values do not match it.
    pub(crate) fn of_bricks(
        size: [u32; 3],
        channels: usize,
        table: Vec<u32>,
        mut values: Vec<f32>,
        blend: Blend,
    ) -> Result<Self, GridError> {
        let is_side = |&side: &u32| side > 0 && side <= GRID_SIDE_MAX && side.is_multiple_of(bricks::BRICK_SIDE);
        if !(size.iter().all(is_side) && matches!(channels, 1 | 3)) {
            return Err(GridError::Size(size));
        }
        mend(&mut values);
        Ok(Self { size, cells: GridCells::Bricks(Arc::new(Bricks::new(size, channels, table, values)?)), blend })
    }

    /// Returns a grid of one cell with the number 1.
    pub fn one() -> Self {
        Self { size: [1; 3], cells: GridCells::Dense { channels: 1, values: vec![1.0] }, blend: Blend::Nearest }
    }

    /// Returns the number of cells along x, y and z.
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Returns the grid's values.
    pub(crate) fn cells(&self) -> &GridCells {
        &self.cells
    }

    /// Returns the values per cell: 1 or 3.
    pub(crate) fn channels(&self) -> usize {
        match &self.cells {
            GridCells::Dense { channels, .. } => *channels,
            GridCells::Bricks(bricks) => bricks.channels(),
        }
    }

    /// Returns the interpolation between the grid's cells.
    pub(crate) fn blend(&self) -> Blend {
        self.blend
    }

    /// Returns the memory of the grid's values, in bytes.
    pub fn memory_bytes(&self) -> usize {
        match &self.cells {
            GridCells::Dense { values, .. } => size_of_val(&**values),
            GridCells::Bricks(bricks) => bricks.memory_bytes(),
        }
    }

    /// Returns the value at a point of the unit cube, interpolated by the grid's [`Blend`]; 0 outside. A grid of
    /// numbers has the number in all channels.
    pub fn at(&self, p: Vec3) -> Spectrum {
        if !(p.cmpge(Vec3::ZERO) & p.cmple(Vec3::ONE)).all() {
            return Spectrum::ZERO;
        }
        let size = UVec3::from_array(self.size).as_vec3();
        if self.blend == Blend::Nearest {
            let cell = (p * size).as_ivec3().to_array();
            return self.cell([0, 1, 2].map(|axis| i64::from(cell[axis]).min(i64::from(self.size[axis]) - 1)));
        }
        let place = p * size - 0.5;
        let first = place.floor();
        let t = place - first;
        let first = first.as_ivec3().to_array().map(i64::from);
        let corner =
            |index: i64| self.cell([first[0] + (index & 1), first[1] + (index >> 1 & 1), first[2] + (index >> 2)]);
        let in_one_brick = match &self.cells {
            GridCells::Bricks(bricks) => bricks.corners(first),
            GridCells::Dense { .. } => None,
        };
        let corners = in_one_brick.unwrap_or_else(|| [0, 1, 2, 3, 4, 5, 6, 7].map(corner));
        let along_x = |index: usize| corners[index].lerp(corners[index + 1], t.x);
        let along_y = |index: usize| along_x(index).lerp(along_x(index + 2), t.y);
        along_y(0).lerp(along_y(4), t.z)
    }

    /// Returns an upper bound of the values in the box between two corners within the unit cube, the least and the
    /// greatest one, per channel.
    pub fn max_within(&self, [low, high]: [Vec3; 2]) -> Spectrum {
        let size = UVec3::from_array(self.size).as_vec3();
        // Include all cells that a lookup may reach, also by rounding.
        let first = (low * size - 1.5).floor().as_ivec3().to_array();
        let last = (high * size + 0.5).ceil().as_ivec3().to_array();
        let range = |axis: usize| {
            let end = self.size[axis] as i32 - 1;
            i64::from(first[axis].clamp(0, end))..=i64::from(last[axis].clamp(0, end))
        };
        if let GridCells::Bricks(bricks) = &self.cells {
            let ends = [0, 1, 2].map(range);
            let at = |place: i64| place as usize;
            return bricks.max_within(
                [0, 1, 2].map(|axis: usize| at(*ends[axis].start())),
                [0, 1, 2].map(|axis: usize| at(*ends[axis].end())),
            );
        }
        let mut most = Spectrum::ZERO;
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    most = most.max(self.cell([x, y, z]));
                }
            }
        }
        most
    }

    /// Returns the mean of all cells, per channel.
    pub fn mean(&self) -> Spectrum {
        let sum = match &self.cells {
            GridCells::Dense { channels, values } => {
                values.chunks_exact(*channels).fold(glam::DVec3::ZERO, |sum, cell| sum + color(cell).as_dvec3())
            }
            GridCells::Bricks(bricks) => bricks.sum(),
        };
        let cells: f64 = self.size.iter().map(|&side| f64::from(side)).product();
        (sum / cells).as_vec3()
    }

    /// Returns the value of a cell, which may lie beyond the edge.
    #[inline]
    fn cell(&self, cell: [i64; 3]) -> Spectrum {
        let inside = [0, 1, 2].map(|axis| cell[axis].clamp(0, i64::from(self.size[axis]) - 1) as usize);
        if self.blend == Blend::LinearFading && [0, 1, 2].iter().any(|&axis| inside[axis] as i64 != cell[axis]) {
            return Spectrum::ZERO;
        }
        match &self.cells {
            GridCells::Dense { channels, values } => {
                let [width, height, _] = self.size.map(|side| side as usize);
                let index = ((inside[2] * height + inside[1]) * width + inside[0]) * channels;
                color(&values[index..index + channels])
            }
            GridCells::Bricks(bricks) => bricks.cell(inside),
        }
    }
}

/// Replaces values that are negative or not finite by 0, and limits the others.
fn mend(values: &mut [f32]) {
    for value in values {
        *value = if value.is_finite() { value.clamp(0.0, VALUE_MAX) } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(blend: Blend) -> Grid {
        Grid::new([2, 2, 2], (0..8).map(|i| i as f32).collect(), blend).unwrap()
    }

    #[test]
    fn values_lie_in_the_centres_of_cells() {
        for blend in [Blend::Nearest, Blend::Linear, Blend::LinearFading] {
            let grid = ramp(blend);
            for i in 0..8_u32 {
                let p = Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 0.5 + 0.25;
                assert_eq!(grid.at(p), Spectrum::splat(i as f32), "{blend:?}");
            }
        }
        assert_eq!(ramp(Blend::Linear).at(Vec3::splat(0.5)).x, 3.5);
        assert_eq!(ramp(Blend::Nearest).at(Vec3::splat(0.49)).x, 0.0);
        assert_eq!(ramp(Blend::Linear).mean(), Spectrum::splat(3.5));
    }

    #[test]
    fn edges_hold_or_fade() {
        let edge = Vec3::new(1.0, 0.75, 0.75);
        assert_eq!(ramp(Blend::Linear).at(edge).x, 7.0);
        assert_eq!(ramp(Blend::LinearFading).at(edge).x, 3.5);
        assert_eq!(ramp(Blend::Nearest).at(Vec3::ONE).x, 7.0);
        for outside in [Vec3::splat(1.001), Vec3::new(0.5, -1e-6, 0.5), Vec3::splat(f32::NAN)] {
            assert_eq!(ramp(Blend::Linear).at(outside), Spectrum::ZERO);
        }
    }

    #[test]
    fn no_value_is_above_the_bound() {
        let values: Vec<f32> = (0..3 * 5 * 4 * 7).map(|i| (i * 7919 % 101) as f32).collect();
        for blend in [Blend::Nearest, Blend::Linear, Blend::LinearFading] {
            let grid = Grid::new([5, 4, 7], Vec::clone(&values), blend).unwrap();
            for i in 0..2000_u32 {
                let part = |prime: u32| (i * prime % 2003) as f32 / 2003.0;
                let (a, b) = (Vec3::new(part(1), part(29), part(71)), Vec3::new(part(113), part(197), part(331)));
                let corners = [a.min(b), a.max(b)];
                let inside = corners[0] + (corners[1] - corners[0]) * Vec3::new(part(53), part(59), part(61));
                assert!(grid.at(inside).cmple(grid.max_within(corners)).all(), "{blend:?} {inside}");
            }
        }
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        assert!(Grid::new([2, 1, 1], vec![1.0; 3], Blend::Linear).is_err());
        assert!(Grid::new([0, 1, 1], vec![], Blend::Linear).is_err());
        assert!(Grid::new([u32::MAX; 3], vec![1.0], Blend::Linear).is_err());
        let grid = Grid::new([2, 1, 1], vec![-1.0, f32::NAN], Blend::Nearest).unwrap();
        assert_eq!(grid.mean(), Spectrum::ZERO);
    }
}
