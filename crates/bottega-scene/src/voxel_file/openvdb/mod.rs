//! OpenVDB files of version 222 and later (OpenVDB 3, 2014).
//!
//! Source: the file format of OpenVDB as its library reads it; Museth 2013, *VDB: High-Resolution Sparse Volumes with
//! Dynamic Topology*.

mod header;
mod transform;
mod tree;

use self::header::{Descriptor, Header};
pub(super) use self::header::{list, recognizes};
use super::cursor::ByteCursor;
use super::error::VoxelError;
use super::voxels::{GridClass, Store, VoxelGrid};

/// Reads the first grid of a name; `None`: there is none of a kind that can be read.
pub(super) fn read(bytes: &[u8], store: &Store<'_>) -> Result<Option<VoxelGrid>, VoxelError> {
    let header = Header::read(bytes)?;
    let has_name = |grid: &&Descriptor| grid.name() == store.name && grid.layout.is_some();
    let Some(grid) = header.grids.iter().find(has_name) else { return Ok(None) };
    let Some(layout) = grid.layout else { return Ok(None) };
    let mut cursor = ByteCursor::new(bytes, grid.start);
    let mut compression = cursor.u32("the compression of a grid")?;
    let class = header::class(&mut cursor)?;
    let file_from_index = transform::read(&mut cursor, store.name)?;
    let (mut topology, mut buffers) = (cursor, grid.buffers);
    // An instance shares the tree of another grid.
    if !grid.parent.is_empty() {
        let Some(parent) =
            header.grids.iter().find(|other| other.unique_name == grid.parent && other.parent.is_empty())
        else {
            return Ok(None);
        };
        topology = ByteCursor::new(bytes, parent.start);
        compression = topology.u32("the compression of a grid")?;
        header::class(&mut topology)?;
        transform::read(&mut topology, store.name)?;
        buffers = parent.buffers;
    }
    let empty = VoxelGrid {
        class: if class == "level set" { GridClass::LevelSet } else { GridClass::Other },
        channels: layout.channels(),
        background: glam::Vec3::ZERO,
        file_from_index,
        origins: Vec::new(),
        values: Vec::new(),
        tiles: Vec::new(),
    };
    tree::read(topology, ByteCursor::new(bytes, buffers), layout, compression, empty, store).map(Some)
}
