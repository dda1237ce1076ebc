//! Sizes and places within a NanoVDB grid, by the kind of its values.

use glam::Vec3;

use super::super::cursor::ByteCursor;
use super::super::error::VoxelError;
use super::super::nodes::NodeLevel;
use crate::grid::bricks::BRICK_CELLS;

/// Bytes of an entry in the root's table.
pub(super) const ROOT_TILE_BYTES: usize = 32;
/// Nodes and values begin at multiples of this.
const ALIGNMENT: usize = 32;
/// Bytes of a leaf before its statistics: box, flags and mask.
const LEAF_HEAD_BYTES: usize = 80;
/// Place of the byte with flags in a leaf.
const LEAF_FLAGS: usize = 15;

/// The kinds of values that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    F32,
    F64,
    Vec3F32,
    /// Numbers of 4, 8 or 16 bits, which a leaf's least value and step make real; `None`: a leaf says how many.
    Quantized(Option<u32>),
}

/// The kinds of values by their numbers in the file.
const NAMES: &[&str] = &[
    "unknown", "float", "double", "int16", "int32", "int64", "vec3f", "vec3d", "mask", "half", "uint32", "bool",
    "rgba8", "fp4", "fp8", "fp16", "fpN", "vec4f", "vec4d", "index",
];

/// Returns the name of a kind of values.
pub(super) fn name(kind: u32) -> String {
    NAMES.get(kind as usize).map_or_else(|| format!("kind {kind}"), |name| (*name).to_owned())
}

/// The places of values within nodes, in bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodePlaces {
    /// Place of the background in the root.
    pub(super) root_value: usize,
    /// Size of the root without its table.
    pub(super) root_bytes: usize,
    /// Place of the value in an entry of the root's table.
    pub(super) root_tile_value: usize,
    /// Bytes of the statistics in a node: least, greatest, mean and deviation.
    statistics: usize,
    /// Size of an entry in a node's table.
    pub(super) tile_bytes: usize,
    /// Place of the values in a leaf.
    pub(super) leaf_values: usize,
}

impl NodePlaces {
    /// Returns the place of the table in a node: behind box, flags, two masks and statistics.
    pub(super) fn table(&self, level: NodeLevel) -> usize {
        (32 + 2 * level.count() / 8 + self.statistics).next_multiple_of(ALIGNMENT)
    }
}

impl Kind {
    /// Returns the kind by its number in the file; `None`: it is not read.
    pub(super) fn of(number: u32) -> Option<Self> {
        Some(match number {
            1 => Self::F32,
            2 => Self::F64,
            6 => Self::Vec3F32,
            13 => Self::Quantized(Some(4)),
            14 => Self::Quantized(Some(8)),
            15 => Self::Quantized(Some(16)),
            16 => Self::Quantized(None),
            _ => return None,
        })
    }

    /// Returns the numbers per voxel.
    pub(super) fn channels(self) -> usize {
        if self == Self::Vec3F32 { 3 } else { 1 }
    }

    pub(super) fn layout(self) -> NodePlaces {
        // Size and alignment of a value, and size of the mean and the deviation each
        let (value, alignment, mean) = match self {
            Self::F32 | Self::Quantized(_) => (4, 4, 4),
            Self::F64 => (8, 8, 8),
            Self::Vec3F32 => (12, 4, 4),
        };
        let statistics = 2 * value + 2 * mean;
        let root_value = 28_usize.next_multiple_of(alignment);
        let leaf_statistics = if matches!(self, Self::Quantized(_)) { 16 } else { statistics };
        NodePlaces {
            root_value,
            root_bytes: (root_value + value + statistics).next_multiple_of(ALIGNMENT),
            root_tile_value: 20_usize.next_multiple_of(alignment),
            statistics,
            tile_bytes: value.next_multiple_of(8),
            leaf_values: (LEAF_HEAD_BYTES + leaf_statistics).next_multiple_of(ALIGNMENT),
        }
    }

    /// Reads a value of the root or a node.
    pub(super) fn value(self, cursor: &mut ByteCursor<'_>) -> Result<Vec3, VoxelError> {
        const WHAT: &str = "a value of a grid";
        Ok(match self {
            Self::F32 | Self::Quantized(_) => Vec3::splat(cursor.f32(WHAT)?),
            Self::F64 => Vec3::splat(cursor.f64(WHAT)? as f32),
            Self::Vec3F32 => Vec3::new(cursor.f32(WHAT)?, cursor.f32(WHAT)?, cursor.f32(WHAT)?),
        })
    }

    /// Adds the values of a leaf. `values_place`: their place in the leaf.
    pub(super) fn leaf(
        self,
        bytes: &[u8],
        leaf: usize,
        values_place: usize,
        values: &mut Vec<f32>,
    ) -> Result<(), VoxelError> {
        const WHAT: &str = "a leaf of a grid";
        let mut cursor = ByteCursor::new(bytes, leaf + values_place);
        match self {
            Self::F32 | Self::Vec3F32 => {
                let stored = cursor.take(4 * BRICK_CELLS * self.channels(), WHAT)?;
                values.extend(stored.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)));
            }
            Self::F64 => {
                let stored = cursor.take(8 * BRICK_CELLS, WHAT)?;
                values.extend(stored.as_chunks::<8>().0.iter().map(|&bytes| f64::from_le_bytes(bytes) as f32));
            }
            Self::Quantized(bits) => {
                let mut head = ByteCursor::new(bytes, leaf + LEAF_FLAGS);
                let flags = head.u8(WHAT)?;
                let bits = bits.unwrap_or(1 << (flags >> 5)) as usize;
                let mut head = ByteCursor::new(bytes, leaf + LEAF_HEAD_BYTES);
                let (least, step) = (head.f32(WHAT)?, head.f32(WHAT)?);
                if bits > 16 {
                    return Err(VoxelError::Value { place: leaf, what: "the bits of a value", found: bits as i64 });
                }
                let codes = cursor.take(BRICK_CELLS * bits / 8, WHAT)?;
                values.extend((0..BRICK_CELLS).map(|index| code(codes, bits, index) as f32 * step + least));
            }
        }
        Ok(())
    }
}

/// Returns number `index` of several of 1, 2, 4, 8 or 16 bits each; those of a byte from the lowest bits.
fn code(codes: &[u8], bits: usize, index: usize) -> u16 {
    if bits == 16 {
        return u16::from_le_bytes([codes[2 * index], codes[2 * index + 1]]);
    }
    let first = bits * index;
    u16::from(codes[first / 8]) >> (first % 8) & ((1 << bits) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A leaf whose values are 2 + 0.5 · (index mod 2^bits).
    fn leaf(bits: usize, flags: u8) -> Vec<u8> {
        let mut bytes = vec![0; LEAF_HEAD_BYTES];
        bytes[LEAF_FLAGS] = flags;
        bytes.extend(2.0_f32.to_le_bytes());
        bytes.extend(0.5_f32.to_le_bytes());
        bytes.resize(96, 0);
        let per_byte = 8 / bits.min(8);
        let code = |index: usize| (index % (1 << bits)) as u16;
        if bits == 16 {
            bytes.extend((0..BRICK_CELLS).flat_map(|index| code(index).to_le_bytes()));
        } else {
            let byte = |first: usize| (0..per_byte).map(|i| code(first + i) << (bits * i)).sum::<u16>() as u8;
            bytes.extend((0..BRICK_CELLS).step_by(per_byte).map(byte));
        }
        bytes
    }

    #[test]
    fn quantized_leaves_have_least_value_and_step() {
        let by_flags = [1, 2, 4, 8, 16].into_iter().zip(0..).map(|(bits, log2)| (bits, Kind::of(16), log2 << 5));
        let by_kind = [(4, 13), (8, 14), (16, 15)].map(|(bits, number)| (bits, Kind::of(number), 0));
        for (bits, kind, flags) in by_flags.chain(by_kind) {
            let (kind, bytes, mut values) = (kind.unwrap(), leaf(bits, flags), Vec::new());
            let place = kind.layout().leaf_values;
            kind.leaf(&bytes, 0, place, &mut values).unwrap();
            let expected = |index: usize| 2.0 + 0.5 * (index % (1 << bits)) as f32;
            assert!(values.iter().enumerate().all(|(index, &value)| value == expected(index)), "{bits} bits");
            assert_eq!(values.len(), BRICK_CELLS);
            assert!(kind.leaf(&bytes[..bytes.len() - 1], 0, place, &mut values).is_err());
        }
    }
}
