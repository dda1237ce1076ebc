//! Writing of PNG files.

use std::{io::Write, path::Path};

use crate::{
    Encoding, Film, ImageError, Layout, Metadata, ToneMap,
    output::AtomicFile,
    parallel::{map_in_order, thread_count},
    tone::{exposure_factor, quantize},
};

/// Options of a PNG file of a film.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PngOptions {
    /// Exposure, in stops; positive: brighter.
    pub exposure_stops: f32,
    /// Tone map, applied after the exposure.
    pub tone: ToneMap,
    /// Encoding of the values.
    pub encoding: Encoding,
    /// Bits per channel.
    pub bits: PngBits,
    /// `true`: write alpha. Pixels that show the environment become transparent, and the color is divided by alpha.
    pub alpha: bool,
}

/// The bits per channel of a PNG file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PngBits {
    /// 8 bits, dithered against banding. Equal films give equal bytes.
    #[default]
    Eight,
    /// 16 bits, rounded.
    Sixteen,
}

/// Writes a film to `path`, atomically: exposure, tone mapping and encoding, row by row. Metadata becomes text chunks.
///
/// # Errors
/// The film has no pixels, or the file cannot be written.
pub fn write_png(
    path: impl AsRef<Path>,
    film: &Film,
    options: &PngOptions,
    metadata: &Metadata,
) -> Result<(), ImageError> {
    frame_of(film, options, metadata).write(path.as_ref(), |row, out| encode_row(film, row, options, out))
}

/// Returns the bytes of the file that [`write_png`] writes.
///
/// # Errors
/// The film has no pixels, or more than a PNG file can have.
pub fn png_bytes(film: &Film, options: &PngOptions, metadata: &Metadata) -> Result<Vec<u8>, ImageError> {
    frame_of(film, options, metadata).to_bytes(|row, out| encode_row(film, row, options, out))
}

fn frame_of<'a>(film: &Film, options: &PngOptions, metadata: &'a Metadata) -> PngFrame<'a> {
    let size = (film.rect().width(), film.rect().height());
    let color_type = if options.alpha { png::ColorType::Rgba } else { png::ColorType::Rgb };
    PngFrame { size, color_type, bits: options.bits, encoding: options.encoding, metadata }
}

/// Appends the bytes of a row of a film, counted from its upper edge.
fn encode_row(film: &Film, row: u32, options: &PngOptions, out: &mut Vec<u8>) {
    let rect = film.rect();
    for x in rect.x0..rect.x1 {
        encode_pixel(film.pixel(x, rect.y0 + row), (x, rect.y0 + row), options, out);
    }
}

/// Writes rows of 8-bit sRGB, `[height × width × 3]`, to `path`, atomically. Panics if the length differs.
///
/// # Errors
/// The picture has no pixels, or the file cannot be written.
pub fn write_png_rgb8(path: impl AsRef<Path>, width: u32, height: u32, rgb: &[u8]) -> Result<(), ImageError> {
    let row_bytes = 3 * width as usize;
    assert_eq!(rgb.len(), row_bytes * height as usize, "bytes of a picture of {width} × {height}");
    let metadata = Metadata::new();
    let frame = PngFrame {
        size: (width, height),
        color_type: png::ColorType::Rgb,
        bits: PngBits::Eight,
        encoding: Encoding::Srgb,
        metadata: &metadata,
    };
    frame.write(path.as_ref(), |row, out| out.extend_from_slice(&rgb[row as usize * row_bytes..][..row_bytes]))
}

/// Encodes a picture of 8-bit sRGB as a PNG file.
///
/// - `size`: columns and rows, both at least 1.
/// - `row(y, out)`: appends the bytes of a row, `[width × 3]`, to `out`.
pub(crate) fn png_bytes_rgb8(size: (u32, u32), row: impl Fn(u32, &mut Vec<u8>) + Sync) -> Result<Vec<u8>, ImageError> {
    let metadata = Metadata::new();
    let frame = PngFrame {
        size,
        color_type: png::ColorType::Rgb,
        bits: PngBits::Eight,
        encoding: Encoding::Srgb,
        metadata: &metadata,
    };
    frame.to_bytes(row)
}

/// Appends the bytes of one pixel: `[r, g, b, alpha, …]` of a film.
fn encode_pixel(pixel: &[f32], (x, y): (u32, u32), options: &PngOptions, out: &mut Vec<u8>) {
    let alpha = pixel[Layout::ALPHA].clamp(0.0, 1.0);
    let mut factor = exposure_factor(options.exposure_stops);
    if options.alpha {
        factor = if alpha > 0.0 { factor / alpha } else { 0.0 };
    }
    let shown = options.tone.apply([pixel[0] * factor, pixel[1] * factor, pixel[2] * factor]);
    let mut channels = [0.0, 0.0, 0.0, alpha];
    for (channel, value) in channels.iter_mut().zip(shown) {
        *channel = options.encoding.encode(value);
    }
    for &channel in &channels[..if options.alpha { 4 } else { 3 }] {
        match options.bits {
            PngBits::Eight => out.push(quantize(channel, 255.0, Some((x, y))) as u8),
            PngBits::Sixteen => out.extend_from_slice(&(quantize(channel, 65535.0, None) as u16).to_be_bytes()),
        }
    }
}

/// Rows that a thread encodes before they are written; bounds the memory.
const ROWS_AT_ONCE: usize = 16;

struct PngFrame<'a> {
    size: (u32, u32),
    color_type: png::ColorType,
    bits: PngBits,
    encoding: Encoding,
    metadata: &'a Metadata,
}

impl PngFrame<'_> {
    /// Writes the file; `row(y, out)` appends the bytes of a row to `out`.
    fn write(&self, path: &Path, row: impl Fn(u32, &mut Vec<u8>) + Sync) -> Result<(), ImageError> {
        let (width, height) = self.size;
        if width == 0 || height == 0 {
            return Err(ImageError::Empty { path: path.to_owned() });
        }
        let mut file = AtomicFile::create(path)?;
        self.write_to(file.writer(), row).map_err(|error| match error {
            png::EncodingError::IoError(source) => ImageError::write(path, source),
            other => ImageError::NotWritable { path: path.to_owned(), reason: other.to_string() },
        })?;
        file.commit()
    }

    /// Encodes the file in memory.
    fn to_bytes(&self, row: impl Fn(u32, &mut Vec<u8>) + Sync) -> Result<Vec<u8>, ImageError> {
        let mut bytes = Vec::new();
        self.write_to(&mut bytes, row)
            .map_err(|error| ImageError::NotWritable { path: "a PNG picture".into(), reason: error.to_string() })?;
        Ok(bytes)
    }

    fn write_to(&self, out: &mut impl Write, row: impl Fn(u32, &mut Vec<u8>) + Sync) -> Result<(), png::EncodingError> {
        let (width, height) = self.size;
        let mut encoder = png::Encoder::new(&mut *out, width, height);
        encoder.set_color(self.color_type);
        // Ten times as fast as the default, with files a tenth larger.
        encoder.set_compression(png::Compression::Fast);
        encoder.set_depth(match self.bits {
            PngBits::Eight => png::BitDepth::Eight,
            PngBits::Sixteen => png::BitDepth::Sixteen,
        });
        match self.encoding {
            Encoding::Srgb => encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual),
            Encoding::Linear => encoder.set_source_gamma(png::ScaledFloat::new(1.0)),
        }
        // A PNG has no layers, so none of the entries that describe a Cryptomatte
        let entries = self.metadata.iter().filter(|(key, _)| !key.starts_with("cryptomatte/"));
        for (key, value) in entries {
            // Use the format's own key for the program.
            let key = if key == "software" { "Software" } else { key }.to_owned();
            if value.is_ascii() {
                encoder.add_text_chunk(key, value.to_owned())?;
            } else {
                encoder.add_itxt_chunk(key, value.to_owned())?;
            }
        }
        let mut writer = encoder.write_header()?;
        let mut stream = writer.stream_writer()?;
        let rows: Vec<u32> = (0..height).collect();
        for batch in rows.chunks(ROWS_AT_ONCE * thread_count()) {
            let encoded = map_in_order(batch, |&y| {
                let mut bytes = Vec::new();
                row(y, &mut bytes);
                bytes
            });
            for bytes in encoded {
                stream.write_all(&bytes)?;
            }
        }
        stream.finish()?;
        writer.finish()
    }
}
