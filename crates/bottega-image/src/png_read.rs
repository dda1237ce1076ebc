//! Reading of PNG files.

use std::io::{BufRead, Seek};

use crate::{
    ImageError, Metadata, Picture,
    colorimetry::{Chromaticities, Conversion, WhitePoint},
    limits::{Packing, check_announced},
    source::{ImageFile, PictureSource, file_bytes},
    tone::linear_from_srgb,
};

/// Reads a PNG file.
pub(crate) fn read<R: BufRead + Seek>(source: &PictureSource<'_>, mut input: R) -> Result<ImageFile, ImageError> {
    let bytes_of_file = file_bytes(source, &mut input)?;
    let failed = |error: png::DecodingError| match error {
        png::DecodingError::IoError(io) if io.kind() != std::io::ErrorKind::UnexpectedEof => {
            ImageError::read(source.path, io)
        }
        png::DecodingError::IoError(_) => source.malformed("PNG", "it ends too early; was it cut off?"),
        other => source.malformed("PNG", other.to_string()),
    };
    let mut decoder = png::Decoder::new(input);
    // Expand palettes to RGB, and fewer than 8 bits to 8.
    decoder.set_transformations(png::Transformations::EXPAND);
    let info = decoder.read_header_info().map_err(failed)?;
    let (width, height) = info.size();
    let (columns, rows, pixel_bits) = (u64::from(width), u64::from(height), info.bits_per_pixel() as u64);
    source.check_size(columns, rows)?;
    check_announced((columns, rows), pixel_bits, Packing::DEFLATE, bytes_of_file)
        .map_err(|problem| source.malformed("PNG", problem))?;
    // Limit the decoder's own memory: metadata and a few rows.
    decoder.set_limits(png::Limits { bytes: (64 << 20) + 64 * width as usize });
    let mut reader = decoder.read_info().map_err(failed)?;
    let (color_type, depth) = reader.output_color_type();
    let size = reader.output_buffer_size().ok_or_else(|| source.malformed("PNG", "its size overflows"))?;
    let mut bytes = vec![0; size];
    let frame = reader.next_frame(&mut bytes).map_err(failed)?;
    if (frame.width, frame.height) != (width, height) {
        return Err(source.malformed("PNG", "its first frame does not fill it"));
    }
    reader.finish().map_err(failed)?;

    let info = reader.info();
    let curve = TransferCurve::of(info);
    let mut picture = Picture::new(width, height);
    let samples = color_type.samples();
    match depth {
        png::BitDepth::Sixteen => {
            let pixels = bytes.chunks_exact(2 * samples);
            fill(&mut picture, samples, pixels, |pixel: &[u8], channel| {
                curve.decode(f32::from(u16::from_be_bytes([pixel[2 * channel], pixel[2 * channel + 1]])) / 65535.0)
            });
        }
        _ => {
            let table: Vec<f32> = (0..256u16).map(|v| curve.decode(f32::from(v) / 255.0)).collect();
            let pixels = bytes.chunks_exact(samples);
            fill(&mut picture, samples, pixels, |pixel: &[u8], channel| table[usize::from(pixel[channel])]);
        }
    }
    conversion(info, source.white_point).apply(&mut picture.data);
    Ok(ImageFile { picture, offset: (0, 0), full_size: (width, height), metadata: metadata(info) })
}

/// Fills a picture from gray or RGB pixels; alpha is ignored.
fn fill<'a>(
    picture: &mut Picture,
    samples: usize,
    pixels: impl Iterator<Item = &'a [u8]>,
    value: impl Fn(&'a [u8], usize) -> f32,
) {
    let channels = if samples < 3 { [0; 3] } else { [0, 1, 2] };
    for (to, pixel) in picture.data.iter_mut().zip(pixels) {
        *to = channels.map(|channel| value(pixel, channel));
    }
}

/// Returns the conversion from the file's primaries, unless it is marked as sRGB.
fn conversion(info: &png::Info<'_>, white_point: WhitePoint) -> Conversion {
    let is_color = !matches!(info.color_type, png::ColorType::Grayscale | png::ColorType::GrayscaleAlpha);
    let Some(found) = info.chrm_chunk.filter(|_| info.srgb.is_none() && is_color) else { return Conversion::NONE };
    let number = |value: png::ScaledFloat| f64::from(value.into_value());
    let numbers = [found.red, found.green, found.blue, found.white].map(|(x, y)| [number(x), number(y)]);
    let [[rx, ry], [gx, gy], [bx, by], [wx, wy]] = numbers;
    let chromaticities = Chromaticities::from_numbers([rx, ry, gx, gy, bx, by, wx, wy]);
    // Ignore impossible primaries.
    chromaticities.to_rec709(white_point).unwrap_or_default()
}

/// The conversion of the file's values to linear.
enum TransferCurve {
    Srgb,
    /// Power law: linear = value^exponent.
    Power(f32),
}

impl TransferCurve {
    /// Returns the curve of the file's gamma; sRGB if it names none.
    fn of(info: &png::Info<'_>) -> Self {
        match info.gama_chunk.map(png::ScaledFloat::into_value) {
            Some(gamma) if info.srgb.is_none() && gamma > 0.01 && (gamma - 1.0 / 2.2).abs() > 0.01 => {
                Self::Power(1.0 / gamma)
            }
            _ => Self::Srgb,
        }
    }

    fn decode(&self, value: f32) -> f32 {
        match *self {
            Self::Srgb => linear_from_srgb(value),
            Self::Power(1.0) => value,
            Self::Power(exponent) => value.powf(exponent),
        }
    }
}

fn metadata(info: &png::Info<'_>) -> Metadata {
    let mut metadata = Metadata::default();
    let own_key = |key: &str| if key == "Software" { "software".to_owned() } else { key.to_owned() };
    for chunk in &info.uncompressed_latin1_text {
        metadata.set_read(&own_key(&chunk.keyword), chunk.text.clone());
    }
    for chunk in &info.utf8_text {
        if let Ok(text) = chunk.get_text() {
            metadata.set_read(&own_key(&chunk.keyword), text);
        }
    }
    metadata
}
