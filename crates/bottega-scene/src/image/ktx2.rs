//! KTX2, the container of compressed textures: <https://registry.khronos.org/KTX/specs/2.0/ktxspec.v2.html>.
//!
//! What textures are distributed in: both codecs of Basis Universal (KHR_texture_basisu), blocks of BC1, BC3 and BC7,
//! and plain bytes. Only the finest level is decoded, for mip levels are made of it as of any other picture.

use std::io::Read;

use ::ktx2::{ColorModel, Format, Reader, SupercompressionScheme};
use rayon::prelude::*;
use ruzstd::decoding::StreamingDecoder;

pub(super) const MAGIC: &[u8; 12] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Pixels that the transcoder can count.
const PIXELS_MAX: u64 = 1 << 30;

/// How texels are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    /// ETC1S blocks behind the codebooks of BasisLZ.
    BasisLz,
    Blocks(Block),
    /// So many bytes a texel; `bgr`: the blue one first.
    Bytes {
        channels: usize,
        bgr: bool,
    },
}

/// 4 × 4 texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Block {
    Uastc,
    Bc1,
    Bc3,
    Bc7,
}

struct Picture<'a> {
    width: u32,
    height: u32,
    layout: Layout,
    /// The finest level, still compressed by Zstandard if `zstd`.
    level: &'a [u8],
    zstd: bool,
}

/// Width, height and bytes of a texel as it is kept. An error says what is wrong.
pub(super) fn header(bytes: &[u8]) -> Result<(u32, u32, usize), String> {
    let reader = open(bytes)?;
    let picture = Picture::of(&reader)?;
    Ok((picture.width, picture.height, 4))
}

/// The texels of a picture whose header was read, `[width × height]`. An error says what is wrong.
pub(super) fn texels(bytes: &[u8]) -> Result<Vec<[u8; 4]>, String> {
    let reader = open(bytes)?;
    let picture = Picture::of(&reader)?;
    if picture.layout == Layout::BasisLz {
        return basis_lz(bytes);
    }
    let unpacked = if picture.zstd { Some(inflate(picture.level, picture.level_bytes()?)?) } else { None };
    picture.decode(unpacked.as_deref().unwrap_or(picture.level))
}

fn open(bytes: &[u8]) -> Result<Reader<&[u8]>, String> {
    Reader::new(bytes).map_err(|error| format!("its KTX2 container is damaged ({error})"))
}

impl<'a> Picture<'a> {
    fn of(reader: &'a Reader<&[u8]>) -> Result<Self, String> {
        let header = reader.header();
        let (width, height) = (header.pixel_width, header.pixel_height);
        if width == 0 || height == 0 || header.pixel_depth > 1 || header.layer_count > 1 || header.face_count > 1 {
            return Err("its KTX2 texture is not one flat picture".into());
        }
        if u64::from(width) * u64::from(height) > PIXELS_MAX {
            return Err(format!("it has {width} × {height} pixels, too many for a KTX2 texture"));
        }
        let is_basis_lz = header.supercompression_scheme == Some(SupercompressionScheme::BasisLZ);
        let zstd = match header.supercompression_scheme {
            None | Some(SupercompressionScheme::BasisLZ) => false,
            Some(SupercompressionScheme::Zstandard) => true,
            Some(other) => return Err(format!("its KTX2 data is compressed by the unsupported scheme {other:?}")),
        };
        let layout = match (header.format, reader.color_model()) {
            (None, Some(ColorModel::ETC1S)) if is_basis_lz => Layout::BasisLz,
            (None, Some(ColorModel::UASTC)) => Layout::Blocks(Block::Uastc),
            (None, model) => return Err(format!("its KTX2 texture has the unsupported colour model {model:?}")),
            (Some(format), _) => {
                layout(format).ok_or_else(|| format!("its KTX2 format {format:?} is not supported"))?
            }
        };
        let level = reader.levels().next().ok_or("its KTX2 texture has no level")?.data;
        let picture = Self { width, height, layout, level, zstd };
        if layout != Layout::BasisLz && !zstd && level.len() < picture.level_bytes()? {
            return Err(format!(
                "it announces {width} × {height} pixels, but its level has only {} bytes",
                level.len()
            ));
        }
        Ok(picture)
    }

    /// Bytes of the finest level.
    fn level_bytes(&self) -> Result<usize, String> {
        let (width, height) = (self.width as usize, self.height as usize);
        let bytes = match self.layout {
            Layout::BasisLz => Some(0),
            Layout::Blocks(block) => (width.div_ceil(4) * height.div_ceil(4)).checked_mul(block.bytes()),
            Layout::Bytes { channels, .. } => (width * height).checked_mul(channels),
        };
        bytes.ok_or_else(|| "it is too large".into())
    }

    fn decode(&self, level: &[u8]) -> Result<Vec<[u8; 4]>, String> {
        let (width, height) = (self.width as usize, self.height as usize);
        let mut texels = Vec::new();
        texels
            .try_reserve_exact(width * height)
            .map_err(|_| format!("there is no memory for {width} × {height} pixels"))?;
        match self.layout {
            Layout::BasisLz => return Err("it is not stored in blocks".into()),
            Layout::Bytes { channels, bgr } => {
                texels.extend(level.chunks_exact(channels).take(width * height).map(|texel| {
                    let alpha = texel.get(3).copied().unwrap_or(255);
                    if bgr { [texel[2], texel[1], texel[0], alpha] } else { [texel[0], texel[1], texel[2], alpha] }
                }));
            }
            Layout::Blocks(block) => {
                texels.resize(width * height, [0; 4]);
                let row_bytes = width.div_ceil(4) * block.bytes();
                let rows = texels.par_chunks_mut(4 * width).zip(level.par_chunks(row_bytes));
                rows.for_each(|(texels, blocks)| {
                    for (column, bytes) in blocks.chunks_exact(block.bytes()).enumerate() {
                        let decoded = block.decode(bytes);
                        for (row, decoded) in texels.chunks_mut(width).zip(decoded.chunks(4)) {
                            let to = &mut row[4 * column..width.min(4 * column + 4)];
                            to.copy_from_slice(&decoded[..to.len()]);
                        }
                    }
                });
            }
        }
        Ok(texels)
    }
}

fn layout(format: Format) -> Option<Layout> {
    Some(match format {
        Format::R8G8B8_UNORM | Format::R8G8B8_SRGB => Layout::Bytes { channels: 3, bgr: false },
        Format::R8G8B8A8_UNORM | Format::R8G8B8A8_SRGB => Layout::Bytes { channels: 4, bgr: false },
        Format::B8G8R8A8_UNORM | Format::B8G8R8A8_SRGB => Layout::Bytes { channels: 4, bgr: true },
        Format::BC1_RGB_UNORM_BLOCK
        | Format::BC1_RGB_SRGB_BLOCK
        | Format::BC1_RGBA_UNORM_BLOCK
        | Format::BC1_RGBA_SRGB_BLOCK => Layout::Blocks(Block::Bc1),
        Format::BC3_UNORM_BLOCK | Format::BC3_SRGB_BLOCK => Layout::Blocks(Block::Bc3),
        Format::BC7_UNORM_BLOCK | Format::BC7_SRGB_BLOCK => Layout::Blocks(Block::Bc7),
        _ => return None,
    })
}

impl Block {
    fn bytes(self) -> usize {
        if self == Self::Bc1 { 8 } else { 16 }
    }

    /// Row by row. A block that means nothing is magenta.
    fn decode(self, bytes: &[u8]) -> [[u8; 4]; 16] {
        let mut texels = [[0; 4]; 16];
        let pitch = 4 * size_of::<[u8; 4]>();
        match self {
            Self::Uastc => {
                let block = bytes.first_chunk().and_then(|bytes| basisu::uastc::unpack::unpack_uastc(bytes, false));
                texels = block.map_or([[255, 0, 255, 255]; 16], |block| block.map(|texel| texel.c));
            }
            Self::Bc1 => bcdec_rs::bc1(bytes, texels.as_flattened_mut(), pitch),
            Self::Bc3 => bcdec_rs::bc3(bytes, texels.as_flattened_mut(), pitch),
            Self::Bc7 => bcdec_rs::bc7(bytes, texels.as_flattened_mut(), pitch),
        }
        texels
    }
}

fn basis_lz(bytes: &[u8]) -> Result<Vec<[u8; 4]>, String> {
    let damaged = |error| format!("its Basis Universal data is damaged ({error:?})");
    let transcoder = basisu::Transcoder::new(bytes).map_err(damaged)?;
    let texels = transcoder.transcode(0, basisu::TargetFormat::Rgba32, basisu::DecodeFlags::NONE).map_err(damaged)?;
    Ok(texels.as_chunks().0.to_vec())
}

/// Undoes Zstandard, where `length` bytes are to come out.
fn inflate(bytes: &[u8], length: usize) -> Result<Vec<u8>, String> {
    let damaged = |error: &dyn std::fmt::Display| format!("its Zstandard data is damaged ({error})");
    let decoder = StreamingDecoder::new(bytes).map_err(|error| damaged(&error))?;
    let mut inflated = Vec::new();
    inflated.try_reserve_exact(length).map_err(|_| format!("there is no memory for {length} bytes"))?;
    decoder.take(length as u64).read_to_end(&mut inflated).map_err(|error| damaged(&error))?;
    if inflated.len() == length { Ok(inflated) } else { Err(damaged(&"it is cut off")) }
}
