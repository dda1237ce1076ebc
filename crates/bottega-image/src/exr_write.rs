//! Writing of OpenEXR files.
//!
//! The `exr` crate describes and compresses blocks; the file layout is written here, for two reasons: the crate's
//! writer emits attributes in the order of a hash map, so equal pictures give different files, and it does not support
//! channels chosen at run time with values fetched per block, so it needs a second copy of the film.

use std::{
    collections::BTreeMap,
    io::{Cursor, Seek, SeekFrom, Write},
    path::Path,
};

use exr::{
    block::{BlockIndex, UncompressedBlock, chunk::CompressedBlock, enumerate_ordered_header_block_indices},
    meta::{
        BlockDescription, MetaData,
        attribute::{self, AttributeValue, LevelMode, TileDescription},
        header::{Header, standard_names},
    },
    prelude::{
        ChannelDescription, Compression, Error, IntegerBounds, LayerAttributes, LineOrder, SampleType, SmallVec, Text,
        Vec2, f16,
    },
};

use glam::DVec2;

use crate::{
    Aov, Chromaticities, Combine, Film, ImageError, Layout, Metadata, Picture, Rect,
    output::AtomicFile,
    parallel::{map_in_order, thread_count},
};

/// The width of floats in an EXR file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HalfOrFloat {
    /// 16 bits for color, alpha, albedo, normals, direct and indirect light and color layers; other AOVs and layers stay
    /// 32-bit. Values beyond ±65504 are clamped.
    Half,
    /// 32 bits for all channels.
    #[default]
    Float,
}

/// The compression of an EXR file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrCompression {
    /// None: largest, fastest.
    None,
    /// Run-length encoding: fast, good for flat colors.
    Rle,
    /// Deflate row by row: for programs that read parts of a picture.
    Zips,
    /// Deflate in blocks of 16 rows, or tiles; every program reads it.
    #[default]
    Zip,
    /// Wavelets: smallest lossless files of noisy pictures, slower.
    Piz,
    /// Lossy, in blocks of 32 rows: a third of the size or less, with errors that the eye does not see. Rounds channels with
    /// the last names `R`, `G` and `B`. Others stay exact: identities, normals and positions lie in parts of their own,
    /// compressed as [`Self::Zip`].
    Dwaa,
    /// As [`Self::Dwaa`] in blocks of 256 rows: a little smaller.
    Dwab,
}

impl ExrCompression {
    /// Returns `true` if colors are not kept exactly.
    pub fn is_lossy(self) -> bool {
        matches!(self, Self::Dwaa | Self::Dwab)
    }
}

/// The color space of the colors in a file: all are linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrColorSpace {
    /// The primaries of Rec. 709 and sRGB.
    #[default]
    Rec709,
    /// The primaries of Rec. 2020.
    Rec2020,
    /// The primaries of Display P3, white D65.
    P3,
    /// ACEScg: the primaries AP1 of the Academy (S-2014-004), white ACES.
    AcesCg,
    /// ACES2065-1: the primaries AP0 of the Academy (ST 2065-1), white ACES.
    Aces2065,
}

impl ExrColorSpace {
    /// Returns the chromaticities of primaries and white.
    pub fn chromaticities(self) -> Chromaticities {
        let numbers = match self {
            Self::Rec709 => return Chromaticities::REC709,
            Self::Rec2020 => [0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329],
            Self::P3 => [0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329],
            Self::AcesCg => [0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767],
            Self::Aces2065 => [0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767],
        };
        Chromaticities::from_numbers(numbers)
    }
}

/// Options of an EXR file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExrOptions {
    /// Width of the floats.
    pub depth: HalfOrFloat,
    /// `true`: tiles of 64 × 64 pixels instead of rows.
    pub tiled: bool,
    /// Compression of the blocks.
    pub compression: ExrCompression,
    /// `true`: the color and each layer are parts of their own. `false`: all channels are in one part.
    pub parts: bool,
    /// Color space of all colors: the picture, and layers of light and reflectance.
    pub color_space: ExrColorSpace,
}

/// Writes a film, with all its AOVs and layers, to `path`, atomically.
///
/// The channels are `R G B A`, those of the kept AOVs by [`Aov::full_names`], and those of the layers by their full
/// names. The data window is the film's [`rect`](Film::rect), the display window the whole picture. Metadata becomes
/// text attributes of the first part. Equal films and metadata give equal bytes.
///
/// # Errors
/// The film has no pixels, or the file cannot be written.
pub fn write_exr(
    path: impl AsRef<Path>,
    film: &Film,
    metadata: &Metadata,
    options: ExrOptions,
) -> Result<(), ImageError> {
    let rect = film.rect();
    let channels = film_channels(film.layout(), options.depth);
    let frame =
        ExrFrame { path: path.as_ref(), data_window: rect, display_size: film.picture_size(), metadata, options };
    write(&frame, channels, |offset, x, y| film.pixel(x, y)[offset])
}

/// Writes the RGB of a picture to `path`, atomically.
///
/// # Errors
/// The picture has no pixels, or the file cannot be written.
pub fn write_picture_exr(
    path: impl AsRef<Path>,
    picture: &Picture,
    metadata: &Metadata,
    options: ExrOptions,
) -> Result<(), ImageError> {
    let channels = color_channels(options.depth, ["R", "G", "B"], 0);
    let data_window = Rect::of_size(picture.width, picture.height);
    let frame = ExrFrame { path: path.as_ref(), data_window, display_size: picture.size(), metadata, options };
    let row = picture.width as usize;
    write(&frame, channels, |offset, x, y| picture.data[y as usize * row + x as usize][offset])
}

/// Encodes the RGB of a picture as a file.
pub(crate) fn picture_exr_bytes(
    picture: &Picture,
    metadata: &Metadata,
    options: ExrOptions,
) -> Result<Vec<u8>, ImageError> {
    let channels = color_channels(options.depth, ["R", "G", "B"], 0);
    let data_window = Rect::of_size(picture.width, picture.height);
    let path = Path::new("picture.exr");
    let frame = ExrFrame { path, data_window, display_size: picture.size(), metadata, options };
    let row = picture.width as usize;
    let mut bytes = Cursor::new(Vec::new());
    write_to(&mut bytes, &frame, channels, |offset, x, y| picture.data[y as usize * row + x as usize][offset])?;
    Ok(bytes.into_inner())
}

impl Film {
    /// Returns the names of the film's channels in a file, each with its offset within a pixel of [`values`](Self::values).
    pub fn channels(&self) -> Vec<(String, usize)> {
        let channels = film_channels(self.layout(), HalfOrFloat::Float);
        channels.into_iter().map(|channel| (channel.name, channel.offset)).collect()
    }
}

/// A channel of the file, and the offset of its value within a source pixel.
struct ExrChannel {
    name: String,
    sample_type: SampleType,
    offset: usize,
    /// Offset of the pixel's red, green and blue, and their weights in this channel; `None`: the value itself.
    mix: Option<(usize, [f32; 3])>,
    /// `true`: values are identities, codes or coordinates, which must be neither converted nor rounded.
    is_exact: bool,
}

/// The properties of a file that all channels share.
struct ExrFrame<'a> {
    path: &'a Path,
    data_window: Rect,
    display_size: (u32, u32),
    metadata: &'a Metadata,
    options: ExrOptions,
}

const TILE_SIDE: usize = 64;

fn film_channels(layout: &Layout, depth: HalfOrFloat) -> Vec<ExrChannel> {
    let mut channels = color_channels(depth, ["R", "G", "B"], Layout::COLOR);
    channels.extend(color_channels(depth, ["A"], Layout::ALPHA));
    for aov in layout.aovs().iter() {
        let offset = layout.offset(aov).expect("an AOV of the layout");
        let is_half = matches!(
            aov,
            Aov::Albedo
                | Aov::Normal
                | Aov::GeometricNormal
                | Aov::Direct
                | Aov::Indirect
                | Aov::CatcherLight
                | Aov::ShadowCatcher
        );
        let depth = if is_half { depth } else { HalfOrFloat::Float };
        let of_aov = named_channels(depth, aov.full_names(), offset);
        channels.extend(of_aov.map(|channel| {
            let is_exact = aov.is_matte() || aov == Aov::ShadowCatcher || is_rounded_as_luminance(&channel.name);
            ExrChannel { is_exact, ..channel }
        }));
    }
    for (offset, layer) in layout.placed_layers() {
        let is_color = layer.combine == Combine::Mean && layer.channels.iter().all(|c| "RGBA".contains(c.as_str()));
        let depth = if is_color { depth } else { HalfOrFloat::Float };
        let of_layer = named_channels(depth, layer.full_names(), offset);
        channels.extend(of_layer.map(|channel| {
            let is_exact = layer.combine == Combine::Pick || is_rounded_as_luminance(&channel.name);
            ExrChannel { is_exact, ..channel }
        }));
    }
    channels
}

/// Returns true for a channel that lossy methods take for a luminance by its last name: the second one of a normal or a
/// position, since no layer of ours has a luminance.
fn is_rounded_as_luminance(name: &str) -> bool {
    matches!(name.rsplit('.').next(), Some("Y" | "RY" | "BY"))
}

fn color_channels<const N: usize>(depth: HalfOrFloat, names: [&str; N], offset: usize) -> Vec<ExrChannel> {
    named_channels(depth, names.map(str::to_owned), offset).collect()
}

fn named_channels(
    depth: HalfOrFloat,
    names: impl IntoIterator<Item = String>,
    offset: usize,
) -> impl Iterator<Item = ExrChannel> {
    let sample_type = match depth {
        HalfOrFloat::Half => SampleType::F16,
        HalfOrFloat::Float => SampleType::F32,
    };
    names.into_iter().enumerate().map(move |(index, name)| ExrChannel {
        name,
        sample_type,
        offset: offset + index,
        mix: None,
        is_exact: false,
    })
}

/// Writes the file. `value(offset, x, y)` is called once for each value, at pixels of the data window.
fn write(
    frame: &ExrFrame<'_>,
    channels: Vec<ExrChannel>,
    value: impl Fn(usize, u32, u32) -> f32 + Sync,
) -> Result<(), ImageError> {
    let mut file = AtomicFile::create(frame.path)?;
    write_to(file.writer(), frame, channels, value)?;
    file.commit()
}

fn write_to<W: Write + Seek>(
    out: &mut W,
    frame: &ExrFrame<'_>,
    mut channels: Vec<ExrChannel>,
    value: impl Fn(usize, u32, u32) -> f32 + Sync,
) -> Result<(), ImageError> {
    let path = frame.path;
    if frame.data_window.is_empty() {
        return Err(ImageError::Empty { path: path.to_owned() });
    }
    mix_colors(&mut channels, frame.options.color_space);
    // A lossy method would destroy identities and coordinates: they get parts of their own
    let is_lossy = frame.options.compression.is_lossy();
    let by_layer = frame.options.parts || (is_lossy && channels.iter().any(|channel| channel.is_exact));
    let parts = parts(channels, by_layer);
    let is_only = parts.len() == 1;
    let headers = parts.iter().map(|part| header(frame, part, is_only)).collect::<SmallVec<[Header; 3]>>();
    let fetch = |index: BlockIndex| {
        let Rect { x0, y0, .. } = frame.data_window;
        let part = &parts[index.layer];
        UncompressedBlock::from_lines(&headers[index.layer].channels, index, |line| {
            let channel = &part.channels[line.location.channel];
            let (left, y) = (x0 + line.location.position.x() as u32, y0 + line.location.position.y() as u32);
            let row = (left..).map(|x| match channel.mix {
                None => value(channel.offset, x, y),
                Some((color, weights)) => (0..3).map(|i| weights[i] * value(color + i, x, y)).sum(),
            });
            match channel.sample_type {
                SampleType::F16 => line.value.chunks_exact_mut(2).zip(row).for_each(|(bytes, value)| {
                    bytes.copy_from_slice(&to_half(value).to_ne_bytes());
                }),
                _ => line.value.chunks_exact_mut(4).zip(row).for_each(|(bytes, value)| {
                    bytes.copy_from_slice(&value.to_ne_bytes());
                }),
            }
        })
    };
    write_file(out, &headers, frame.metadata, fetch).map_err(|error| match error {
        Error::Io(source) => ImageError::write(path, source),
        other => ImageError::NotWritable { path: path.to_owned(), reason: other.to_string() },
    })
}

/// Converts all triples of channels `R`, `G` and `B` to a color space.
fn mix_colors(channels: &mut [ExrChannel], space: ExrColorSpace) {
    let Some(rows) = space.chromaticities().rows_from_rec709() else { return };
    let layer = |name: &str, letter: &str| {
        name.strip_suffix(letter).filter(|layer| layer.is_empty() || layer.ends_with('.')).map(str::to_owned)
    };
    for first in 0..channels.len().saturating_sub(2) {
        let Some(red) = layer(&channels[first].name, "R") else { continue };
        let is_triple = ["G", "B"]
            .into_iter()
            .zip(first + 1..)
            .all(|(letter, at)| layer(&channels[at].name, letter).is_some_and(|layer| layer == red));
        if is_triple && !channels[first].is_exact {
            let color = channels[first].offset;
            rows.iter().zip(first..).for_each(|(row, at)| channels[at].mix = Some((color, *row)));
        }
    }
}

/// A part of a file: its name, and its channels sorted by name.
struct ExrPart {
    name: String,
    channels: Vec<ExrChannel>,
}

/// Divides channels into parts.
///
/// - `by_layer`: `true`: the color and each layer are parts of their own; `false`: there is one part.
fn parts(channels: Vec<ExrChannel>, by_layer: bool) -> Vec<ExrPart> {
    let mut parts: Vec<ExrPart> = Vec::new();
    for channel in channels {
        let name = match channel.name.rsplit_once('.') {
            Some((layer, _)) if by_layer => layer,
            None if by_layer && !["R", "G", "B", "A"].contains(&channel.name.as_str()) => &channel.name,
            _ => "rgba",
        };
        match parts.iter_mut().find(|part| part.name == name) {
            Some(part) => part.channels.push(channel),
            None => parts.push(ExrPart { name: name.to_owned(), channels: vec![channel] }),
        }
    }
    for part in &mut parts {
        part.channels.sort_by(|a, b| a.name.as_bytes().cmp(b.name.as_bytes()));
    }
    parts
}

/// Rounds to nearest; finite values are clamped, so a bright pixel does not become infinite.
fn to_half(value: f32) -> f16 {
    if value.is_finite() { f16::from_f32(value.clamp(-65504.0, 65504.0)) } else { f16::from_f32(value) }
}

fn header(frame: &ExrFrame<'_>, part: &ExrPart, is_only: bool) -> Header {
    let Rect { x0, y0, .. } = frame.data_window;
    let data_size = (frame.data_window.width() as usize, frame.data_window.height() as usize);
    let display_size = (frame.display_size.0 as usize, frame.display_size.1 as usize);
    let is_exact = part.channels.iter().any(|channel| channel.is_exact);
    let compression = match frame.options.compression {
        lossy if lossy.is_lossy() && is_exact => Compression::ZIP16,
        ExrCompression::None => Compression::Uncompressed,
        ExrCompression::Rle => Compression::RLE,
        ExrCompression::Zip => Compression::ZIP16,
        ExrCompression::Zips => Compression::ZIP1,
        ExrCompression::Piz => Compression::PIZ,
        ExrCompression::Dwaa => Compression::DWAA(None),
        ExrCompression::Dwab => Compression::DWAB(None),
    };
    let blocks = if frame.options.tiled {
        BlockDescription::Tiles(TileDescription {
            tile_size: Vec2(TILE_SIDE, TILE_SIDE),
            level_mode: LevelMode::Singular,
            rounding_mode: exr::math::RoundingMode::Down,
        })
    } else {
        BlockDescription::ScanLines
    };
    let channels: SmallVec<[ChannelDescription; 5]> =
        part.channels.iter().map(|c| ChannelDescription::named(c.name.as_str(), c.sample_type)).collect();
    let attributes = if is_only { LayerAttributes::default() } else { LayerAttributes::named(part.name.as_str()) };
    let mut header = Header::new(Text::default(), data_size, channels)
        .with_encoding(compression, blocks, LineOrder::Increasing)
        .with_attributes(attributes)
        .with_position(Vec2(x0 as i32, y0 as i32))
        .with_display_window(IntegerBounds::from_dimensions(display_size));
    let space = frame.options.color_space.chromaticities();
    let place = |at: DVec2| Vec2(at.x as f32, at.y as f32);
    let [red, green, blue] = space.primaries.map(place);
    header.shared_attributes.chromaticities =
        Some(attribute::Chromaticities { red, green, blue, white: place(space.white) });
    header
}

/// Returns name and value of every attribute, sorted by name.
fn attributes(header: &Header, metadata: &Metadata) -> BTreeMap<Vec<u8>, AttributeValue> {
    let mut all: BTreeMap<_, _> = header.all_named_attributes().map(|(name, value)| (name.to_vec(), value)).collect();
    for (key, value) in metadata.iter() {
        const TEXTS: [&[u8]; 4] =
            [standard_names::SOFTWARE, standard_names::COMMENTS, standard_names::OWNER, standard_names::CAPTURE_DATE];
        let key = key.as_bytes();
        // Prefix keys that the format reserves for values of other types.
        let name = if standard_names::ALL.contains(&key) && !TEXTS.contains(&key) {
            [b"bottega.", key].concat()
        } else {
            key.to_vec()
        };
        all.insert(name, AttributeValue::Text(Text::from_slice_unchecked(value.as_bytes())));
    }
    all
}

fn write_file<W: Write + Seek>(
    out: &mut W,
    headers: &[Header],
    metadata: &Metadata,
    fetch: impl Fn(BlockIndex) -> UncompressedBlock + Sync,
) -> Result<(), Error> {
    let mut requirements = MetaData::validate(headers, true)?;
    let of_others = Metadata::new();
    let of_part = |part: usize| if part == 0 { metadata } else { &of_others };
    let attributes: Vec<_> =
        headers.iter().enumerate().map(|(part, header)| attributes(header, of_part(part))).collect();
    let channels = headers.iter().flat_map(|header| &header.channels.list);
    let has_long = channels.into_iter().any(|channel| channel.name.bytes().len() > 31);
    requirements.has_long_names = has_long || attributes.iter().flatten().any(|(name, _)| name.len() > 31);
    let has_parts = headers.len() > 1;

    exr::meta::magic_number::write(out)?;
    requirements.write(out)?;
    for (name, value) in attributes.iter().flat_map(|of_part| of_part.iter().map(Some).chain([None])).map(Option::unzip)
    {
        match (name, value) {
            (Some(name), Some(value)) => attribute::write(name, value, out)?,
            // The end of a part's attributes
            _ => out.write_all(&[0])?,
        }
    }
    if has_parts {
        out.write_all(&[0])?;
    }

    let table_position = out.stream_position()?;
    let mut offsets: Vec<Vec<u64>> = headers.iter().map(|header| vec![0u64; header.chunk_count]).collect();
    offsets.iter().try_for_each(|of_part| out.write_all(&le_bytes(of_part)))?;
    let indices: Vec<(usize, BlockIndex)> = enumerate_ordered_header_block_indices(headers).collect();
    for batch in indices.chunks(4 * thread_count()) {
        let compressed = map_in_order(batch, |&(_, index)| fetch(index).compress_to_chunk(headers));
        for (&(chunk, index), compressed) in batch.iter().zip(compressed) {
            offsets[index.layer][chunk] = out.stream_position()?;
            if has_parts {
                out.write_all(&(index.layer as i32).to_le_bytes())?;
            }
            write_chunk(out, &compressed?.compressed_block)?;
        }
    }
    out.seek(SeekFrom::Start(table_position))?;
    offsets.iter().try_for_each(|of_part| out.write_all(&le_bytes(of_part)))?;
    out.flush()?;
    Ok(())
}

/// Writes one block with its position, as in OpenEXR's "Technical Introduction", *Scan lines* and *Tiles*.
fn write_chunk(out: &mut impl Write, block: &CompressedBlock) -> Result<(), Error> {
    let (place, pixels): (Vec<i32>, &[u8]) = match block {
        CompressedBlock::ScanLine(lines) => (vec![lines.y_coordinate], &lines.compressed_pixels_le),
        CompressedBlock::Tile(tile) => {
            let (at, level) = (tile.coordinates.tile_index, tile.coordinates.level_index);
            let place = [at.x(), at.y(), level.x(), level.y()];
            (place.map(|index| index as i32).to_vec(), &tile.compressed_pixels_le)
        }
        CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => {
            return Err(Error::NotSupported("deep data".into()));
        }
    };
    for number in place {
        out.write_all(&number.to_le_bytes())?;
    }
    out.write_all(&(pixels.len() as i32).to_le_bytes())?;
    out.write_all(pixels)?;
    Ok(())
}

fn le_bytes(numbers: &[u64]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}
