//! The tree of an OpenVDB grid: first the topology of its nodes, then the values of its leaves.

use glam::{IVec3, Vec3};

use super::super::blosc;
use super::super::cursor::{ByteCursor, count_set, is_set};
use super::super::error::VoxelError;
use super::super::nodes::{LOWER, NodeLevel, ROOT_CHILD_LOG2, UPPER};
use super::super::voxels::{Store, Tile, VoxelGrid};
use super::header::ValueLayout;
use crate::grid::bricks::BRICK_CELLS;

/// Bits of a grid's compression.
const ZIP: u32 = 1;
const ACTIVE_VALUES_ONLY: u32 = 2;
const BLOSC: u32 = 4;

/// Reads a tree into a grid that has no voxels yet.
///
/// - `topology`, `buffers`: places of the nodes and of the leaves' values.
pub(super) fn read(
    topology: ByteCursor<'_>,
    buffers: ByteCursor<'_>,
    layout: ValueLayout,
    compression: u32,
    grid: VoxelGrid,
    store: &Store<'_>,
) -> Result<VoxelGrid, VoxelError> {
    let mut tree = Tree { cursor: topology, layout, compression, grid, store };
    tree.root()?;
    tree.cursor = buffers;
    tree.leaves()?;
    Ok(tree.grid)
}

struct Tree<'a> {
    cursor: ByteCursor<'a>,
    layout: ValueLayout,
    /// [`ZIP`], [`ACTIVE_VALUES_ONLY`] and [`BLOSC`].
    compression: u32,
    grid: VoxelGrid,
    store: &'a Store<'a>,
}

impl<'a> Tree<'a> {
    fn root(&mut self) -> Result<(), VoxelError> {
        const WHAT: &str = "the root of a grid";
        let place = self.cursor.place();
        let buffers = self.cursor.u32(WHAT)?;
        if buffers != 1 {
            return Err(VoxelError::Value { place, what: "the number of buffers of a grid", found: buffers.into() });
        }
        self.grid.background = self.value()?;
        let (tiles, children) = (self.cursor.u32(WHAT)?, self.cursor.u32(WHAT)?);
        for _ in 0..tiles {
            let origin = self.origin(ROOT_CHILD_LOG2)?;
            let value = self.value()?;
            let _is_active = self.cursor.u8(WHAT)?;
            self.add_tile(origin, ROOT_CHILD_LOG2, value)?;
        }
        for _ in 0..children {
            let origin = self.origin(ROOT_CHILD_LOG2)?;
            self.node(UPPER, origin)?;
        }
        Ok(())
    }

    /// Reads a node above the leaves, and its children.
    fn node(&mut self, level: NodeLevel, origin: IVec3) -> Result<(), VoxelError> {
        const WHAT: &str = "a node of a grid";
        let children = self.cursor.take(level.count() / 8, WHAT)?;
        let active = self.cursor.take(level.count() / 8, WHAT)?;
        let values = self.values(level.count(), active)?;
        let channels = self.layout.channels();
        for index in (0..level.count()).filter(|&index| !is_set(children, index)) {
            let value = vector(&values[index * channels..(index + 1) * channels]);
            self.add_tile(origin + level.child_origin(index), level.child_log2, value)?;
        }
        for index in (0..level.count()).filter(|&index| is_set(children, index)) {
            let origin = origin + level.child_origin(index);
            if level.child_log2 == LOWER.child_log2 {
                // The mask is repeated before the values.
                self.cursor.take(BRICK_CELLS / 8, "a leaf of a grid")?;
                self.store.take(size_of::<IVec3>())?;
                self.grid.origins.push(origin);
            } else {
                self.node(LOWER, origin)?;
            }
        }
        Ok(())
    }

    /// Reads the values of all leaves.
    fn leaves(&mut self) -> Result<(), VoxelError> {
        for _ in 0..self.grid.origins.len() {
            let active = self.cursor.take(BRICK_CELLS / 8, "the values of a leaf")?;
            self.store.take(BRICK_CELLS * self.layout.channels() * size_of::<f32>())?;
            let values = self.values(BRICK_CELLS, active)?;
            self.grid.values.extend(values);
        }
        Ok(())
    }

    /// Reads the values of a node, of which inactive ones may be left out.
    fn values(&mut self, count: usize, active: &[u8]) -> Result<Vec<f32>, VoxelError> {
        const WHAT: &str = "the values of a node";
        let place = self.cursor.place();
        let form = self.cursor.u8(WHAT)?;
        if form > 6 {
            return Err(VoxelError::Value { place, what: "the form of inactive values", found: form.into() });
        }
        // Inactive values: the background, its negative, or up to two that follow, chosen by a mask
        let background = self.grid.background;
        let mut inactive = [if form == 0 { background } else { -background }, background];
        if matches!(form, 2 | 4 | 5) {
            inactive[0] = self.value()?;
        }
        if form == 5 {
            inactive[1] = self.value()?;
        }
        let chosen = if matches!(form, 3..=5) { Some(self.cursor.take(count / 8, WHAT)?) } else { None };
        let has_all = self.compression & ACTIVE_VALUES_ONLY == 0 || form == 6;
        let stored = self.numbers(if has_all { count } else { count_set(active) })?;
        if has_all {
            return Ok(stored);
        }
        // Put active and inactive values in their places
        let channels = self.layout.channels();
        let mut values = Vec::with_capacity(count * channels);
        let mut next = stored.chunks_exact(channels);
        for index in 0..count {
            if is_set(active, index) {
                values.extend(next.next().unwrap_or_default());
            } else {
                let which = chosen.is_some_and(|chosen| is_set(chosen, index));
                values.extend(&inactive[usize::from(which)].to_array()[..channels]);
            }
        }
        Ok(values)
    }

    /// Reads packed numbers: those of `count` voxels.
    fn numbers(&mut self, count: usize) -> Result<Vec<f32>, VoxelError> {
        const WHAT: &str = "a block of values";
        if self.layout.is_half && count == 0 {
            // No block at all; numbers in full precision have an empty one.
            return Ok(Vec::new());
        }
        let number_bytes = if self.layout.is_half { 2 } else { self.layout.number_bytes() };
        let size = count * self.layout.channels() * number_bytes;
        let place = self.cursor.place();
        let unpacked;
        let bytes = if self.compression & (ZIP | BLOSC) == 0 {
            self.cursor.take(size, WHAT)?
        } else {
            let length = self.cursor.i64(WHAT)?;
            let block = self.cursor.take(usize::try_from(length.unsigned_abs()).unwrap_or(usize::MAX), WHAT)?;
            // A negative length: the values are not packed.
            unpacked = match length {
                ..=0 => block.to_vec(),
                _ if self.compression & BLOSC != 0 => blosc::unpack(block, size, place)?,
                _ => blosc::inflate(block, size, place)?,
            };
            if unpacked.len() != size {
                return Err(VoxelError::Packed { place, what: WHAT });
            }
            &unpacked
        };
        Ok(match number_bytes {
            2 => bytes.as_chunks::<2>().0.iter().map(|&bytes| half::f16::from_le_bytes(bytes).to_f32()).collect(),
            4 => bytes.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect(),
            _ => bytes.as_chunks::<8>().0.iter().map(|&bytes| f64::from_le_bytes(bytes) as f32).collect(),
        })
    }

    /// Reads a value that is not packed.
    fn value(&mut self) -> Result<Vec3, VoxelError> {
        let bytes = self.cursor.take(self.layout.value_bytes(), "a value of a grid")?;
        let numbers: Vec<f32> = match self.layout.number_bytes() {
            4 => bytes.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect(),
            _ => bytes.as_chunks::<8>().0.iter().map(|&bytes| f64::from_le_bytes(bytes) as f32).collect(),
        };
        Ok(vector(&numbers))
    }

    /// Reads the lowest voxel of a child of the root.
    fn origin(&mut self, log2: u32) -> Result<IVec3, VoxelError> {
        let place = self.cursor.place();
        let origin = self.cursor.i32s("the place of a node")?;
        let limit = 1 << 30;
        match origin.iter().find(|side| side.abs() > limit || **side & ((1 << log2) - 1) != 0) {
            Some(&found) => Err(VoxelError::Value { place, what: "the place of a node", found: found.into() }),
            None => Ok(IVec3::from_array(origin)),
        }
    }

    /// Adds a tile, unless it has the background's value.
    fn add_tile(&mut self, origin: IVec3, log2: u32, value: Vec3) -> Result<(), VoxelError> {
        if value != self.grid.background {
            self.store.take(size_of::<Tile>())?;
            self.grid.tiles.push(Tile { origin, side: 1 << log2, value });
        }
        Ok(())
    }
}

/// Returns a value of one or three numbers.
fn vector(numbers: &[f32]) -> Vec3 {
    match *numbers {
        [x, y, z] => Vec3::new(x, y, z),
        [x, ..] => Vec3::splat(x),
        [] => Vec3::ZERO,
    }
}
