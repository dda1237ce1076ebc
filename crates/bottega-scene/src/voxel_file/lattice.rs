//! Sparse voxels as a grid of bricks.

use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DVec3, I64Vec3, IVec3, Vec3};

use super::error::VoxelError;
use super::voxels::{GridClass, Store, Tile, VoxelGrid};
use crate::grid::bricks::{BRICK_CELLS, BRICK_SIDE, EMPTY_BRICK};
use crate::grid::{Blend, GRID_SIDE_MAX, Grid};

const SIDE: i64 = BRICK_SIDE as i64;

/// A box of bricks in index space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lattice {
    /// Lowest voxel, multiples of 8.
    low: I64Vec3,
    /// Number of bricks along each axis, above 0.
    count: I64Vec3,
}

impl VoxelGrid {
    /// Returns a stored value as factor of a coefficient: a level set fills its inside evenly and fades to its surface.
    fn factor(&self, value: f32) -> f32 {
        match self.class {
            GridClass::LevelSet if self.background.x != 0.0 => (-value / self.background.x.abs()).clamp(0.0, 1.0),
            GridClass::LevelSet => f32::from(value < 0.0),
            GridClass::Other => value,
        }
    }

    fn tile_factor(&self, tile: &Tile) -> Vec3 {
        Vec3::from_array(tile.value.to_array().map(|value| self.factor(value)))
    }

    /// Returns lowest and highest voxel with a factor that is not 0; `None`: there is none.
    fn bounds(&self) -> Option<[I64Vec3; 2]> {
        let mut bounds: Option<[I64Vec3; 2]> = None;
        let mut grow = |low: I64Vec3, high: I64Vec3| {
            let [a, b] = bounds.unwrap_or([low, high]);
            bounds = Some([a.min(low), b.max(high)]);
        };
        for tile in self.tiles.iter().filter(|tile| self.tile_factor(tile) != Vec3::ZERO) {
            let low = tile.origin.as_i64vec3();
            grow(low, low + i64::from(tile.side) - 1);
        }
        for (origin, leaf) in self.leaves() {
            let origin = origin.as_i64vec3();
            for (index, voxel) in leaf.chunks_exact(self.channels).enumerate() {
                if voxel.iter().any(|&value| self.factor(value) != 0.0) {
                    let index = index as i64;
                    let place = origin + I64Vec3::new(index >> 6, index >> 3 & 7, index & 7);
                    grow(place, place);
                }
            }
        }
        bounds
    }

    /// Returns the leaves: lowest voxel and values.
    fn leaves(&self) -> impl Iterator<Item = (IVec3, &[f32])> {
        self.origins.iter().copied().zip(self.values.chunks_exact(BRICK_CELLS * self.channels))
    }
}

impl Lattice {
    /// Returns the box around all voxels of some grids that are not 0, with the voxels beside these, to which values
    /// fade; `None`: all are 0.
    ///
    /// # Errors
    /// It is wider than a grid can be.
    pub(super) fn around(grids: &[&VoxelGrid]) -> Result<Option<Self>, VoxelError> {
        let boxes = grids.iter().filter_map(|grid| grid.bounds());
        let Some([low, high]) = boxes.reduce(|[a, b], [low, high]| [a.min(low), b.max(high)]) else { return Ok(None) };
        let low = (low - 1).map(|side| side.div_euclid(SIDE)) * SIDE;
        let count = (high + 1 - low).map(|side| side.div_euclid(SIDE) + 1);
        let side = count.max_element() * SIDE;
        if side > i64::from(GRID_SIDE_MAX) {
            return Err(VoxelError::Wide { width: side });
        }
        Ok(Some(Self { low, count }))
    }

    /// Returns the transformation from the unit cube of the grids to index space.
    pub(super) fn index_from_cube(&self) -> DAffine3 {
        // A cell of the grid is around its voxel.
        DAffine3::from_translation(self.low.as_dvec3() - 0.5) * DAffine3::from_scale((self.count * SIDE).as_dvec3())
    }

    /// Returns the grid of some voxels, all within the box, and the number of values that are not finite, which become 0.
    pub(super) fn grid(&self, voxels: &VoxelGrid, store: &Store<'_>) -> Result<(Grid, usize), VoxelError> {
        let mut bricks = self.builder(voxels.channels, store)?;
        // Tiles share a brick if their values are equal
        let mut of_value = HashMap::new();
        let mut seen = HashSet::new();
        for tile in &voxels.tiles {
            let factor = voxels.tile_factor(tile);
            if factor == Vec3::ZERO || !seen.insert((tile.origin, tile.side)) {
                continue;
            }
            let brick = match of_value.get(&factor.to_array().map(f32::to_bits)) {
                Some(&brick) => brick,
                None => {
                    let cells = factor.to_array()[..voxels.channels].repeat(BRICK_CELLS);
                    let brick = bricks.push(cells)?;
                    of_value.insert(factor.to_array().map(f32::to_bits), brick);
                    brick
                }
            };
            let first = self.brick_of(tile.origin.as_i64vec3());
            let side = i64::from(tile.side) / SIDE;
            for z in first.z..first.z + side {
                for y in first.y..first.y + side {
                    let row = bricks.index(I64Vec3::new(first.x, y, z));
                    bricks.table[row..row + side as usize].fill(brick);
                }
            }
        }
        for (origin, leaf) in voxels.leaves() {
            if leaf.iter().any(|&value| voxels.factor(value) != 0.0) {
                let brick = bricks.push(leaf.iter().map(|&value| voxels.factor(value)).collect())?;
                let index = bricks.index(self.brick_of(origin.as_i64vec3()));
                bricks.table[index] = brick;
            }
        }
        bricks.finish()
    }

    /// Returns a grid of another place, sampled at the voxels of this box.
    ///
    /// - `cube_from_index`: index space of this box to the unit cube of the other grid.
    pub(super) fn resampled(
        &self,
        other: &Grid,
        cube_from_index: &DAffine3,
        store: &Store<'_>,
    ) -> Result<(Grid, usize), VoxelError> {
        let channels = other.channels();
        let mut bricks = self.builder(channels, store)?;
        for index in 0..bricks.table.len() {
            let (width, height) = (self.count.x as usize, self.count.y as usize);
            let place =
                I64Vec3::new((index % width) as i64, (index / width % height) as i64, (index / width / height) as i64);
            let origin = (self.low + place * SIDE).as_dvec3();
            let at = |cell: usize| {
                let cell = DVec3::new((cell >> 6) as f64, (cell >> 3 & 7) as f64, (cell & 7) as f64);
                other.at(cube_from_index.transform_point3(origin + cell).as_vec3())
            };
            let cells: Vec<f32> =
                (0..BRICK_CELLS).flat_map(|cell| at(cell).to_array().into_iter().take(channels)).collect();
            if cells.iter().any(|&value| value != 0.0) {
                bricks.table[index] = bricks.push(cells)?;
            }
        }
        bricks.finish()
    }

    fn brick_of(&self, voxel: I64Vec3) -> I64Vec3 {
        (voxel - self.low) / SIDE
    }

    fn builder<'a>(&self, channels: usize, store: &'a Store<'a>) -> Result<Builder<'a>, VoxelError> {
        let bricks: i64 = self.count.element_product();
        store.take(usize::try_from(bricks).unwrap_or(usize::MAX).saturating_mul(size_of::<u32>()))?;
        let table = vec![EMPTY_BRICK; bricks as usize];
        Ok(Builder { count: self.count, channels, table, values: Vec::new(), store })
    }
}

/// The bricks of a grid that is made.
struct Builder<'a> {
    count: I64Vec3,
    channels: usize,
    table: Vec<u32>,
    values: Vec<f32>,
    store: &'a Store<'a>,
}

impl Builder<'_> {
    /// Adds the values of a brick and returns its index.
    fn push(&mut self, cells: Vec<f32>) -> Result<u32, VoxelError> {
        self.store.take(size_of_val(&*cells))?;
        let brick = self.values.len() / (BRICK_CELLS * self.channels);
        self.values.extend(cells);
        Ok(brick as u32)
    }

    fn index(&self, place: I64Vec3) -> usize {
        ((place.z * self.count.y + place.y) * self.count.x + place.x) as usize
    }

    fn finish(self) -> Result<(Grid, usize), VoxelError> {
        let not_finite = self.values.iter().filter(|value| !value.is_finite()).count();
        let size = (self.count * SIDE).to_array().map(|side| side as u32);
        let grid = Grid::of_bricks(size, self.channels, self.table, self.values, Blend::LinearFading)?;
        Ok((grid, not_finite))
    }
}
