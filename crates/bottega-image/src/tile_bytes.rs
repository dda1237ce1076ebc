//! Tiles as bytes, for a journal.

use crate::{Aov, AovSet, Layout, Rect, Tile};

/// Bytes that are no tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TileBytesError {
    /// Fewer bytes than a header, or more or fewer than the header announces.
    #[error("a tile of {expected} bytes is expected, found {found}")]
    Length {
        /// Bytes of such a tile; of the header where that is not there.
        expected: u64,
        /// Bytes given.
        found: u64,
    },
    /// They do not begin as a tile does.
    #[error("no tile, or one of another version of the program")]
    Magic,
    /// The rectangle has a negative side.
    #[error("the tile has a negative side")]
    Rect,
    /// AOVs that this version does not know.
    #[error("the tile has unknown AOVs (bits {0:#x})")]
    Layout(u32),
    /// The bytes changed after they were written.
    #[error("the tile was damaged after it was written: its checksum differs")]
    Checksum,
}

/// "Bottega tile", version 1.
const MAGIC: [u8; 8] = *b"BTGTILE\x01";
/// Magic, four corners, AOVs, checksum.
const HEADER_BYTES: usize = 8 + 4 * 4 + 4 + 8;

impl Tile {
    /// The tile as bytes, little endian: a header with rectangle and layout, a checksum, the sums.
    pub fn to_bytes(&self) -> Vec<u8> {
        let rect = self.rect();
        let mut bytes = Vec::with_capacity(HEADER_BYTES + 4 * self.sums().len());
        bytes.extend(MAGIC);
        for corner in [rect.x0, rect.y0, rect.x1, rect.y1] {
            bytes.extend(corner.to_le_bytes());
        }
        bytes.extend(u32::from(self.layout().aovs().bits()).to_le_bytes());
        let checksum = checksum(rect, self.layout(), self.sums());
        bytes.extend(checksum.to_le_bytes());
        bytes.extend(self.sums().iter().flat_map(|sum| sum.to_le_bytes()));
        bytes
    }

    /// The tile that [`to_bytes`](Self::to_bytes) wrote, bit for bit. Allocates no more than `bytes` holds.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TileBytesError> {
        let found = bytes.len() as u64;
        let too_short = TileBytesError::Length { expected: HEADER_BYTES as u64, found };
        let (header, sums) = bytes.split_at_checked(HEADER_BYTES).ok_or(too_short)?;
        if header[..8] != MAGIC {
            return Err(TileBytesError::Magic);
        }
        let number = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| header[at + i]));
        let (x0, y0, x1, y1) = (number(8), number(12), number(16), number(20));
        if x0 > x1 || y0 > y1 {
            return Err(TileBytesError::Rect);
        }
        let rect = Rect::new(x0, y0, x1, y1);
        let bits = number(24);
        let aovs = u8::try_from(bits).ok().and_then(AovSet::from_bits).ok_or(TileBytesError::Layout(bits))?;
        let layout = Layout::new(aovs);

        let expected =
            rect.area().checked_mul(4 * layout.stride() as u64).map(|n| n.saturating_add(HEADER_BYTES as u64));
        if expected != Some(found) {
            return Err(TileBytesError::Length { expected: expected.unwrap_or(u64::MAX), found });
        }
        let mut tile = Self::new(rect, layout);
        for (sum, bytes) in tile.sums_mut().iter_mut().zip(sums.as_chunks().0) {
            *sum = f32::from_le_bytes(*bytes);
        }
        let written = u64::from_le_bytes(std::array::from_fn(|i| header[28 + i]));
        if checksum(rect, layout, tile.sums()) == written { Ok(tile) } else { Err(TileBytesError::Checksum) }
    }
}

/// FNV-1a over words of 32 bits: against torn and damaged records, not against intent.
fn checksum(rect: Rect, layout: Layout, sums: &[f32]) -> u64 {
    let header = [rect.x0, rect.y0, rect.x1, rect.y1, u32::from(layout.aovs().bits())];
    let words = header.into_iter().chain(sums.iter().map(|sum| sum.to_bits()));
    words.fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| (hash ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3))
}

// The five AOVs fit the byte that `AovSet::bits` gives.
const _: () = assert!(Aov::ALL.len() <= 8);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tiles() -> impl Strategy<Value = Tile> {
        (0u32..9, 0u32..9, 0u32..5, 0u32..5, 0u8..32, any::<u32>()).prop_map(|(x, y, width, height, bits, seed)| {
            let layout = Layout::new(AovSet::from_bits(bits).unwrap());
            let mut tile = Tile::new(Rect::new(x, y, x + width, y + height), layout);
            for (i, sum) in tile.sums_mut().iter_mut().enumerate() {
                *sum = f32::from_bits(seed.wrapping_mul(2_654_435_761).wrapping_add(i as u32 * 97_003));
            }
            tile
        })
    }

    fn bits(tile: &Tile) -> Vec<u32> {
        tile.sums().iter().map(|sum| sum.to_bits()).collect()
    }

    proptest! {
        #[test]
        fn reading_undoes_writing(tile in tiles()) {
            let read = Tile::from_bytes(&tile.to_bytes()).unwrap();
            prop_assert_eq!((read.rect(), read.layout()), (tile.rect(), tile.layout()));
            prop_assert_eq!(bits(&read), bits(&tile));
        }

        #[test]
        fn cut_lengthened_or_changed_bytes_are_refused(tile in tiles(), at in any::<prop::sample::Index>(), flip in 1u8..) {
            let bytes = tile.to_bytes();
            prop_assert!(Tile::from_bytes(&bytes[..at.index(bytes.len())]).is_err());
            let longer: Vec<u8> = bytes.iter().copied().chain([0]).collect();
            prop_assert!(Tile::from_bytes(&longer).is_err());
            let mut changed = bytes;
            let at = at.index(changed.len());
            changed[at] ^= flip;
            prop_assert!(Tile::from_bytes(&changed).is_err(), "byte {} changed", at);
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let mut tile = MAGIC.to_vec();
            tile.extend(&bytes);
            let _ = Tile::from_bytes(&tile);
            prop_assert!(Tile::from_bytes(&bytes).is_err());
        }
    }

    #[test]
    fn a_header_that_announces_a_huge_tile_allocates_nothing() {
        let mut bytes = Tile::new(Rect::of_size(1, 1), Layout::new(AovSet::NONE)).to_bytes();
        bytes[16..24].fill(0xff);
        assert!(matches!(Tile::from_bytes(&bytes), Err(TileBytesError::Length { .. })));
    }
}
