//! Reading of OpenEXR files.

mod color;

use std::{
    io::{BufRead, Seek},
    ops::Range,
};

use exr::{
    block::{
        UncompressedBlock,
        chunk::{Chunk, CompressedBlock},
        reader::ChunksReader,
    },
    meta::{
        attribute::AttributeValue,
        header::{Header, standard_names},
    },
    prelude::{Compression, Error, SampleType, Vec2, f16},
};

use self::color::{Color, find_color};
use crate::{
    ImageError, Metadata, Picture,
    colorimetry::{Chromaticities, Conversion, WhitePoint},
    limits::{Packing, check_announced},
    source::{ImageFile, PictureSource, file_bytes},
};

/// Maximal size of a decompressed block, in bytes.
const MAX_BLOCK_BYTES: u64 = 1 << 30;

/// Planes of further channels, in the requested order; `None` if the file has no such channel.
pub type Planes = Vec<Option<Vec<f32>>>;

/// The channels to read beside the color.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WantedChannels<'a> {
    /// Full names of further channels.
    pub(crate) names: &'a [String],
    /// `true`: read alpha too.
    pub(crate) alpha: bool,
}

/// The contents of a file.
pub(crate) struct Read {
    /// The color, with the window and the metadata of the file.
    pub(crate) file: ImageFile,
    /// The further channels that were requested.
    pub(crate) planes: Planes,
    /// Alpha; `None` if not requested or absent.
    pub(crate) alpha: Option<Vec<f32>>,
    /// Notes for the user about choices and omissions.
    pub(crate) notes: Vec<String>,
    /// The conversion from the file's color space, which the color has passed.
    pub(crate) conversion: Conversion,
}

/// The color channels and windows of a file.
pub(crate) struct ColorHeader {
    color: Color,
    /// Data and display window.
    window: ExrWindow,
}

impl ColorHeader {
    /// Returns true if the color has alpha.
    pub(crate) fn has_alpha(&self) -> bool {
        self.color.alpha.is_some()
    }

    /// Returns the data and display window.
    pub(crate) fn window(&self) -> ExrWindow {
        self.window
    }
}

/// The data window of a file, and its position in the display window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExrWindow {
    /// Width and height of the data window, in pixels.
    pub(crate) size: (u32, u32),
    /// Upper left corner of the data window within the display window; may be negative.
    pub(crate) offset: (i32, i32),
    /// Width and height of the display window, in pixels.
    pub(crate) full_size: (u32, u32),
}

impl ExrWindow {
    fn of(header: &Header) -> Self {
        let position = header.own_attributes.layer_position;
        let display = header.shared_attributes.display_window;
        Self {
            size: (header.layer_size.0 as u32, header.layer_size.1 as u32),
            offset: (position.0.saturating_sub(display.position.0), position.1.saturating_sub(display.position.1)),
            full_size: (display.size.0 as u32, display.size.1 as u32),
        }
    }
}

/// Chooses the color channels of a file and checks its size, before anything is allocated.
pub(crate) fn describe<R: BufRead + Seek>(source: &PictureSource<'_>, mut input: R) -> Result<ColorHeader, ImageError> {
    let bytes_of_file = file_bytes(source, &mut input)?;
    let reader = exr::block::read(input, false).map_err(|error| failed(source, error))?;
    let headers = reader.headers();
    let color = choose(source, headers)?;
    headers.iter().try_for_each(|header| check_header(source, header, bytes_of_file))?;
    let window = ExrWindow::of(&headers[color.part]);
    Ok(ColorHeader { color, window })
}

/// Returns the full names of all channels.
pub(crate) fn channel_names<R: BufRead + Seek>(
    source: &PictureSource<'_>,
    input: R,
) -> Result<Vec<String>, ImageError> {
    let reader = exr::block::read(input, false).map_err(|error| failed(source, error))?;
    let of_part = |header: &Header| {
        let part = header.own_attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
        let names = header.channels.list.iter().map(|channel| channel.name.to_string());
        let is_full = |name: &String| part.is_empty() || *name == part || name.contains('.');
        let full = |name: String| if is_full(&name) { name } else { format!("{part}.{name}") };
        names.map(full).collect::<Vec<String>>()
    };
    // Channels of the first part have no layer, whatever the part's name.
    let first =
        reader.headers().first().map(|header| header.channels.list.iter().map(|it| it.name.to_string()).collect());
    let others = reader.headers().iter().skip(1).flat_map(of_part);
    Ok(first.unwrap_or_else(Vec::new).into_iter().chain(others).collect())
}

fn choose(source: &PictureSource<'_>, headers: &[Header]) -> Result<Color, ImageError> {
    find_color(headers).ok_or_else(|| ImageError::NoColor {
        path: source.path.to_owned(),
        found: headers.iter().flat_map(|h| &h.channels.list).map(|c| c.name.to_string()).collect::<Vec<_>>().join(", "),
    })
}

/// Checks the size that a part announces against the limits and the size of the file.
fn check_header(source: &PictureSource<'_>, header: &Header, file_bytes: u64) -> Result<(), ImageError> {
    let size = (header.layer_size.0 as u64, header.layer_size.1 as u64);
    source.check_size(size.0, size.1)?;
    if block_bytes(header) > MAX_BLOCK_BYTES {
        return Err(source.malformed("EXR", "a block of pixels is larger than 1 GiB"));
    }
    let pixel_bits = 8 * header.channels.bytes_per_pixel as u64;
    check_announced(size, pixel_bits, packing(header.compression), file_bytes)
        .map_err(|problem| source.malformed("EXR", problem))
}

/// Returns the greatest compression ratio of a method.
fn packing(compression: Compression) -> Packing {
    match compression {
        Compression::Uncompressed => Packing::None,
        Compression::RLE => Packing::RUNS,
        // Keeps 24 of 32 bits.
        Compression::PXR24 => Packing::Ratio(1032 * 4 / 3),
        // 32 bytes in 3 or 14; values other than half floats are stored unchanged.
        Compression::B44 | Compression::B44A => Packing::Ratio(11),
        // Of the 64 values of a block at least the first is stored, plus one word, both deflated.
        Compression::DWAA(_) | Compression::DWAB(_) => Packing::Ratio(1 << 16),
        // PIZ: runs of 255 two-byte values in about nine bits; also any future method.
        _ => Packing::DEFLATE,
    }
}

/// Reads the color of a file and the other requested channels.
pub(crate) fn read<R: BufRead + Seek>(
    source: &PictureSource<'_>,
    mut input: R,
    wanted: WantedChannels<'_>,
) -> Result<Read, ImageError> {
    let bytes_of_file = file_bytes(source, &mut input)?;
    let reader = exr::block::read(input, false).map_err(|error| failed(source, error))?;
    let headers = reader.headers().to_vec();
    let color = choose(source, &headers)?;
    headers.iter().try_for_each(|header| check_header(source, header, bytes_of_file))?;
    let header = &headers[color.part];
    let mut notes: Vec<String> = color.note.iter().cloned().collect();
    let conversion = conversion(header, &color, source.white_point, &mut notes);

    let targets = targets(&headers, &color, wanted);
    let window = ExrWindow::of(header);
    let count = header.layer_size.0 * header.layer_size.1;
    let plane = |to: ChannelTarget| targets.iter().any(|target| target.to == to).then(|| vec![0.0; count]);
    let mut canvas = ChannelCanvas {
        picture: Picture::new(window.size.0, window.size.1),
        planes: (0..wanted.names.len()).map(|index| plane(ChannelTarget::Plane(index))).collect(),
        alpha: plane(ChannelTarget::Alpha),
    };
    read_blocks(source, reader, &headers, &targets, &mut canvas)?;
    conversion.apply(&mut canvas.picture.data);
    let planes = canvas.planes;
    let ExrWindow { offset, full_size, .. } = window;
    let file = ImageFile { picture: canvas.picture, offset, full_size, metadata: metadata(header) };
    Ok(Read { file, planes, alpha: canvas.alpha, notes, conversion })
}

/// Returns the conversion from the file's color space, by its chromaticities.
fn conversion(header: &Header, color: &Color, white_point: WhitePoint, notes: &mut Vec<String>) -> Conversion {
    if color.is_xyz {
        return Conversion::from_xyz();
    }
    let is_gray = color.channels[0] == color.channels[1];
    let Some(found) = header.shared_attributes.chromaticities.filter(|_| !is_gray) else { return Conversion::NONE };
    let numbers = [found.red, found.green, found.blue, found.white].map(|at| [f64::from(at.0), f64::from(at.1)]);
    let [[rx, ry], [gx, gy], [bx, by], [wx, wy]] = numbers;
    let chromaticities = Chromaticities::from_numbers([rx, ry, gx, gy, bx, by, wx, wy]);
    chromaticities.to_rec709(white_point).unwrap_or_else(|problem| {
        notes.push(format!("{problem}, and count as those of Rec. 709"));
        Conversion::NONE
    })
}

/// Lists the channels to read. A part of another size is another picture.
fn targets(headers: &[Header], color: &Color, wanted: WantedChannels<'_>) -> Vec<Target> {
    let (part, size) = (color.part, headers[color.part].layer_size);
    let components = color.channels.iter().enumerate();
    let mut targets: Vec<Target> =
        components.map(|(i, &channel)| Target { part, channel, to: ChannelTarget::Color(i) }).collect();
    let alpha = color.alpha.filter(|_| wanted.alpha);
    targets.extend(alpha.map(|channel| Target { part, channel, to: ChannelTarget::Alpha }));
    let more = wanted.names.iter().enumerate();
    targets.extend(more.filter_map(|(i, name)| {
        let (part, channel) = find_channel(headers, color.part, name)?;
        (headers[part].layer_size == size).then_some(Target { part, channel, to: ChannelTarget::Plane(i) })
    }));
    targets
}

/// Reads all blocks with targets into the canvas, and checks that they cover it.
fn read_blocks<R: BufRead + Seek>(
    source: &PictureSource<'_>,
    reader: exr::block::reader::Reader<R>,
    headers: &[Header],
    targets: &[Target],
    canvas: &mut ChannelCanvas,
) -> Result<(), ImageError> {
    let mut covered = vec![0; headers.len()];
    let mut chunks = reader.all_chunks(false).map_err(|error| failed(source, error))?;
    while let Some(chunk) = chunks.read_next_chunk() {
        let chunk = chunk.map_err(|error| failed(source, error))?;
        let part = chunk.layer_index;
        let wanted: Vec<&Target> = targets.iter().filter(|target| target.part == part).collect();
        if wanted.is_empty() {
            continue;
        }
        if announces_too_much(&chunk, &headers[part]) {
            return Err(source.malformed("EXR", "a block of pixels announces more than it can hold"));
        }
        let block = UncompressedBlock::decompress_chunk(chunk, chunks.meta_data(), false)
            .map_err(|error| failed(source, error))?;
        if block.index.level == Vec2(0, 0) {
            covered[part] += copy_block(&block, &headers[part], &wanted, canvas)
                .ok_or_else(|| source.malformed("EXR", "a block of pixels lies outside the data window"))?;
        }
    }
    let count = canvas.picture.data.len();
    match targets.iter().find(|target| covered[target.part] != count) {
        Some(target) => Err(source.malformed("EXR", format!("{} of {count} pixels are there", covered[target.part]))),
        None => Ok(()),
    }
}

/// A channel of the file, and the destination of its values.
struct Target {
    part: usize,
    channel: usize,
    to: ChannelTarget,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum ChannelTarget {
    /// A component of the color.
    Color(usize),
    Alpha,
    /// A plane of its own.
    Plane(usize),
}

/// The destination of all channels.
struct ChannelCanvas {
    picture: Picture,
    planes: Planes,
    alpha: Option<Vec<f32>>,
}

/// Finds a channel by name: its full name, in the color's part first, or its last part within a part named like its
/// layer.
fn find_channel(headers: &[Header], first: usize, name: &str) -> Option<(usize, usize)> {
    let place = |part: usize, name: &str| {
        let found = headers[part].channels.list.iter().position(|channel| channel.name.to_string() == name)?;
        Some((part, found))
    };
    let parts = || std::iter::once(first).chain(0..headers.len());
    parts().find_map(|part| place(part, name)).or_else(|| {
        let (layer, channel) = name.rsplit_once('.')?;
        let is_named = |part: &usize| {
            headers[*part].own_attributes.layer_name.as_ref().is_some_and(|name| name.bytes() == layer.as_bytes())
        };
        parts().filter(is_named).find_map(|part| place(part, channel))
    })
}

fn failed(source: &PictureSource<'_>, error: Error) -> ImageError {
    match error {
        Error::Io(io) => ImageError::read(source.path, io),
        Error::Invalid(what) if what == "reference to missing bytes" => {
            source.malformed("EXR", "it ends too early; was it cut off?")
        }
        Error::NotSupported(what) => {
            ImageError::Unsupported { path: source.path.to_owned(), format: "EXR", detail: what.into_owned() }
        }
        other => source.malformed("EXR", other.to_string()),
    }
}

/// Returns the size of a part's largest block after decompression, in bytes.
fn block_bytes(header: &Header) -> u64 {
    let (block, layer) = (header.max_block_pixel_size(), header.layer_size);
    let pixels = (block.0.min(layer.0) as u64).saturating_mul(block.1.min(layer.1) as u64);
    pixels.saturating_mul(header.channels.bytes_per_pixel as u64)
}

/// Returns true if a DWA block announces more than it can hold. It stores the sizes of its parts as eleven 64-bit
/// numbers, which the decoder allocates; no part can be larger than twice the block, padded to squares of 8 pixels.
fn announces_too_much(chunk: &Chunk, header: &Header) -> bool {
    const UNFOLDED: [usize; 5] = [1, 6, 7, 8, 9];
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return false;
    }
    let pixels = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => return false,
    };
    let place = header.get_block_data_indices(&chunk.compressed_block);
    let Ok(bounds) = place.and_then(|place| header.get_absolute_block_pixel_coordinates(place)) else {
        // The decoder reports a missing block.
        return false;
    };
    let bytes = |width: usize, height: usize| (width * height) as u64 * header.channels.bytes_per_pixel as u64;
    if pixels.len() as u64 == bytes(bounds.size.0, bounds.size.1) {
        // The block is stored uncompressed.
        return false;
    }
    let limit = 2 * bytes(bounds.size.0.next_multiple_of(8), bounds.size.1.next_multiple_of(8));
    let numbers = pixels.as_chunks().0;
    UNFOLDED.iter().filter_map(|&i| numbers.get(i)).any(|number| u64::from_le_bytes(*number) > limit)
}

/// Copies the requested channels of a block. Returns the number of its pixels, or `None` if some are outside of the
/// picture.
fn copy_block(
    block: &UncompressedBlock,
    header: &Header,
    wanted: &[&Target],
    canvas: &mut ChannelCanvas,
) -> Option<usize> {
    let Vec2(x, y) = block.index.pixel_position;
    let Vec2(width, height) = block.index.pixel_size;
    let row_length = canvas.picture.width as usize;
    if x.checked_add(width)? > row_length || y.checked_add(height)? > canvas.picture.height as usize {
        return None;
    }
    let bytes_of_row: usize = header.channels.list.iter().map(|c| width * c.sample_type.bytes_per_sample()).sum();
    let line_of = |channel: usize| -> (Range<usize>, SampleType) {
        let bytes = |c: &exr::prelude::ChannelDescription| width * c.sample_type.bytes_per_sample();
        let start = header.channels.list[..channel].iter().map(bytes).sum();
        let description = &header.channels.list[channel];
        (start..start + bytes(description), description.sample_type)
    };
    let lines: Vec<_> = wanted.iter().map(|target| (line_of(target.channel), target.to)).collect();
    for row in 0..height {
        let bytes = block.data.get(row * bytes_of_row..(row + 1) * bytes_of_row)?;
        let start = (y + row) * row_length + x;
        for ((range, sample_type), to) in &lines {
            let bytes = &bytes[range.clone()];
            match *to {
                ChannelTarget::Color(component) => {
                    let pixels = &mut canvas.picture.data[start..start + width];
                    decode(bytes, *sample_type, pixels.iter_mut().map(|pixel| &mut pixel[component]));
                }
                ChannelTarget::Alpha => {
                    let plane = canvas.alpha.as_mut()?;
                    decode(bytes, *sample_type, plane[start..start + width].iter_mut());
                }
                ChannelTarget::Plane(index) => {
                    let plane = canvas.planes[index].as_mut()?;
                    decode(bytes, *sample_type, plane[start..start + width].iter_mut());
                }
            }
        }
    }
    Some(width * height)
}

/// Converts native-endian samples to floats.
fn decode<'a>(bytes: &[u8], sample_type: SampleType, to: impl Iterator<Item = &'a mut f32>) {
    match sample_type {
        SampleType::F16 => bytes.as_chunks().0.iter().zip(to).for_each(|(b, v)| *v = f16::from_ne_bytes(*b).to_f32()),
        SampleType::F32 => bytes.as_chunks().0.iter().zip(to).for_each(|(b, v)| *v = f32::from_ne_bytes(*b)),
        SampleType::U32 => bytes.as_chunks().0.iter().zip(to).for_each(|(b, v)| *v = u32::from_ne_bytes(*b) as f32),
    }
}

fn metadata(header: &Header) -> Metadata {
    let mut metadata = Metadata::default();
    for (name, value) in header.all_named_attributes() {
        if let AttributeValue::Text(text) = value
            && name != standard_names::NAME
        {
            let name = String::from_utf8_lossy(name);
            let key = name.strip_prefix("bottega.").unwrap_or(&name);
            metadata.set_read(key, String::from_utf8_lossy(text.bytes()).into_owned());
        }
    }
    metadata
}
