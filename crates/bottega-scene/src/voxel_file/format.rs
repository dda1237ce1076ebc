//! The choice of the reader by the first bytes of a file.

use std::path::Path;

use super::error::VoxelError;
use super::voxels::{GridEntry, Store, VoxelGrid};
use super::{nanovdb, openvdb};
use crate::budget::MemoryBudget;
use crate::error::SceneError;

/// Returns true for the first bytes of a file that [`read`] can read.
pub(crate) fn recognizes(bytes: &[u8]) -> bool {
    openvdb::recognizes(bytes) || nanovdb::recognizes(bytes)
}

/// Returns the format's name and the grids of a file.
pub(super) fn list(bytes: &[u8]) -> Result<(&'static str, Vec<GridEntry>), VoxelError> {
    if openvdb::recognizes(bytes) {
        Ok(("OpenVDB", openvdb::list(bytes)?))
    } else {
        Ok(("NanoVDB", nanovdb::list(bytes)?))
    }
}

/// Reads the first grid of a name. `Ok(None)`: there is none of a kind that can be read.
pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    name: &str,
    budget: &MemoryBudget,
) -> Result<Option<VoxelGrid>, SceneError> {
    let store = Store { path, name, budget };
    let read = if openvdb::recognizes(bytes) { openvdb::read(bytes, &store) } else { nanovdb::read(bytes, &store) };
    read.map_err(|error| error.in_file(path))
}
