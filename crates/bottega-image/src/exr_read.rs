//! Pictures from OpenEXR files, ours and other programs'.

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

use crate::{
    ImageError, Metadata, Picture,
    read::{ImageFile, Source},
};

/// The most bytes that one compressed block of a file may unfold to.
const MAX_BLOCK_BYTES: u64 = 1 << 30;

/// Planes of further channels, in the order in which they were asked for; `None` where the file has no such channel.
pub type Planes = Vec<Option<Vec<f32>>>;

/// The color of a file, and the channels of these full names.
pub(crate) fn read<R: BufRead + Seek>(
    source: &Source<'_>,
    input: R,
    names: &[String],
) -> Result<(ImageFile, Planes), ImageError> {
    let reader = exr::block::read(input, false).map_err(|error| failed(source, error))?;
    let headers = reader.headers();
    let found = find_color(headers).ok_or_else(|| ImageError::NoColor {
        path: source.path.to_owned(),
        found: headers.iter().flat_map(|h| &h.channels.list).map(|c| c.name.to_string()).collect::<Vec<_>>().join(", "),
    })?;
    for header in headers {
        source.check_size(header.layer_size.0 as u64, header.layer_size.1 as u64)?;
        if block_bytes(header) > MAX_BLOCK_BYTES {
            return Err(source.malformed("EXR", "a block of pixels is larger than 1 GiB"));
        }
    }

    let header = headers[found.part].clone();
    let size = header.layer_size;
    let mut targets: Vec<Target> = found
        .channels
        .iter()
        .enumerate()
        .map(|(i, &channel)| Target { part: found.part, channel, to: To::Color(i) })
        .collect();
    let more = names.iter().enumerate();
    targets.extend(more.filter_map(|(i, name)| {
        let (part, channel) = find_channel(headers, found.part, name)?;
        // A part of another size is another picture.
        (headers[part].layer_size == size).then_some(Target { part, channel, to: To::Plane(i) })
    }));
    let headers = headers.to_vec();
    let mut canvas = Canvas { picture: Picture::new(size.0 as u32, size.1 as u32), planes: vec![None; names.len()] };
    for target in &targets {
        if let To::Plane(index) = target.to {
            canvas.planes[index] = Some(vec![0.0; size.0 * size.1]);
        }
    }
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
            covered[part] += copy_block(&block, &headers[part], &wanted, &mut canvas)
                .ok_or_else(|| source.malformed("EXR", "a block of pixels lies outside the data window"))?;
        }
    }
    if let Some(target) = targets.iter().find(|target| covered[target.part] != size.0 * size.1) {
        let count = covered[target.part];
        return Err(source.malformed("EXR", format!("{count} of {} pixels are there", size.0 * size.1)));
    }
    let position = header.own_attributes.layer_position;
    let display = header.shared_attributes.display_window;
    let file = ImageFile {
        picture: canvas.picture,
        offset: (position.0.saturating_sub(display.position.0), position.1.saturating_sub(display.position.1)),
        full_size: (display.size.0 as u32, display.size.1 as u32),
        metadata: metadata(&header),
    };
    Ok((file, canvas.planes))
}

/// A channel of the file, and where its values go.
struct Target {
    part: usize,
    channel: usize,
    to: To,
}

#[derive(Clone, Copy)]
enum To {
    /// A component of the picture.
    Color(usize),
    /// A plane of its own.
    Plane(usize),
}

/// What is read.
struct Canvas {
    picture: Picture,
    planes: Planes,
}

/// The channel of this name: as it stands, in the part of the color first, or in a part that has the name of its layer.
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

fn failed(source: &Source<'_>, error: Error) -> ImageError {
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

/// Bytes of the largest block of a part, unfolded.
fn block_bytes(header: &Header) -> u64 {
    let (block, layer) = (header.max_block_pixel_size(), header.layer_size);
    let pixels = (block.0.min(layer.0) as u64).saturating_mul(block.1.min(layer.1) as u64);
    pixels.saturating_mul(header.channels.bytes_per_pixel as u64)
}

/// A block of DWA compression announces in eleven numbers of 64 bits what it unfolds to, and the decoder allocates
/// that: no part of it can be larger than twice the block, padded to squares of 8 pixels.
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
        // Not there: the decoder says so.
        return false;
    };
    let bytes = |width: usize, height: usize| (width * height) as u64 * header.channels.bytes_per_pixel as u64;
    if pixels.len() as u64 == bytes(bounds.size.0, bounds.size.1) {
        // Stored as it is.
        return false;
    }
    let limit = 2 * bytes(bounds.size.0.next_multiple_of(8), bounds.size.1.next_multiple_of(8));
    let numbers = pixels.as_chunks().0;
    UNFOLDED.iter().filter_map(|&i| numbers.get(i)).any(|number| u64::from_le_bytes(*number) > limit)
}

/// Which channels of which part of the file are the color.
struct Color {
    part: usize,
    /// Channel of red, green and blue; the same one three times for gray.
    channels: [usize; 3],
}

/// The first of: R, G, B without a layer; R, G, B of a layer called by a usual name of the whole picture; those of any
/// other layer that is no AOV; those of any layer; Y. Parts in the order of the file.
fn find_color(headers: &[Header]) -> Option<Color> {
    let rank = |prefix: &str| match prefix.to_ascii_lowercase().as_str() {
        "" => 0,
        p if ["combined", "rgba", "rgb", "color", "beauty", "image"].iter().any(|name| p.contains(name)) => 1,
        p if ["albedo", "normal", "position", "uv", "depth"].iter().any(|name| p.contains(name)) => 3,
        _ => 2,
    };
    let mut best: Option<((usize, usize), Color)> = None;
    for (layer, header) in headers.iter().enumerate() {
        let names: Vec<String> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
        let find = |wanted: String| names.iter().position(|name| name.eq_ignore_ascii_case(&wanted));
        for name in &names {
            let (prefix, last) = name.rsplit_once('.').map_or(("", name.as_str()), |(prefix, last)| (prefix, last));
            let dotted = if prefix.is_empty() { String::new() } else { format!("{prefix}.") };
            let (gray, channels) = match last {
                "R" | "r" => (0, [find(format!("{dotted}R")), find(format!("{dotted}G")), find(format!("{dotted}B"))]),
                "Y" | "y" => (4, [find(format!("{dotted}Y")); 3]),
                _ => continue,
            };
            let part = header.own_attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
            let key = (gray + rank(prefix), rank(&part));
            if let [Some(r), Some(g), Some(b)] = channels
                && best.as_ref().is_none_or(|(other, _)| key < *other)
            {
                best = Some((key, Color { part: layer, channels: [r, g, b] }));
            }
        }
    }
    best.map(|(_, color)| color)
}

/// Copies what is wanted of a block; the number of its pixels, or `None` when they are not all in the picture.
fn copy_block(block: &UncompressedBlock, header: &Header, wanted: &[&Target], canvas: &mut Canvas) -> Option<usize> {
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
                To::Color(component) => {
                    let pixels = &mut canvas.picture.data[start..start + width];
                    decode(bytes, *sample_type, pixels.iter_mut().map(|pixel| &mut pixel[component]));
                }
                To::Plane(index) => {
                    let plane = canvas.planes[index].as_mut()?;
                    decode(bytes, *sample_type, plane[start..start + width].iter_mut());
                }
            }
        }
    }
    Some(width * height)
}

/// Native-endian samples to floats.
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
