//! Tiles: the version, a record of rectangle and layout, then the raw sums, little endian.

use bottega_agents::{BlobId, codec::WIRE_VERSION};
use bottega_image::{AovSet, CHANNEL_NAME_BYTES_MAX, CHANNELS_MAX, Combine, LAYERS_MAX, Layer, Layout, Rect, Tile};
use serde::{Deserialize, Serialize};

use super::{
    error::WireError,
    layout,
    values::{RectRecord, bounded, rect, rect_record},
};

/// Returns the digest of a tile: over its rectangle, its layout and the bits of its sums.
pub fn digest(tile: &Tile) -> BlobId {
    let mut hasher = blake3::Hasher::new();
    let mut head = Vec::new();
    put_head(tile, &mut head);
    hasher.update(&head);
    let mut bytes = [0; 4 << 10];
    for sums in tile.sums().chunks(bytes.len() / 4) {
        for (to, sum) in bytes.chunks_exact_mut(4).zip(sums) {
            to.copy_from_slice(&sum.to_le_bytes());
        }
        hasher.update(&bytes[..4 * sums.len()]);
    }
    BlobId(*hasher.finalize().as_bytes())
}

/// Appends a tile.
pub(crate) fn put_tile(tile: &Tile, bytes: &mut Vec<u8>) {
    put_head(tile, bytes);
    bytes.extend(tile.sums().iter().flat_map(|sum| sum.to_le_bytes()));
}

fn put_head(tile: &Tile, bytes: &mut Vec<u8>) {
    bytes.push(WIRE_VERSION);
    layout::put(&TileHead::from(tile), bytes);
}

/// Reads a tile that fills `bytes` completely.
pub(crate) fn read_tile(bytes: &[u8]) -> Result<Tile, WireError> {
    let (&version, bytes) = bytes.split_first().ok_or(WireError::Empty)?;
    if version != WIRE_VERSION {
        return Err(WireError::Version { found: version });
    }
    let (head, sums) = layout::take::<TileHead<'_>>("the head of a tile", bytes)?;
    let (rect, layout) = head.read()?;
    let needed = rect.area().saturating_mul(4 * layout.stride() as u64);
    // Check the length before allocating
    if sums.len() as u64 != needed {
        return Err(WireError::Sums { found: sums.len(), needed });
    }
    let mut tile = Tile::new(rect, layout);
    for (sum, bytes) in tile.sums_mut().iter_mut().zip(sums.as_chunks().0) {
        *sum = f32::from_le_bytes(*bytes);
    }
    Ok(tile)
}

#[derive(Serialize, Deserialize)]
struct TileHead<'a> {
    rect: RectRecord,
    /// One bit per AOV.
    aovs: u32,
    #[serde(borrow)]
    layers: Vec<LayerRecord<'a>>,
}

#[derive(Serialize, Deserialize)]
struct LayerRecord<'a> {
    name: &'a str,
    channels: Vec<&'a str>,
    #[serde(with = "CombineRecord")]
    combine: Combine,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Combine")]
enum CombineRecord {
    Mean,
    Pick,
}

impl<'a> From<&'a Tile> for TileHead<'a> {
    fn from(tile: &'a Tile) -> Self {
        let layer = |layer: &'a Layer| LayerRecord {
            name: &layer.name,
            channels: layer.channels.iter().map(String::as_str).collect(),
            combine: layer.combine,
        };
        let layout = tile.layout();
        let layers = layout.layers().iter().map(layer).collect();
        Self { rect: rect_record(&tile.rect()), aovs: layout.aovs().bits(), layers }
    }
}

impl TileHead<'_> {
    fn read(self) -> Result<(Rect, Layout), WireError> {
        let aovs = AovSet::from_bits(self.aovs).ok_or(WireError::Aovs { bits: self.aovs })?;
        bounded("the list of layers", self.layers.len(), LAYERS_MAX)?;
        let channel_count = self.layers.iter().map(|layer| layer.channels.len()).sum();
        bounded("the list of channels", channel_count, CHANNELS_MAX)?;
        let name = |name: &str| {
            bounded("the name of a layer or channel", name.len(), CHANNEL_NAME_BYTES_MAX).map(|()| name.to_owned())
        };
        let layer = |record: LayerRecord<'_>| {
            let channels = record.channels.into_iter().map(name).collect::<Result<_, _>>()?;
            Ok::<_, WireError>(Layer { name: name(record.name)?, channels, combine: record.combine })
        };
        let layers = self.layers.into_iter().map(layer).collect::<Result<_, _>>()?;
        Ok((rect(self.rect)?, Layout::with_layers(aovs, layers)?))
    }
}
