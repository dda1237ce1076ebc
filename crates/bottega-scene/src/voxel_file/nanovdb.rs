//! NanoVDB files of version 32: a grid is one block of memory, whose nodes name their children by offsets.
//!
//! Source: the memory layout in the header `NanoVDB.h` of OpenVDB 10; Museth 2021, *NanoVDB: A GPU-Friendly and Portable
//! VDB Data Structure For Real-Time Rendering And Simulation*.

mod layout;

use std::borrow::Cow;

use glam::{DAffine3, DMat3, DVec3, IVec3, Vec3};

use self::layout::{Kind, NodePlaces};
use super::blosc;
use super::cursor::{ByteCursor, is_set};
use super::error::VoxelError;
use super::nodes::{LOWER, NodeLevel, ROOT_CHILD_LOG2, UPPER};
use super::voxels::{GridClass, GridEntry, Store, Tile, VoxelGrid};
use crate::grid::bricks::{BRICK_CELLS, BRICK_SIDE};

/// Versions of the format that are read: the part of the number above this bit.
const MAJOR_SHIFT: u32 = 21;
const MAJOR: u32 = 32;
/// Bytes of the name, the transformation and the rest at the begin of a grid.
const GRID_BYTES: usize = 672;
/// Bytes of the tree's header.
const TREE_BYTES: usize = 64;
/// The class of signed distances.
const LEVEL_SET: u32 = 1;
/// Greatest number of bytes of a grid for each byte of its file, by packing.
const EXPANSION_MAX: u64 = 1 << 12;

/// A grid in the file.
struct StoredGrid {
    name: String,
    kind: u32,
    /// Bytes of the unpacked grid.
    unpacked: u64,
    codec: u16,
    /// Its bytes in the file.
    place: usize,
    length: usize,
}

/// Returns true for the first bytes of a NanoVDB file.
pub(super) fn recognizes(bytes: &[u8]) -> bool {
    matches!(bytes.get(..8), Some(b"NanoVDB0" | b"NanoVDB2"))
}

/// Lists the grids of a file.
pub(super) fn list(bytes: &[u8]) -> Result<Vec<GridEntry>, VoxelError> {
    let entry = |entry: StoredGrid| GridEntry {
        name: entry.name,
        kind: layout::name(entry.kind),
        channels: Kind::of(entry.kind).map(Kind::channels),
    };
    Ok(entries(bytes)?.into_iter().map(entry).collect())
}

fn entries(bytes: &[u8]) -> Result<Vec<StoredGrid>, VoxelError> {
    const WHAT: &str = "the list of grids";
    let mut entries = Vec::new();
    let mut cursor = ByteCursor::new(bytes, 0);
    while cursor.place() < bytes.len() {
        // A segment: the descriptions of its grids, then the grids
        let place = cursor.place();
        if !recognizes(cursor.take(8, WHAT)?) {
            return Err(VoxelError::Value { place, what: "the begin of a segment", found: bytes[place].into() });
        }
        let version = cursor.u32(WHAT)?;
        if version >> MAJOR_SHIFT != MAJOR {
            return Err(VoxelError::Version { found: version >> MAJOR_SHIFT, known: "32" });
        }
        let count = cursor.u16(WHAT)?;
        let _codec = cursor.u16(WHAT)?;
        let first = entries.len();
        for _ in 0..count {
            entries.push(entry(&mut cursor)?);
        }
        for entry in &mut entries[first..] {
            entry.place = cursor.place();
            cursor.take(entry.length, "a grid")?;
        }
    }
    Ok(entries)
}

/// Reads the description of a grid.
fn entry(cursor: &mut ByteCursor<'_>) -> Result<StoredGrid, VoxelError> {
    const WHAT: &str = "the description of a grid";
    let (unpacked, length) = (cursor.u64(WHAT)?, cursor.u64(WHAT)?);
    cursor.take(16, WHAT)?;
    let kind = cursor.u32(WHAT)?;
    cursor.take(4 + 48 + 24 + 24, WHAT)?;
    let name_length = cursor.u32(WHAT)?;
    cursor.take(16 + 12, WHAT)?;
    let codec = cursor.u16(WHAT)?;
    cursor.take(6, WHAT)?;
    let name = cursor.take(name_length as usize, WHAT)?;
    let name = String::from_utf8_lossy(name).trim_end_matches('\0').to_owned();
    Ok(StoredGrid { name, kind, unpacked, codec, place: 0, length: usize::try_from(length).unwrap_or(usize::MAX) })
}

/// Reads the first grid of a name; `None`: there is none of a kind that can be read.
pub(super) fn read(bytes: &[u8], store: &Store<'_>) -> Result<Option<VoxelGrid>, VoxelError> {
    let entries = entries(bytes)?;
    let found = entries.iter().filter(|entry| entry.name == store.name);
    let Some((entry, kind)) = found.filter_map(|entry| Some((entry, Kind::of(entry.kind)?))).next() else {
        return Ok(None);
    };
    let block = unpack(&bytes[entry.place..entry.place + entry.length], entry, store)?;
    Block { bytes: &block, layout: kind.layout(), kind, store, visits: 0 }.grid().map(Some)
}

/// Returns the memory of a grid.
fn unpack<'a>(packed: &'a [u8], entry: &StoredGrid, store: &Store<'_>) -> Result<Cow<'a, [u8]>, VoxelError> {
    const WHAT: &str = "a packed grid";
    if entry.codec == 0 {
        return Ok(Cow::Borrowed(packed));
    }
    let is_plausible = entry.unpacked <= (packed.len() as u64).saturating_mul(EXPANSION_MAX);
    let size = usize::try_from(entry.unpacked).ok().filter(|_| is_plausible);
    let size = size.ok_or(VoxelError::Packed { place: entry.place, what: WHAT })?;
    store.take(size)?;
    let mut cursor = ByteCursor::new(packed, 0);
    let mut block = Vec::new();
    match entry.codec {
        1 => {
            let length = cursor.u64(WHAT)?;
            block = blosc::inflate(cursor.take(length as usize, WHAT)?, size, entry.place)?;
        }
        2 => {
            // Chunks of at most 2 GB, each behind its length; a chunk's header names its unpacked length
            while block.len() < size {
                let length = cursor.u64(WHAT)?;
                let chunk = cursor.take(length as usize, WHAT)?;
                let unpacked = ByteCursor::new(chunk, 4).u32(WHAT)? as usize;
                if unpacked == 0 || unpacked > size - block.len() {
                    return Err(VoxelError::Packed { place: entry.place, what: WHAT });
                }
                block.extend(blosc::unpack(chunk, unpacked, entry.place)?);
            }
        }
        codec => return Err(VoxelError::Codec { codec: format!("NanoVDB's codec {codec}") }),
    }
    Ok(Cow::Owned(block))
}

/// The memory of a grid.
struct Block<'a> {
    bytes: &'a [u8],
    layout: NodePlaces,
    kind: Kind,
    store: &'a Store<'a>,
    /// Bytes of the nodes that were visited.
    visits: usize,
}

impl Block<'_> {
    fn grid(&mut self) -> Result<VoxelGrid, VoxelError> {
        const WHAT: &str = "the header of a grid";
        // Map: a matrix and its inverse in single precision, then the same in double precision
        let mut cursor = ByteCursor::new(self.bytes, 296 + 88);
        let rows = cursor.f64s::<9>(WHAT)?;
        cursor.f64s::<9>(WHAT)?;
        let translation = DVec3::from_array(cursor.f64s::<3>(WHAT)?);
        let file_from_index = DAffine3 { matrix3: DMat3::from_cols_array(&rows).transpose(), translation };
        let class = ByteCursor::new(self.bytes, 632).u32(WHAT)?;
        let mut grid = VoxelGrid {
            class: if class == LEVEL_SET { GridClass::LevelSet } else { GridClass::Other },
            channels: self.kind.channels(),
            background: Vec3::ZERO,
            file_from_index,
            origins: Vec::new(),
            values: Vec::new(),
            tiles: Vec::new(),
        };
        // The tree names the places of its levels; the last is the root
        let root = ByteCursor::new(self.bytes, GRID_BYTES + 24).u64(WHAT)?;
        let root = self.offset(GRID_BYTES, root as i64, GRID_BYTES)?;
        self.root(&mut grid, root)?;
        Ok(grid)
    }

    fn root(&mut self, grid: &mut VoxelGrid, root: usize) -> Result<(), VoxelError> {
        const WHAT: &str = "the root of a grid";
        let mut cursor = ByteCursor::new(self.bytes, root + 24);
        let count = cursor.u32(WHAT)? as usize;
        grid.background = self.value(root + self.layout.root_value)?;
        for tile in 0..count {
            let place = root + self.layout.root_bytes + tile * layout::ROOT_TILE_BYTES;
            let mut cursor = ByteCursor::new(self.bytes, place);
            let (key, child) = (cursor.u64(WHAT)?, cursor.i64(WHAT)?);
            let origin = root_origin(key);
            if child == 0 {
                self.add_tile(grid, origin, ROOT_CHILD_LOG2, place + self.layout.root_tile_value)?;
            } else {
                let node = self.offset(root, child, root)?;
                self.node(grid, UPPER, node, origin)?;
            }
        }
        Ok(())
    }

    /// Reads a node above the leaves, and its children.
    fn node(&mut self, grid: &mut VoxelGrid, level: NodeLevel, node: usize, origin: IVec3) -> Result<(), VoxelError> {
        let count = level.count();
        let values = self.layout.table(level);
        self.visit(values + count * self.layout.tile_bytes)?;
        let mut cursor = ByteCursor::new(self.bytes, node + 32);
        let _active = cursor.take(count / 8, "a node of a grid")?;
        let children = cursor.take(count / 8, "a node of a grid")?;
        for index in 0..count {
            let origin = origin + level.child_origin(index);
            let place = node + values + index * self.layout.tile_bytes;
            if !is_set(children, index) {
                self.add_tile(grid, origin, level.child_log2, place)?;
                continue;
            }
            let child = ByteCursor::new(self.bytes, place).i64("a node of a grid")?;
            let child = self.offset(node, child, node)?;
            if level.child_log2 == LOWER.child_log2 {
                self.leaf(grid, child, origin)?;
            } else {
                self.node(grid, LOWER, child, origin)?;
            }
        }
        Ok(())
    }

    fn leaf(&mut self, grid: &mut VoxelGrid, leaf: usize, origin: IVec3) -> Result<(), VoxelError> {
        self.visit(self.layout.leaf_values)?;
        self.store.take(size_of::<IVec3>() + BRICK_CELLS * grid.channels * size_of::<f32>())?;
        self.kind.leaf(self.bytes, leaf, self.layout.leaf_values, &mut grid.values)?;
        grid.origins.push(origin);
        Ok(())
    }

    /// Counts the bytes of a node: together, nodes cannot take more than the grid has.
    fn visit(&mut self, bytes: usize) -> Result<(), VoxelError> {
        self.visits += bytes;
        if self.visits > self.bytes.len() {
            return Err(VoxelError::Nodes { bytes: self.bytes.len() });
        }
        Ok(())
    }

    /// Returns a place that is named by its offset from another, and lies behind `before`.
    fn offset(&self, base: usize, offset: i64, before: usize) -> Result<usize, VoxelError> {
        let target = base as i64 + offset.min(1 << 48);
        let is_inside = offset > 0 && target > before as i64 && target < self.bytes.len() as i64;
        if is_inside {
            Ok(target as usize)
        } else {
            Err(VoxelError::Value { place: base, what: "the offset of a node", found: offset })
        }
    }

    fn value(&self, place: usize) -> Result<Vec3, VoxelError> {
        let mut cursor = ByteCursor::new(self.bytes, place);
        self.kind.value(&mut cursor)
    }

    /// Adds a tile, unless it has the background's value.
    fn add_tile(&self, grid: &mut VoxelGrid, origin: IVec3, log2: u32, place: usize) -> Result<(), VoxelError> {
        let value = self.value(place)?;
        if value != grid.background {
            self.store.take(size_of::<Tile>())?;
            grid.tiles.push(Tile { origin, side: 1 << log2, value });
        }
        Ok(())
    }
}

/// Returns the lowest voxel of a root's child by its key: 21 bits each of z, y and x, from the lowest.
fn root_origin(key: u64) -> IVec3 {
    // Keys hold the upper 20 bits of 32; shifting back restores the sign.
    let part = |shift: u32| ((key >> shift) as u32) << ROOT_CHILD_LOG2;
    IVec3::new(part(42) as i32, part(21) as i32, part(0) as i32)
}

const _: () = assert!(1 << LOWER.child_log2 == BRICK_SIDE);
const _: () = assert!(TREE_BYTES < GRID_BYTES);
