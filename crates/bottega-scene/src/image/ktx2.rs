//! KTX2, the container of compressed textures: <https://registry.khronos.org/KTX/specs/2.0/ktxspec.v2.html>.
//!
//! Supported are the common formats: both codecs of Basis Universal (KHR_texture_basisu), BC1, BC3 and BC7 blocks, and
//! plain bytes. Only the finest level is decoded; mip levels are computed from it as for other pictures.

use std::io::Read;

use rayon::prelude::*;
use ruzstd::decoding::StreamingDecoder;

use super::error::PictureError;

/// The first bytes of a KTX2 file.
pub(super) const MAGIC: &[u8; 12] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Maximal number of pixels of the transcoder.
const PIXELS_MAX: u64 = 1 << 30;

/// The storage of texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ktx2Layout {
    /// ETC1S blocks with BasisLZ codebooks.
    BasisLz,
    Blocks(BlockFormat),
    /// Plain bytes, `channels` per texel; `bgr`: blue comes first.
    Bytes {
        channels: usize,
        bgr: bool,
    },
}

/// A block compression format of 4 × 4 texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BlockFormat {
    Uastc,
    Bc1,
    Bc3,
    Bc7,
}

struct Ktx2Picture<'a> {
    width: u32,
    height: u32,
    layout: Ktx2Layout,
    /// The finest level, still supercompressed.
    level: &'a [u8],
    packing: Packing,
}

/// Supercompression of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    None,
    Zstd,
    Zlib,
}

/// Returns width, height and bytes per texel in memory.
pub(super) fn header(bytes: &[u8]) -> Result<(u32, u32, usize), PictureError> {
    let picture = Ktx2Picture::of(bytes)?;
    Ok((picture.width, picture.height, 4))
}

/// Decodes the texels, `[width × height]`.
pub(super) fn texels(bytes: &[u8]) -> Result<Vec<[u8; 4]>, PictureError> {
    let picture = Ktx2Picture::of(bytes)?;
    if picture.layout == Ktx2Layout::BasisLz {
        return basis_lz(bytes);
    }
    match picture.packing {
        Packing::None => picture.decode(picture.level),
        Packing::Zstd => {
            let decoder = StreamingDecoder::new(picture.level).map_err(|error| damaged(&error))?;
            picture.decode(&unpack(decoder, picture.level_bytes()?)?)
        }
        Packing::Zlib => {
            picture.decode(&unpack(flate2::bufread::ZlibDecoder::new(picture.level), picture.level_bytes()?)?)
        }
    }
}

/// Colour models in the data format descriptor, for files without a Vulkan format.
const MODEL_ETC1S: u8 = 163;
const MODEL_UASTC: u8 = 166;
/// The supercompression scheme BasisLZ, with codebooks for all levels.
const SCHEME_BASIS_LZ: u32 = 1;

impl<'a> Ktx2Picture<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self, PictureError> {
        Self::parse(bytes).ok_or(PictureError::Ktx2CutOff)?
    }

    /// Parses the header: section 3 of the specification. `None`: it points beyond the end of the file.
    fn parse(bytes: &'a [u8]) -> Option<Result<Self, PictureError>> {
        let word = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        let long = |at: usize| Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        let (format, width, height) = (word(12)?, word(20)?, word(24)?);
        let (depth, layers, faces) = (word(28)?, word(32)?, word(36)?);
        let scheme = word(44)?;
        // The colour model is in the descriptor's first block, after the total size and the block header.
        let model = *bytes.get((word(48)? as usize).checked_add(12)?)?;
        let (start, length) = (usize::try_from(long(80)?).ok()?, usize::try_from(long(88)?).ok()?);
        let level = bytes.get(start..start.checked_add(length)?)?;

        if width == 0 || height == 0 || depth > 1 || layers > 1 || faces > 1 {
            return Some(Err(PictureError::Ktx2NotFlat));
        }
        if u64::from(width) * u64::from(height) > PIXELS_MAX {
            return Some(Err(PictureError::Ktx2TooManyPixels { width, height }));
        }
        let packing = match scheme {
            0 | SCHEME_BASIS_LZ => Packing::None,
            2 => Packing::Zstd,
            3 => Packing::Zlib,
            other => {
                return Some(Err(PictureError::Ktx2Scheme(other)));
            }
        };
        let layout = match (format, model) {
            (0, MODEL_ETC1S) if scheme == SCHEME_BASIS_LZ => Ktx2Layout::BasisLz,
            (0, MODEL_UASTC) => Ktx2Layout::Blocks(BlockFormat::Uastc),
            (0, other) => return Some(Err(PictureError::Ktx2ColorModel(other))),
            (format, _) => match layout(format) {
                Some(layout) => layout,
                None => return Some(Err(PictureError::Ktx2Format(format))),
            },
        };
        let picture = Self { width, height, layout, level, packing };
        let is_whole = packing != Packing::None || level.len() >= picture.level_bytes().ok()?;
        Some(if is_whole { Ok(picture) } else { Err(PictureError::Ktx2TooShort { width, height, bytes: length }) })
    }

    /// Returns the size of the unpacked finest level, in bytes.
    fn level_bytes(&self) -> Result<usize, PictureError> {
        let (width, height) = (self.width as usize, self.height as usize);
        let bytes = match self.layout {
            Ktx2Layout::BasisLz => Some(0),
            Ktx2Layout::Blocks(block) => (width.div_ceil(4) * height.div_ceil(4)).checked_mul(block.bytes()),
            Ktx2Layout::Bytes { channels, .. } => (width * height).checked_mul(channels),
        };
        bytes.ok_or(PictureError::Ktx2TooLarge)
    }

    fn decode(&self, level: &[u8]) -> Result<Vec<[u8; 4]>, PictureError> {
        let (width, height) = (self.width as usize, self.height as usize);
        let mut texels = Vec::new();
        let memory = texels.try_reserve_exact(width * height);
        memory.map_err(|_| PictureError::NoMemory(format!("{width} × {height} pixels")))?;
        match self.layout {
            Ktx2Layout::BasisLz => return Err(PictureError::Ktx2WithoutBlocks),
            Ktx2Layout::Bytes { channels, bgr } => {
                texels.extend(level.chunks_exact(channels).take(width * height).map(|texel| {
                    let alpha = texel.get(3).copied().unwrap_or(255);
                    if bgr { [texel[2], texel[1], texel[0], alpha] } else { [texel[0], texel[1], texel[2], alpha] }
                }));
            }
            Ktx2Layout::Blocks(block) => {
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

/// Returns the layout of a Vulkan format number.
fn layout(format: u32) -> Option<Ktx2Layout> {
    Some(match format {
        23 | 29 => Ktx2Layout::Bytes { channels: 3, bgr: false },
        37 | 43 => Ktx2Layout::Bytes { channels: 4, bgr: false },
        44 | 50 => Ktx2Layout::Bytes { channels: 4, bgr: true },
        131..=134 => Ktx2Layout::Blocks(BlockFormat::Bc1),
        137 | 138 => Ktx2Layout::Blocks(BlockFormat::Bc3),
        145 | 146 => Ktx2Layout::Blocks(BlockFormat::Bc7),
        _ => return None,
    })
}

impl BlockFormat {
    fn bytes(self) -> usize {
        if self == Self::Bc1 { 8 } else { 16 }
    }

    /// Decodes a block row by row. An invalid one is magenta.
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

fn basis_lz(bytes: &[u8]) -> Result<Vec<[u8; 4]>, PictureError> {
    let damaged = |error| PictureError::BasisUniversal(format!("{error:?}"));
    let transcoder = basisu::Transcoder::new(bytes).map_err(damaged)?;
    let texels = transcoder.transcode(0, basisu::TargetFormat::Rgba32, basisu::DecodeFlags::NONE).map_err(damaged)?;
    Ok(texels.as_chunks().0.to_vec())
}

/// Reads exactly `length` bytes from a decompressor.
fn unpack(decoder: impl Read, length: usize) -> Result<Vec<u8>, PictureError> {
    let mut unpacked = Vec::new();
    unpacked.try_reserve_exact(length).map_err(|_| PictureError::NoMemory(format!("{length} bytes")))?;
    decoder.take(length as u64).read_to_end(&mut unpacked).map_err(|error| damaged(&error))?;
    if unpacked.len() == length { Ok(unpacked) } else { Err(damaged(&"it is cut off")) }
}

fn damaged(error: &dyn std::fmt::Display) -> PictureError {
    PictureError::Ktx2Packed(error.to_string())
}
