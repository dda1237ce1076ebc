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
        attribute::{self, AttributeValue, Chromaticities, LevelMode, TileDescription},
        header::{Header, standard_names},
    },
    prelude::{
        ChannelDescription, Compression, Error, IntegerBounds, LayerAttributes, LineOrder, SampleType, SmallVec, Text,
        Vec2, f16,
    },
};

use crate::{
    Aov, Combine, Film, ImageError, Layout, Metadata, Picture, Rect,
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

/// The compression of an EXR file; all methods are lossless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrCompression {
    /// None: largest, fastest.
    None,
    /// Run-length encoding: fast, good for flat colors.
    Rle,
    /// Deflate in blocks of 16 rows, or tiles; every program reads it.
    #[default]
    Zip,
    /// Wavelets: smallest for noisy pictures, slower.
    Piz,
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
}

/// Writes a film, with all its AOVs and layers, to `path`, atomically.
///
/// The channels are `R G B A`, those of the kept AOVs by [`Aov::full_names`], and those of the layers by their full names. The data window is the film's [`rect`](Film::rect), the display window the whole
/// picture. Metadata becomes text attributes. Equal films and metadata give equal bytes.
///
/// # Errors
/// The file cannot be written.
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
    write(&frame, &channels, |offset, x, y| film.pixel(x, y)[offset])
}

/// Writes the RGB of a picture to `path`, atomically.
///
/// # Errors
/// The file cannot be written.
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
    write(&frame, &channels, |offset, x, y| picture.data[y as usize * row + x as usize][offset])
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
    write_to(&mut bytes, &frame, &channels, |offset, x, y| picture.data[y as usize * row + x as usize][offset])?;
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
        let is_half = matches!(aov, Aov::Albedo | Aov::Normal | Aov::GeometricNormal | Aov::Direct | Aov::Indirect);
        let depth = if is_half { depth } else { HalfOrFloat::Float };
        channels.extend(named_channels(depth, aov.full_names(), offset));
    }
    for (offset, layer) in layout.placed_layers() {
        let is_color = layer.combine == Combine::Mean && layer.channels.iter().all(|c| "RGBA".contains(c.as_str()));
        let depth = if is_color { depth } else { HalfOrFloat::Float };
        channels.extend(named_channels(depth, layer.full_names(), offset));
    }
    channels
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
    names.into_iter().enumerate().map(move |(index, name)| ExrChannel { name, sample_type, offset: offset + index })
}

/// Writes the file. `value(offset, x, y)` is called once for each value, at pixels of the data window.
fn write(
    frame: &ExrFrame<'_>,
    channels: &[ExrChannel],
    value: impl Fn(usize, u32, u32) -> f32 + Sync,
) -> Result<(), ImageError> {
    let mut file = AtomicFile::create(frame.path)?;
    write_to(file.writer(), frame, channels, value)?;
    file.commit()
}

fn write_to<W: Write + Seek>(
    out: &mut W,
    frame: &ExrFrame<'_>,
    channels: &[ExrChannel],
    value: impl Fn(usize, u32, u32) -> f32 + Sync,
) -> Result<(), ImageError> {
    let path = frame.path;
    if frame.data_window.is_empty() {
        return Err(ImageError::Empty { path: path.to_owned() });
    }
    let mut by_name: Vec<&ExrChannel> = channels.iter().collect();
    by_name.sort_by(|a, b| a.name.as_bytes().cmp(b.name.as_bytes()));
    let header = header(frame, &by_name);
    let fetch = |index: BlockIndex| {
        let Rect { x0, y0, .. } = frame.data_window;
        UncompressedBlock::from_lines(&header.channels, index, |line| {
            let channel = by_name[line.location.channel];
            let (left, y) = (x0 + line.location.position.x() as u32, y0 + line.location.position.y() as u32);
            let row = (left..).map(|x| value(channel.offset, x, y));
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
    write_file(out, &header, frame.metadata, fetch).map_err(|error| match error {
        Error::Io(source) => ImageError::write(path, source),
        other => ImageError::NotWritable { path: path.to_owned(), reason: other.to_string() },
    })
}

/// Rounds to nearest; finite values are clamped, so a bright pixel does not become infinite.
fn to_half(value: f32) -> f16 {
    if value.is_finite() { f16::from_f32(value.clamp(-65504.0, 65504.0)) } else { f16::from_f32(value) }
}

fn header(frame: &ExrFrame<'_>, channels: &[&ExrChannel]) -> Header {
    let Rect { x0, y0, .. } = frame.data_window;
    let data_size = (frame.data_window.width() as usize, frame.data_window.height() as usize);
    let display_size = (frame.display_size.0 as usize, frame.display_size.1 as usize);
    let compression = match frame.options.compression {
        ExrCompression::None => Compression::Uncompressed,
        ExrCompression::Rle => Compression::RLE,
        ExrCompression::Zip => Compression::ZIP16,
        ExrCompression::Piz => Compression::PIZ,
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
        channels.iter().map(|c| ChannelDescription::named(c.name.as_str(), c.sample_type)).collect();
    let mut header = Header::new(Text::default(), data_size, channels)
        .with_encoding(compression, blocks, LineOrder::Increasing)
        .with_attributes(LayerAttributes::default())
        .with_position(Vec2(x0 as i32, y0 as i32))
        .with_display_window(IntegerBounds::from_dimensions(display_size));
    header.shared_attributes.chromaticities = Some(Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.3, 0.6),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.329),
    });
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
    header: &Header,
    metadata: &Metadata,
    fetch: impl Fn(BlockIndex) -> UncompressedBlock + Sync,
) -> Result<(), Error> {
    let headers = std::slice::from_ref(header);
    let mut requirements = MetaData::validate(headers, true)?;
    let attributes = attributes(header, metadata);
    let long = header.channels.list.iter().any(|channel| channel.name.bytes().len() > 31);
    requirements.has_long_names = long || attributes.keys().any(|name| name.len() > 31);

    exr::meta::magic_number::write(out)?;
    requirements.write(out)?;
    for (name, value) in &attributes {
        attribute::write(name, value, out)?;
    }
    out.write_all(&[0])?;

    let table_position = out.stream_position()?;
    let mut offsets = vec![0u64; header.chunk_count];
    out.write_all(&le_bytes(&offsets))?;
    let indices: Vec<(usize, BlockIndex)> = enumerate_ordered_header_block_indices(headers).collect();
    for batch in indices.chunks(4 * thread_count()) {
        let compressed = map_in_order(batch, |&(_, index)| fetch(index).compress_to_chunk(headers));
        for (&(index, _), chunk) in batch.iter().zip(compressed) {
            offsets[index] = out.stream_position()?;
            write_chunk(out, &chunk?.compressed_block)?;
        }
    }
    out.seek(SeekFrom::Start(table_position))?;
    out.write_all(&le_bytes(&offsets))?;
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
