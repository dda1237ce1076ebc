//! Errors of reading voxel files.

use std::path::Path;

use crate::error::SceneError;
use crate::grid::{GRID_SIDE_MAX, GridError};

/// An error of reading a file of voxels. Places are bytes from its begin, or of an unpacked grid.
#[derive(Debug, thiserror::Error)]
pub(crate) enum VoxelError {
    #[error("it ends at byte {place}, within {what}")]
    End { place: usize, what: &'static str },
    #[error("{what} at byte {place} is {found}")]
    Value { place: usize, what: &'static str, found: i64 },
    #[error("{what} at byte {place} cannot be unpacked")]
    Packed { place: usize, what: &'static str },
    #[error("it has version {found}, and {known} can be read: write it with a newer program")]
    Version { found: u32, known: &'static str },
    #[error(
        "its values are packed by {codec}, which is not supported: write it with ZIP, Blosc's LZ4 or without compression"
    )]
    Codec { codec: String },
    #[error("the transformation `{map}` of grid `{grid}` is not supported: write it with an affine one")]
    Transform { map: String, grid: String },
    #[error("its voxels reach over {width} along an axis, and {GRID_SIDE_MAX} can be read: cut it")]
    Wide { width: i64 },
    #[error("its nodes name more bytes than the {bytes} that the grid has")]
    Nodes { bytes: usize },
    #[error(transparent)]
    Grid(#[from] GridError),
    #[error(transparent)]
    Memory(Box<SceneError>),
}

impl VoxelError {
    /// Converts to the error for the user.
    pub(crate) fn in_file(self, path: &Path) -> SceneError {
        match self {
            Self::Memory(error) => *error,
            Self::Version { .. } | Self::Codec { .. } | Self::Transform { .. } | Self::Wide { .. } => {
                SceneError::Invalid { path: path.into(), place: String::new(), problem: self.to_string() }
            }
            _ => SceneError::Damaged { path: path.into(), problem: self.to_string() },
        }
    }
}
