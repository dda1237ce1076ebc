//! The voxels of a grid as a file stores them.

use std::path::Path;

use glam::{DAffine3, IVec3, Vec3};

use super::error::VoxelError;
use crate::budget::MemoryBudget;
use crate::text::shortened;

/// A grid that a file lists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct GridEntry {
    /// The name; may be empty.
    pub(super) name: String,
    /// The kind of values as the file's format calls it, such as `float`.
    pub(super) kind: String,
    /// Channels that are read, 1 or 3; `None`: this kind is not read.
    pub(super) channels: Option<usize>,
}

/// The meaning of a grid's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GridClass {
    /// Signed distances to a surface, negative inside.
    LevelSet,
    /// Densities or any other values.
    Other,
}

/// The voxels of a grid that are stored, in index space.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct VoxelGrid {
    pub(super) class: GridClass,
    /// Values per voxel: 1 or 3.
    pub(super) channels: usize,
    /// The value where nothing is stored; the first channel alone if there is one.
    pub(super) background: Vec3,
    /// Index space, in which voxel (i, j, k) has its value at that point, to the space of the file.
    pub(super) file_from_index: DAffine3,
    /// Lowest voxel of each leaf, multiples of 8.
    pub(super) origins: Vec<IVec3>,
    /// Values of the leaves, those of a voxel adjacent; voxels along z first, then y, then x.
    pub(super) values: Vec<f32>,
    /// Nodes of one value each.
    pub(super) tiles: Vec<Tile>,
}

/// A cube of equal voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tile {
    /// Lowest voxel.
    pub(super) origin: IVec3,
    /// Voxels along each side: 8, 128 or 4096.
    pub(super) side: i32,
    pub(super) value: Vec3,
}

/// Books the memory of a grid that is read.
pub(super) struct Store<'a> {
    pub(super) path: &'a Path,
    /// Name of the grid.
    pub(super) name: &'a str,
    pub(super) budget: &'a MemoryBudget,
}

impl Store<'_> {
    /// Books bytes before they are allocated.
    pub(super) fn take(&self, bytes: usize) -> Result<(), VoxelError> {
        let place = format!("grid `{}`", shortened(self.name));
        self.budget.take(self.path, &place, bytes).map_err(|error| VoxelError::Memory(Box::new(error)))
    }
}
