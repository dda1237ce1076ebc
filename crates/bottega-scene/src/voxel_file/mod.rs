//! Files of sparse voxels: OpenVDB (`.vdb`) and NanoVDB (`.nvdb`).
//!
//! Both have named grids in trees of three levels: below a root, nodes of 32³ nodes of 16³ leaves of 8³ voxels. A value
//! lies at its integer coordinates in index space; between, values are interpolated linearly. Tiles, which have one
//! value for a whole node, and leaves are taken over as [`VoxelGrid`]s.

mod blosc;
mod cursor;
mod error;
mod lattice;
pub(crate) mod medium;
mod nanovdb;
mod openvdb;
pub(crate) mod scene;

use std::path::Path;

use glam::{DAffine3, IVec3, Vec3};

pub(crate) use self::error::VoxelError;
pub use self::medium::Voxels;
use crate::budget::MemoryBudget;
use crate::error::SceneError;

/// A grid that a file lists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GridEntry {
    /// The name; may be empty.
    pub(crate) name: String,
    /// The kind of values as the file's format calls it, such as `float`.
    pub(crate) kind: String,
    /// Channels that are read, 1 or 3; `None`: this kind is not read.
    pub(crate) channels: Option<usize>,
}

/// The meaning of a grid's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GridClass {
    /// Signed distances to a surface, negative inside.
    LevelSet,
    /// Densities or any other values.
    Other,
}

/// The voxels of a grid that are stored, in index space.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct VoxelGrid {
    pub(crate) class: GridClass,
    /// Values per voxel: 1 or 3.
    pub(crate) channels: usize,
    /// The value where nothing is stored; the first channel alone if there is one.
    pub(crate) background: Vec3,
    /// Index space, in which voxel (i, j, k) has its value at that point, to the space of the file.
    pub(crate) file_from_index: DAffine3,
    /// Lowest voxel of each leaf, multiples of 8.
    pub(crate) origins: Vec<IVec3>,
    /// Values of the leaves, those of a voxel adjacent; voxels along z first, then y, then x.
    pub(crate) values: Vec<f32>,
    /// Nodes of one value each.
    pub(crate) tiles: Vec<Tile>,
}

/// A cube of equal voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tile {
    /// Lowest voxel.
    pub(crate) origin: IVec3,
    /// Voxels along each side: 8, 128 or 4096.
    pub(crate) side: i32,
    pub(crate) value: Vec3,
}

/// Returns true for the first bytes of a file that [`read`] can read.
pub(crate) fn recognizes(bytes: &[u8]) -> bool {
    openvdb::recognizes(bytes) || nanovdb::recognizes(bytes)
}

/// Returns the format's name and the grids of a file.
pub(crate) fn list(bytes: &[u8]) -> Result<(&'static str, Vec<GridEntry>), VoxelError> {
    if openvdb::recognizes(bytes) {
        Ok(("OpenVDB", openvdb::list(bytes)?))
    } else {
        Ok(("NanoVDB", nanovdb::list(bytes)?))
    }
}

/// Reads the first grid of a name. `Ok(None)`: there is none of a kind that can be read.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    name: &str,
    budget: &MemoryBudget,
) -> Result<Option<VoxelGrid>, SceneError> {
    let store = Store { path, name, budget };
    let read = if openvdb::recognizes(bytes) { openvdb::read(bytes, &store) } else { nanovdb::read(bytes, &store) };
    read.map_err(|error| error.in_file(path))
}

/// Books the memory of a grid that is read.
struct Store<'a> {
    path: &'a Path,
    /// Name of the grid.
    name: &'a str,
    budget: &'a MemoryBudget,
}

impl Store<'_> {
    /// Books bytes before they are allocated.
    fn take(&self, bytes: usize) -> Result<(), VoxelError> {
        let place = format!("grid `{}`", crate::text::shortened(self.name));
        self.budget.take(self.path, &place, bytes).map_err(|error| VoxelError::Memory(Box::new(error)))
    }
}
