//! The header of an OpenVDB file, and the descriptors of its grids.

use super::super::cursor::ByteCursor;
use super::super::error::VoxelError;
use super::super::voxels::GridEntry;

/// The first bytes: `BDV ` as a number of 8 bytes.
const MAGIC: &[u8] = &[0x20, 0x42, 0x44, 0x56, 0, 0, 0, 0];
/// The first version whose nodes are packed with masks.
const VERSION_MIN: u32 = 222;
/// Bytes of the unique identifier in the header.
const UUID_BYTES: usize = 36;
/// Separates a grid's name from a number that makes it unique.
const NAME_SEPARATOR: char = '\x1e';

/// The layout of a value in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ValueLayout {
    /// Values per voxel are three numbers instead of one.
    is_vector: bool,
    /// Numbers of 8 bytes instead of 4.
    is_double: bool,
    /// Values of nodes are stored in half precision.
    pub(super) is_half: bool,
}

impl ValueLayout {
    /// Returns the layout of a tree by the name of its type; `None`: it is not read.
    fn of(tree: &str) -> Option<Self> {
        let (tree, is_half) = match tree.strip_suffix("_HalfFloat") {
            Some(tree) => (tree, true),
            None => (tree, false),
        };
        let (is_vector, is_double) = match tree {
            "Tree_float_5_4_3" => (false, false),
            "Tree_double_5_4_3" => (false, true),
            "Tree_vec3s_5_4_3" => (true, false),
            "Tree_vec3d_5_4_3" => (true, true),
            _ => return None,
        };
        Some(Self { is_vector, is_double, is_half })
    }

    /// Returns the numbers per voxel.
    pub(super) fn channels(self) -> usize {
        if self.is_vector { 3 } else { 1 }
    }

    /// Returns the bytes of a whole value.
    pub(super) fn value_bytes(self) -> usize {
        self.channels() * self.number_bytes()
    }

    /// Returns the bytes of a whole number.
    pub(super) fn number_bytes(self) -> usize {
        if self.is_double { 8 } else { 4 }
    }
}

/// The place of a grid in the file.
#[derive(Clone, Debug)]
pub(super) struct Descriptor {
    pub(super) unique_name: String,
    /// Name of the tree's type, such as `Tree_float_5_4_3`.
    tree: String,
    /// `None`: not read.
    pub(super) layout: Option<ValueLayout>,
    /// Unique name of the grid whose tree it shares; empty: it has its own.
    pub(super) parent: String,
    /// Place of its compression, metadata, transformation and topology.
    pub(super) start: usize,
    /// Place of its leaves' values.
    pub(super) buffers: usize,
}

impl Descriptor {
    /// Returns the name that users see.
    pub(super) fn name(&self) -> &str {
        self.unique_name.split(NAME_SEPARATOR).next().unwrap_or_default()
    }
}

/// The header of a file.
pub(super) struct Header {
    pub(super) grids: Vec<Descriptor>,
}

impl Header {
    /// Reads the header and the descriptors.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, VoxelError> {
        const WHAT: &str = "the header";
        let mut cursor = ByteCursor::new(bytes, MAGIC.len());
        let version = cursor.u32(WHAT)?;
        if version < VERSION_MIN {
            return Err(VoxelError::Version { found: version, known: "222 or later (OpenVDB 3)" });
        }
        let _library = [cursor.u32(WHAT)?, cursor.u32(WHAT)?];
        let place = cursor.place();
        if cursor.u8(WHAT)? == 0 {
            return Err(VoxelError::Value { place, what: "the note that grids can be found by place", found: 0 });
        }
        cursor.take(UUID_BYTES, WHAT)?;
        skip_metadata(&mut cursor, |_, _| ())?;
        let count = cursor.u32("the number of grids")?;
        let mut grids = Vec::new();
        for _ in 0..count {
            grids.push(descriptor(&mut cursor)?);
        }
        Ok(Self { grids })
    }
}

fn descriptor(cursor: &mut ByteCursor<'_>) -> Result<Descriptor, VoxelError> {
    const WHAT: &str = "the list of grids";
    let (unique_name, tree, parent) = (cursor.text(WHAT)?, cursor.text(WHAT)?, cursor.text(WHAT)?);
    let place = cursor.place();
    let [start, buffers, end] = [cursor.i64(WHAT)?, cursor.i64(WHAT)?, cursor.i64(WHAT)?];
    let at = |found: i64| {
        usize::try_from(found).map_err(|_| VoxelError::Value { place, what: "the place of a grid", found })
    };
    let descriptor = Descriptor {
        layout: ValueLayout::of(&tree),
        unique_name,
        tree,
        parent,
        start: at(start)?,
        buffers: at(buffers)?,
    };
    // The next descriptor follows behind the grid.
    *cursor =
        cursor.moved_forward(at(end)?).ok_or(VoxelError::Value { place, what: "the end of a grid", found: end })?;
    Ok(descriptor)
}

/// Returns the `class` in a grid's metadata; may be empty.
pub(super) fn class(cursor: &mut ByteCursor<'_>) -> Result<String, VoxelError> {
    let mut class = String::new();
    skip_metadata(cursor, |name, value| {
        if name == "class" {
            class = String::from_utf8_lossy(value).into_owned();
        }
    })?;
    Ok(class)
}

fn skip_metadata(cursor: &mut ByteCursor<'_>, mut see: impl FnMut(&str, &[u8])) -> Result<(), VoxelError> {
    const WHAT: &str = "the metadata";
    for _ in 0..cursor.u32(WHAT)? {
        let name = cursor.text(WHAT)?;
        let _kind = cursor.text(WHAT)?;
        let length = cursor.u32(WHAT)?;
        see(&name, cursor.take(length as usize, WHAT)?);
    }
    Ok(())
}

/// Returns true for the first bytes of an OpenVDB file.
pub(crate) fn recognizes(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Lists the grids of a file.
pub(crate) fn list(bytes: &[u8]) -> Result<Vec<GridEntry>, VoxelError> {
    let entry = |grid: Descriptor| GridEntry {
        name: grid.name().into(),
        channels: grid.layout.map(ValueLayout::channels),
        kind: grid.tree.trim_start_matches("Tree_").replace("_5_4_3", ""),
    };
    Ok(Header::read(bytes)?.grids.into_iter().map(entry).collect())
}
